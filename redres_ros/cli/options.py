"""Options that several subcommands share; task.py and controller.py use them."""

import argparse
import re
from collections.abc import Sequence
from functools import partial
from itertools import chain
from pathlib import Path
from typing import Any

from redres_ros.cli.parser import NONE, Parser, option
from redres_ros.errors import quoted

DEMO_LIMITS = 'position,velocity,acceleration'
GAINS_HELP = '--help-gains'

DURATIONS = (0.0, 1e6, 's')  # of a run
_NAMES = r'[A-Za-z_]\w*(/[A-Za-z_]\w*)*'  # with / between them
_LONGEST_NAME = 120  # characters; DDS takes 247 for a namespace and a topic in it


def add_motion(parser: Parser, *, several_laws: str = '', limits: str = NONE) -> None:
    """Arm, task, law and limits: the options of every motion.

    Args:
        parser: Parser of the subcommand.
        several_laws: The laws that are compared unless others are named; empty: there is one law.
        limits: Those that are in force unless others are named.
    """
    arm = parser.add_argument_group('arm and task')
    points = "the points to pass; default: rectangle, or with --robot that robot's own"
    option(arm, '--task', 'NAME|FILE.yaml', points)
    add_robot(arm)
    law = parser.add_argument_group('law')
    if several_laws:
        each = 'names from `redres laws`, each with its own damping if wanted, '
        add_laws(law, several_laws, f'{each}such as minimum_acceleration@5')
    else:
        option(law, '--law', 'NAME', 'a name from `redres laws`', 'minimum_acceleration')
    damping = 'null-space damping k_d [1/s], 0 to 1/T; default: 10'
    option(law, '--damping', 'K_D', damping, type=float)
    _add_lists(law)
    _add_limits(parser.add_argument_group('limits'), limits)
    parser.declare_later(_add_gains)


def add_robot(group: Any, default: str | None = None) -> None:
    """The arm, and its tip and elbow links.

    Args:
        group: Group of the subcommand's options.
        default: The robot; None: that of the task.
    """
    tip = "link that carries out the task; default: the robot's own, of a file the last link"
    elbow = "link of the elbow; default: the robot's own, of a file that of the middle joint"
    dynamics = "inertias: identified, or cylinders (the paper's Section 5.2)"
    option(
        group, '--robot', 'NAME|FILE.urdf', 'a name from `redres laws`, or any serial arm', default
    )
    option(group, '--tip', 'FRAME', tip)
    option(group, '--elbow', 'FRAME', elbow)
    option(group, '--dynamics', 'NAME', dynamics, 'identified')


def add_laws(group: Any, default: str, says: str) -> None:
    """--law of commands that take several laws.

    Args:
        group: Group of the subcommand's options.
        default: The laws, unless others are named.
        says: What can be named.
    """
    option(group, '--law', 'A,B,...', says, default, dest='laws')


def _add_lists(group: Any) -> None:
    prefer = 'preferences in the null space, such as joint_centering=4'
    secondary = 'secondary tasks, in order of priority; orientation: keep the initial orientation'
    option(group, '--prefer', 'NAME[=GAIN]', prefer, nargs='+', action='extend')
    option(group, '--secondary', 'NAME', secondary, nargs='+', action='extend')


def _add_limits(group: Any, default: str) -> None:
    limits = f'limits to keep, such as position,velocity,acceleration; {NONE}: the law alone'
    scale = 'fraction of the velocity and acceleration limits to use'
    scaling = (
        'what limits scale: the task velocity as a whole, or translation and rotation separately, '
        'as an operator prefers'
    )
    option(group, '--limits', 'A,B,...', limits, default)
    option(group, '--limit-scale', 'X', scale, 1.0)
    option(group, '--torque-scale', 'X', 'fraction of the torque limits to use', 1.0)
    option(group, '--scaling', None, scaling, choices=('task', 'components'))


def _add_gains(parser: Parser, words: Sequence[str]) -> None:
    """An option for every gain that is declared with `param` in the tables."""
    from redres_ros.cli.gains import find_tables, help_text, metavar, read_value

    group = parser.add_argument_group('gains of laws, preferences, tasks and limits')
    group.add_argument(GAINS_HELP, action='help', help='print this help with all gains, and exit')
    if {'-h', '--help'} & set(words) and GAINS_HELP not in words:
        return  # the first time, loading the tables compiles the formulas
    wanted = parser.get_default('limits') != NONE or any(map(_concerns_limits, words))
    declared = chain.from_iterable(table.gains() for table in find_tables(limits=wanted))
    gains = tuple(gain for gain in declared if gain.name != 'damping')
    parser.set_defaults(gains=gains)
    for gain in {gain.key: gain for gain in gains}.values():
        shown = help_text(gain) if GAINS_HELP in words else argparse.SUPPRESS
        read = partial(read_value, gain)
        group.add_argument(f'--{gain.key}', type=read, metavar=metavar(gain), help=shown)


def _concerns_limits(word: str) -> bool:
    """Whether a word of the command line may have to do with limits or their gains."""
    option = word.partition('=')[0]
    return option in (GAINS_HELP, '--limits') or (option.startswith('--') and '.' in option)


def add_loop(parser: Parser) -> Any:
    """The group of options of the ideal loop, which has --period."""
    loop = parser.add_argument_group('loop')
    option(loop, '--period', 'S', 'sampling time T [s]', 0.001)
    loop.add_argument(
        '--greedy',
        action='store_true',
        help='ask for the full speed of the path in every tick, also after limits have slowed it',
    )
    return loop


def add_out(group: Any, default: str, says: str, *, plots: bool = False) -> None:
    """--out of commands that write several files.

    Args:
        group: Group of the subcommand's options.
        default: The directory, unless another is named.
        says: What is written there.
        plots: Whether a file for a publication may be named instead, for the plots alone.
    """
    metavar = 'DIR'
    meaning = f'directory for {says}'
    if plots:
        metavar += '|FILE.pdf|FILE.svg'
        meaning += '; or only the plots, at the width of a column (3.5 in)'
    option(group, '--out', metavar, meaning, Path(default))


def add_domain(parser: argparse.ArgumentParser) -> None:
    """--domain of nodes that are running already."""
    says = 'ROS domain of a running `redres demo`; default: ROS_DOMAIN_ID'
    option(parser, '--domain', 'ID', says, type=int)


def add_watching_time(parser: argparse.ArgumentParser) -> None:
    """--duration of commands that observe nodes."""
    says = 'end after this time [s]; default: run until Ctrl-C'
    option(parser, '--duration', 'S', says, type=float, within=DURATIONS)


def add_namespace(parser: argparse.ArgumentParser) -> None:
    """--namespace of nodes that are running already."""
    says = 'namespace of the arm, if there are several; default: none'
    option(parser, '--namespace', 'NAME', says, '', type=_namespace)


def topic_name(text: str) -> str:
    """A topic's name as it is. Raises argparse's own error."""
    return _checked_name(text, f'/?{_NAMES}', 'a topic, such as joint_states')


def _namespace(text: str) -> str:
    return _checked_name(text, f'/?({_NAMES})?', 'names with / between them, such as left')


def _checked_name(text: str, pattern: str, expected: str) -> str:
    """A name of the graph as it is; it must match a pattern. Raises argparse's own error."""
    if not re.fullmatch(pattern, text, re.ASCII):
        raise argparse.ArgumentTypeError(f'got {quoted(text)}; expected {expected}')
    if len(text) > _LONGEST_NAME:
        raise argparse.ArgumentTypeError(
            f'got {len(text)} characters; expected at most {_LONGEST_NAME}'
        )
    return text
