"""Whether a recorder that listens beside a running graph gets every message.

    python benchmarks/every_message.py [--seconds S] [--rate HZ] [--topics A,B,...]

Each node writes down what it says, and a recorder what it hears. Afterwards the two are compared,
message by message.
"""

import argparse
import sys
import tempfile
import threading
import time
from collections import defaultdict, deque
from collections.abc import Collection, Iterable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import NamedTuple

from redres_ros.bench.loop import PARAMETERS
from redres_ros.demo.processes import NodeProcess
from redres_ros.graph.mcap_file import McapFile, RecordedMessage, read_messages
from redres_ros.graph.recorder import GraphRecorder
from redres_ros.nodes.discovery import own_domain
from redres_ros.nodes.runtime import spun

JOINING = 4.0  # [s] for the recorder to find all topics, and at the end for what is under way
LATE = 500_000_000  # [ns] from what a node said to its publication, at most
NODES = ('planner', 'controller', 'sim')
START = 120.0  # [s] for the nodes to appear, which may have to be compiled first


class Span(NamedTuple):
    """What counts: its begin and end [ns], and the fraction of a core for the recorder."""

    begin: int
    end: int
    share: float


class Said(NamedTuple):
    """A message: when it was said [ns], and its content."""

    time: int
    content: str


class Topic(NamedTuple):
    """How many messages of a topic were said, and how many of these were not heard."""

    said: int
    lost: int


def main(arguments: Sequence[str]) -> int:
    """Record, compare, and print a line for each topic; 1 if a message was lost."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument('--seconds', type=float, default=60.0)
    parser.add_argument('--rate', type=float, default=500.0)
    parser.add_argument('--topics', default='')
    options = parser.parse_args(arguments)
    wanted = tuple(filter(None, options.topics.split(',')))
    with tempfile.TemporaryDirectory() as directory:
        out = Path(directory)
        span = record(out, options.seconds, options.rate, wanted)
        topics = compare(out, span)
    for name, topic in sorted(topics.items()):
        print(f'{name}: {topic.said} said, {topic.lost} lost')
    said = sum(topic.said for topic in topics.values())
    lost = sum(topic.lost for topic in topics.values())
    seconds = (span.end - span.begin) / 1e9
    print(f'all: {said} said in {seconds:.1f} s, {lost} lost; {span.share:.1%} of a core')
    return 1 if lost or not said else 0


def record(out: Path, seconds: float, rate: float, wanted: Collection[str] = ()) -> Span:
    """Record a graph of our own.

    Args:
        out: Directory for the files of nodes and recorder.
        seconds: How long what is said counts.
        rate: Of the robot [Hz].
        wanted: Topics that are recorded; empty for all.
    """
    stopped = threading.Event()
    with (
        graph(out, rate, wanted),
        McapFile(out / 'run.mcap') as file,
        spun(lambda: GraphRecorder(file, wanted)) as recorder,
    ):
        recorder.client.await_nodes(stopped, START)
        thread = threading.Thread(target=recorder.run, args=(stopped,))
        thread.start()
        time.sleep(JOINING)
        begin = time.time_ns()
        worked = time.process_time()
        time.sleep(seconds)
        share = (time.process_time() - worked) / seconds
        end = time.time_ns()
        time.sleep(JOINING)
        stopped.set()
        thread.join()
    return Span(begin, end, share)


@contextmanager
def graph(out: Path, rate: float, topics: Sequence[str]) -> Iterator[None]:
    """The nodes, each with a recording of some topics.

    Args:
        out: Directory for what they print and say.
        rate: Of the robot [Hz].
        topics: Those that are recorded.
    """
    nodes = []
    with own_domain():
        try:
            for name in NODES:
                recording = out / f'{name}.mcap'
                log = out / f'{name}.log'
                parameters = {'rate': rate, **PARAMETERS.get(name, {})}
                nodes.append(NodeProcess(name, log, parameters, recording=recording, topics=topics))
            yield
        finally:
            for node in nodes:
                node.end()


def compare(out: Path, span: Span) -> dict[str, Topic]:
    """What was said, and what of it was not heard, by 'topic of node'.

    Args:
        out: Directory with the files of nodes and recorder.
        span: What counts.
    """
    heard = defaultdict(list)
    for message in read_messages(out / 'run.mcap'):
        heard[message.topic].append(Said(message.sent, _content(message)))
    topics = {}
    for node in NODES:
        said = defaultdict(list)
        for message in read_messages(out / f'{node}.mcap'):
            if not message.is_received and span.begin <= message.time < span.end:
                said[message.topic].append(Said(message.time, _content(message)))
        for topic, each in said.items():
            topics[f'{topic} of {node}'] = Topic(len(each), missing(each, heard[topic]))
    return topics


def _content(message: RecordedMessage) -> str:
    """What a message says; what fills it up to whole words on the wire is anything."""
    return repr(message.content)


def missing(said: Sequence[Said], heard: Sequence[Said]) -> int:
    """How many messages of a topic were not heard.

    Args:
        said: All of some time, in their order.
        heard: All that were recorded, before and after that time, too.
    """
    count = 0
    waiting = deque(sorted(heard))
    for message in said:
        while waiting and waiting[0].time < message.time:
            waiting.popleft()
        place = _place_of(message, waiting)
        if place is None:
            count += 1
        else:
            del waiting[place]
    return count


def _place_of(message: Said, waiting: Iterable[Said]) -> int | None:
    """Where the first of its content is that was published in time; None if there is none.

    Args:
        message: As it was said.
        waiting: Those that were heard after it was said, in their order.
    """
    for place, other in enumerate(waiting):
        if other.time > message.time + LATE:
            return None
        if other.content == message.content:
            return place
    return None


if __name__ == '__main__':
    sys.exit(main(sys.argv[1:]))
