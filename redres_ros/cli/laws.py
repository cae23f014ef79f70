"""`redres laws`: lists laws, preferences, tasks, limits and arms."""

import argparse
import inspect
import shutil
import sys
import textwrap
from typing import TYPE_CHECKING, Any

from redres_ros.cli.parser import add_command

if TYPE_CHECKING:
    from redres_ros.robots import Arm

_NAME_WIDTH = 26  # columns
_NARROWEST = 60  # columns; text beside the names needs some

_HEADS = {
    'law': 'laws, --law NAME: the quantity to minimise',
    'preference': 'preferences, --prefer NAME=GAIN: a joint-space objective in the null space',
    'task': 'tasks, --secondary NAME: secondary tasks, in order of priority',
    'limit': 'limits, --limits A,B: what every command keeps',
    'robot': 'robots, --robot NAME: arms; or any other from its URDF file',
}


def add(commands: Any) -> None:
    """Declare the subcommand."""
    laws = add_command(
        commands,
        'laws',
        'laws, preferences, tasks, limits and arms by name',
        '# all of them',
        '--plugin my_laws.py  # and those in this file',
    )
    laws.set_defaults(run=_laws)


def _laws(options: argparse.Namespace) -> int:
    from redres_ros.cli.gains import find_tables
    from redres_ros.robots import ARMS

    for table in find_tables(limits=True):
        print(_HEADS[table.kind])
        for name, cls in table.items():
            _print_entry(name, _says(cls))
        print()
    print(_HEADS['robot'])
    for name, arm in ARMS.items():
        _print_entry(name, _describes(arm))
    return 0


def _print_entry(name: str, text: str) -> None:
    """A name with its description: wrapped in a terminal, elsewhere in one line for grep."""
    line = f'{name:<{_NAME_WIDTH}}{text}'
    if sys.stdout.isatty():
        width = shutil.get_terminal_size().columns
        line = textwrap.fill(line, max(width, _NARROWEST), subsequent_indent=' ' * _NAME_WIDTH)
    print(line)


def _says(cls: type) -> str:
    """The first paragraph of a class's documentation, on one line."""
    return ' '.join((inspect.getdoc(cls) or '').partition('\n\n')[0].split())


def _describes(arm: 'Arm') -> str:
    """An arm in a few words."""
    moved = ''
    if arm.base_offset or arm.tool_offset:
        moved = f', base {arm.base_offset:g} m higher, tool of {arm.tool_offset:g} m'
    return f'{len(arm.start)} joints, task {arm.task}{moved}'
