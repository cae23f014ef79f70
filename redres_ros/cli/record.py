"""`redres record`: the messages of running nodes into a file."""

import argparse
from pathlib import Path
from typing import Any

from redres_ros.cli.files import prepare
from redres_ros.cli.options import add_domain, add_watching_time, topic_name
from redres_ros.cli.parser import OptionError, add_command, option

_SUFFIX = '.mcap'


def add(commands: Any) -> None:
    """Declare the subcommand."""
    record = add_command(
        commands,
        'record',
        'record the messages of running nodes in an MCAP file',
        'run.mcap --duration 60',
        'run.mcap --topics joint_states,joint_command --domain 42',
    )
    option(record, 'file', f'FILE{_SUFFIX}', 'overwritten if it exists', type=Path)
    add_watching_time(record)
    topics = 'topics to record; default: all'
    option(record, '--topics', 'A,B,...', topics, (), type=_topic_names)
    add_domain(record)
    record.set_defaults(run=_record)


def _topic_names(text: str) -> tuple[str, ...]:
    return tuple(map(topic_name, text.split(',')))


def _record(options: argparse.Namespace) -> int:
    import signal
    import threading

    from redres_ros.files.signals import handle
    from redres_ros.graph.mcap_file import McapFile
    from redres_ros.graph.recorder import GraphRecorder
    from redres_ros.nodes.discovery import joined_domain
    from redres_ros.nodes.runtime import spun

    if options.file.suffix != _SUFFIX:
        raise OptionError(f'the recording {options.file}; expected a name that ends in {_SUFFIX}')
    prepare(options.file)
    stopped = threading.Event()
    handle(lambda *_: stopped.set(), signal.SIGINT, signal.SIGTERM)
    with (
        joined_domain(options.domain),
        McapFile(options.file) as file,
        spun(lambda: GraphRecorder(file, options.topics)) as recorder,
    ):
        recorder.run(stopped, options.duration)
    print(f'{recorder.messages} messages of {recorder.topics} topics in {options.file}')
    return 0 if recorder.messages else 1
