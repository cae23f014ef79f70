"""`redres watch`: the live state of running nodes."""

import argparse
from typing import Any

from redres_ros.cli.options import add_domain, add_namespace, add_watching_time, check_duration
from redres_ros.cli.parser import add_command


def add(commands: Any) -> None:
    """Declare the subcommand."""
    watch = add_command(
        commands,
        'watch',
        'the live state of running nodes',
        '--domain 42',
        '--duration 10 > watch.txt  # a line a second where no terminal is',
    )
    add_watching_time(watch)
    add_domain(watch)
    add_namespace(watch)
    watch.set_defaults(run=_watch)


def _watch(options: argparse.Namespace) -> int:
    import threading

    from redres_ros.graph.watch import Watch, watch
    from redres_ros.nodes.discovery import joined_domain
    from redres_ros.nodes.runtime import spun

    check_duration(options.duration)
    with joined_domain(options.domain), spun(lambda: Watch(options.namespace)) as node:
        try:
            watch(node, threading.Event(), options.duration)
        finally:
            node.close()
        return 0 if node.heard else 1
