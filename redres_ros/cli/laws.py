"""`redres laws`: lists laws, preferences, tasks and limits with their gains, and arms."""

import argparse
import inspect
import shutil
import sys
import textwrap
from typing import TYPE_CHECKING, Any

from redres_ros.cli.parser import add_command

if TYPE_CHECKING:
    from redres_ros.parameter import Gain
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
        'laws, preferences, tasks and limits with their gains, and arms, by name',
        '# all of them',
        '--plugin my_laws.py  # and those in this file',
    )
    laws.set_defaults(run=_list)


def _list(options: argparse.Namespace) -> int:
    from redres_ros.laws import LAWS
    from redres_ros.limits import LIMITS
    from redres_ros.preferences import PREFERENCES
    from redres_ros.robots import ARMS
    from redres_ros.tasks import TASKS

    gains: dict[str, Gain] = {}
    for table in (LAWS, PREFERENCES, TASKS, LIMITS):
        print(_HEADS[table.kind])
        for name, cls in table.items():
            _print_entry(name, _says(cls))
        print()
        gains |= {gain.key: gain for gain in table.gains()}
    print('gains, --set NAME=VALUE')
    for key, gain in gains.items():
        _print_entry(key, _describes_gain(gain))
    print()
    print(_HEADS['robot'])
    for name, arm in ARMS.items():
        _print_entry(name, _describes(arm))
    return 0


def _print_entry(name: str, text: str) -> None:
    """A name with its description: wrapped in a terminal, elsewhere in one line for grep."""
    line = f'{name:<{_NAME_WIDTH - 1}} {text}'
    if sys.stdout.isatty():
        width = shutil.get_terminal_size().columns
        line = textwrap.fill(line, max(width, _NARROWEST), subsequent_indent=' ' * _NAME_WIDTH)
    print(line)


def _says(cls: type) -> str:
    """The first paragraph of a class's documentation, on one line."""
    return ' '.join((inspect.getdoc(cls) or '').partition('\n\n')[0].split())


def _describes_gain(gain: 'Gain') -> str:
    default = f'{gain.default:g}' if isinstance(gain.default, float) else f'{gain.default}'
    if isinstance(gain.default, tuple):
        default = f'[{", ".join(map(str, gain.default))}]' if gain.default else 'the start'
    return f'{gain.parameter.description}; default: {default or "none"}'


def _describes(arm: 'Arm') -> str:
    """An arm in a few words."""
    moved = ''
    if arm.base_offset or arm.tool_offset:
        moved = f', base {arm.base_offset:g} m higher, tool of {arm.tool_offset:g} m'
    return f'{len(arm.start)} joints, task {arm.task}{moved}'
