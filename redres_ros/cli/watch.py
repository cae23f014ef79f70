"""`redres watch`: the live state of running nodes, and their controller's parameters."""

import argparse
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

from redres_ros.cli.options import DURATIONS, add_graph, read_settings
from redres_ros.cli.parser import add_command, option
from redres_ros.errors import UnknownNameError

if TYPE_CHECKING:
    from redres_ros.graph.client import GraphClient

_PATIENCE = 20.0  # [s] for a controller on a busy machine to be found, and to respond


def add(commands: Any) -> None:
    """Declare the subcommand."""
    watch = add_command(
        commands,
        'watch',
        'the live state of running nodes; switches their law',
        '--domain 42',
        '--set law=minimum_velocity  # another law, and its effect',
        '--set limit_scale=0.5 --duration 0  # sets it, and ends',
        '--duration 10 > watch.txt  # not in a terminal: a line a second',
    )
    parameters = 'first set these parameters of the controller, all or none'
    option(watch, '--set', 'NAME=VALUE', parameters, nargs='+', action='extend')
    duration = 'end after this time [s]; default: run until Ctrl-C'
    option(watch, '--duration', 'S', duration, type=float, within=DURATIONS)
    add_graph(watch)
    watch.set_defaults(run=_watch)


def _watch(options: argparse.Namespace) -> int:
    from redres_ros.graph.client import GraphClient
    from redres_ros.graph.watch import Watch, watch
    from redres_ros.nodes.runtime import joined_domain, spun

    texts = options.set or []
    settings = read_settings(texts)
    with joined_domain(options.domain), spun(lambda: Watch(options.namespace)) as node:
        if settings:
            client = GraphClient(node, _PATIENCE)
            _check_names(client, settings)
            client.set_parameters('controller', settings)
            print(f'controller: {", ".join(texts)}', flush=True)
            if options.duration == 0.0:
                return 0
        watch(node, options.duration)
        return 0 if node.values else 1


def _check_names(client: 'GraphClient', settings: Mapping[str, Any]) -> None:
    """Refuse a parameter that the controller does not have. Raises UnknownNameError, CallError."""
    present = client.parameters('controller')
    for name in settings:
        if name not in present:
            raise UnknownNameError('parameter of the controller', name, present)
