"""`redres laws`, which lists them, and `redres law`, which switches a running controller to one."""

import argparse
from typing import Any

from redres_ros.cli.options import add_domain


def add(commands: Any) -> None:
    """Declare the subcommands."""
    laws = commands.add_parser('laws', help='the laws and their equations')
    laws.set_defaults(run=_laws)
    law = commands.add_parser('law', help='switch the law of a running controller')
    law.add_argument('name', metavar='NAME', help='see `redres laws`')
    law.add_argument(
        '--damping', type=float, metavar='K_D', help='null-space damping [1/s]; default: as it is'
    )
    add_domain(law)
    law.set_defaults(run=_law)


def _laws(options: argparse.Namespace) -> int:
    import inspect

    from redres_ros.laws import LAWS

    for name, law in LAWS.items():
        print(f'{name:<26}{inspect.getdoc(law)}')
    return 0


def _law(options: argparse.Namespace) -> int:
    from rclpy.node import Node

    from redres_ros.demo.client import set_parameters
    from redres_ros.demo.processes import joined_domain
    from redres_ros.laws import make_law
    from redres_ros.nodes.runtime import spun

    gains = {} if options.damping is None else {'damping': options.damping}
    make_law(options.name, **gains)
    with joined_domain(options.domain), spun(lambda: Node('redres_law')) as node:
        set_parameters(node, 'controller', {'law': options.name, **gains})
    print(
        f'controller: {options.name}'
        + ''.join(f', {gain} {value:g} 1/s' for gain, value in gains.items())
    )
    return 0
