"""`redres view`: a page in the browser that shows running nodes and steers them."""

import argparse
from typing import Any

from redres_ros.cli.options import add_graph
from redres_ros.cli.parser import add_command, option


def add(commands: Any) -> None:
    """Declare the subcommand."""
    view = add_command(
        commands, 'view', 'a page in the browser: see and steer running nodes', '--domain 42'
    )
    option(
        view,
        '--port',
        'N',
        'port of the page on this computer; if it is taken, the next free one',
        8080,
    )
    add_graph(view)
    view.set_defaults(run=_view)


def _view(options: argparse.Namespace) -> int:
    from redres_ros.nodes.runtime import joined_domain
    from redres_ros.view.page import main

    words = ['--ros-args', '-p', f'port:={options.port}']
    if options.namespace:
        words += ['-r', f'__ns:=/{options.namespace.lstrip("/")}']
    with joined_domain(options.domain):
        return main(['redres view', *words])
