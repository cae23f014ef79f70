"""Tapes of nodes as one file in the MCAP format."""

from collections.abc import Iterable
from pathlib import Path

from redres_ros.demo.tape import TOPICS, read_tape
from redres_ros.graph.mcap_file import McapFile


def write_tapes(file: McapFile, tapes: Iterable[Path], since: int) -> None:
    """Write what nodes have said on their tapes, in the order of time.

    Args:
        file: To be written.
        tapes: One a process.
        since: What the monotonic clock lacks to the time of day [ns].
    """
    entries = [entry for tape in tapes for entry in read_tape(tape) if not entry.heard]
    for topic in sorted({entry.topic for entry in entries}):
        file.add_topic(f'/{topic.removeprefix("/")}', TOPICS[topic])
    for entry in sorted(entries, key=lambda entry: entry.time):
        at = entry.time + since
        file.write(f'/{entry.topic.removeprefix("/")}', entry.data, at, at)
