"""`redres teleop`: move the tip of a running arm by keys."""

import argparse
from typing import Any

from redres_ros.cli.options import add_domain, add_namespace
from redres_ros.cli.parser import add_command


def add(commands: Any) -> None:
    """Declare the subcommand."""
    teleop = add_command(
        commands,
        'teleop',
        'move the tip of a running arm by keys',
        '--speed 0.02  # slowly',
        '--frame tool0 --domain 42  # along the axes of the tool',
    )
    teleop.add_argument(
        '--speed', type=float, default=0.05, metavar='X', help='of a key that moves [m/s]'
    )
    teleop.add_argument(
        '--turn', type=float, default=0.3, metavar='X', help='of a key that turns [rad/s]'
    )
    teleop.add_argument(
        '--frame',
        metavar='FRAME',
        help='link along whose axes the keys move; default: the base',
    )
    add_domain(teleop)
    add_namespace(teleop)
    teleop.set_defaults(run=_teleop)


def _teleop(options: argparse.Namespace) -> int:
    from redres_ros.graph.teleop import KeyMap, Teleop, check_terminal, steer
    from redres_ros.nodes.discovery import joined_domain
    from redres_ros.nodes.runtime import spun

    check_terminal()
    key_map = KeyMap(options.speed, options.turn)

    def make() -> Teleop:
        return Teleop(key_map, options.frame or '', options.namespace)

    try:
        with joined_domain(options.domain), spun(make) as node:
            steer(node)
    except KeyboardInterrupt:
        pass  # the way to end it
    return 0
