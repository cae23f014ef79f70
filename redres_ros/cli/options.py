"""Options that several subcommands share; motion.py uses most of them."""

import argparse
import re
from collections.abc import Iterable
from contextlib import suppress
from pathlib import Path
from typing import Any

from redres_ros.cli.parser import NONE, OptionError, Parser, option
from redres_ros.errors import quoted

DEMO_LIMITS = 'position,velocity,acceleration'

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
    tip = "link that carries out the task; default: the robot's own, of a file the last link"
    elbow = "link of the elbow; default: the robot's own, of a file that of the middle joint"
    dynamics = "inertias: identified, or cylinders (the paper's Section 5.2)"
    option(arm, '--task', 'NAME|FILE.yaml', points)
    option(arm, '--robot', 'NAME|FILE.urdf', 'a name from `redres laws`, or any serial arm')
    option(arm, '--tip', 'FRAME', tip)
    option(arm, '--elbow', 'FRAME', elbow)
    option(arm, '--dynamics', 'NAME', dynamics, 'identified')

    law = parser.add_argument_group('law')
    damping = 'null-space damping k_d [1/s], 0 to 1/T; default: 10'
    prefer = 'preferences in the null space, such as joint_centering=4'
    secondary = 'secondary tasks, in order of priority; orientation: keep the initial orientation'
    gains = (
        'gains of laws, preferences, tasks and limits, as in a parameter file, such as '
        'posture.gain=4; `redres laws` lists them'
    )
    if several_laws:
        each = 'each with its own damping if wanted, such as minimum_acceleration@5'
        says = f'names from `redres laws`, {each}'
        option(law, '--law', 'A,B,...', says, several_laws, dest='laws')
    else:
        option(law, '--law', 'NAME', 'a name from `redres laws`', 'minimum_acceleration')
    option(law, '--damping', 'K_D', damping, type=float)
    option(law, '--prefer', 'NAME[=GAIN]', prefer, nargs='+', action='extend')
    option(law, '--secondary', 'NAME', secondary, nargs='+', action='extend')
    option(law, '--set', 'NAME=VALUE', gains, nargs='+', action='extend')

    kept = parser.add_argument_group('limits')
    names = f'limits to keep, such as {DEMO_LIMITS}; {NONE}: the law alone'
    scale = 'fraction of the velocity and acceleration limits to use'
    scaling = (
        'what limits scale: the task velocity as a whole, or translation and rotation separately, '
        'as an operator prefers'
    )
    option(kept, '--limits', 'A,B,...', names, limits)
    option(kept, '--limit-scale', 'X', scale, 1.0)
    option(kept, '--torque-scale', 'X', 'fraction of the torque limits to use', 1.0)
    option(kept, '--scaling', None, scaling, 'task', choices=('task', 'components'))


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


def add_graph(parser: argparse.ArgumentParser) -> None:
    """--domain and --namespace of nodes that are running already."""
    domain = 'ROS domain of a running `redres demo`; default: ROS_DOMAIN_ID'
    namespace = 'namespace of the arm, if there are several; default: none'
    option(parser, '--domain', 'ID', domain, type=int)
    option(parser, '--namespace', 'NAME', namespace, '', type=_namespace)


def read_settings(texts: Iterable[str]) -> dict[str, Any]:
    """The values of --set by name, read as in a parameter file. Raises OptionError."""
    import yaml

    values = {}
    for setting in texts:
        name, _, text = setting.partition('=')
        if not (name and text):
            raise OptionError(f'--set {setting}; expected NAME=VALUE, such as posture.gain=4')
        try:
            value = yaml.safe_load(text)
        except (yaml.YAMLError, ValueError):
            value = None
        if isinstance(value, str):
            with suppress(ValueError):
                value = float(value)  # YAML 1.1 takes 1e-3, which has no dot, for a text
        if not isinstance(value, (bool, int, float, str, list)):
            raise OptionError(f'--set {setting}; expected a value, such as 0.5 or [1.0, 0.0, 0.0]')
        values[name] = value
    return values


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
