"""`redres teleop`: move the tip of a running arm by keys."""

import argparse
from contextlib import suppress
from functools import partial
from typing import Any

from redres_ros.cli.options import add_domain, add_namespace
from redres_ros.cli.parser import add_command, option


def add(commands: Any) -> None:
    """Declare the subcommand."""
    teleop = add_command(
        commands,
        'teleop',
        'move the tip of a running arm by keys',
        '--speed 0.02  # slowly',
        '--frame tool0 --domain 42  # along the axes of the tool',
    )
    option(teleop, '--speed', 'X', 'speed of the keys that translate [m/s]', 0.05)
    option(teleop, '--turn', 'X', 'speed of the keys that rotate [rad/s]', 0.3)
    option(teleop, '--frame', 'FRAME', 'link along whose axes the keys move; default: the base')
    add_domain(teleop)
    add_namespace(teleop)
    teleop.set_defaults(run=_teleop)


def _teleop(options: argparse.Namespace) -> int:
    from redres_ros.graph.teleop import KeyMap, Teleop, check_terminal, steer
    from redres_ros.nodes.discovery import joined_domain
    from redres_ros.nodes.runtime import spun

    check_terminal()
    key_map = KeyMap(options.speed, options.turn)
    make = partial(Teleop, key_map, options.frame or '', options.namespace)
    with (
        suppress(KeyboardInterrupt),  # the usual end
        joined_domain(options.domain),
        spun(make) as node,
    ):
        steer(node)
    return 0
