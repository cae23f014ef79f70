"""`redres view`: a page in the browser that shows running nodes and steers them."""

import argparse
from typing import Any

from redres_ros.cli.options import add_domain
from redres_ros.cli.parser import add_command
from redres_ros.errors import RangeError

PORTS = (1024, 65535)
PORT = 8080


def add(commands: Any) -> None:
    """Declare the subcommand."""
    view = add_command(
        commands, 'view', 'a page in the browser: see and steer running nodes', '--domain 42'
    )
    view.add_argument(
        '--port',
        type=int,
        default=PORT,
        metavar='N',
        help=f'of the page on this computer, {PORT} by default; the next free one is taken',
    )
    add_domain(view)
    view.set_defaults(run=_view)


def _view(options: argparse.Namespace) -> int:
    from redres_ros.nodes.discovery import joined_domain
    from redres_ros.view.serve import main

    if not PORTS[0] <= options.port <= PORTS[1]:
        raise RangeError('port', options.port, *PORTS)
    with joined_domain(options.domain):
        return main(['redres view', '--ros-args', '-p', f'port:={options.port}'])
