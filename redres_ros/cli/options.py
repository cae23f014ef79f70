"""The parser, and the options that several subcommands share."""

import argparse
import re
from collections.abc import Callable, Iterable
from contextlib import suppress
from os.path import isdir
from pathlib import Path
from typing import Any, NoReturn

from redres_ros.errors import RedresError, UnknownNameError, quoted

NONE = 'none'  # the word for no limits at all
DEMO_LIMITS = 'position,velocity,acceleration'
DURATIONS = (0.0, 1e6)  # [s] of a run

_NAMES = r'(/?[A-Za-z_]\w*(/[A-Za-z_]\w*)*)?'  # with / between them
_LONGEST_NAME = 120  # characters; DDS takes 247 for a namespace and a topic in it


class OptionError(RedresError):
    """An option that cannot be parsed, or conflicts with others."""


class Parser(argparse.ArgumentParser):
    """A parser without abbreviations, and with errors in one line."""

    def __init__(self, **kwargs: Any) -> None:
        raw = argparse.RawDescriptionHelpFormatter  # one example a line
        super().__init__(**{'formatter_class': raw, 'allow_abbrev': False, **kwargs})

    def error(self, message: str) -> NoReturn:
        """Refuse the command line in one line; the base class prints twenty."""
        self.exit(2, f'{self.prog}: {message}; see {self.prog} --help\n')

    def _check_value(self, action: argparse.Action, value: Any) -> None:
        """Refuse what is none of the choices; of a command that is gone with its replacement."""
        if action.choices is not None and value not in action.choices:
            from redres_ros.files.text import replacements

            error = UnknownNameError('value', value, action.choices)
            gone = replacements(self.prog).get(value)
            if gone:
                self.error(f'{value} is gone; instead: {gone}')
            raise argparse.ArgumentError(action, str(error))


def add_command(
    commands: Any, run: Callable[[argparse.Namespace], int], says: str, *examples: str
) -> Parser:
    """Declare a subcommand by the function that runs it, which has its name.

    Examples are command lines without `redres NAME`; after # there may be a remark.
    """
    name = run.__name__.strip('_')
    lines = [example.partition('#') for example in examples]
    width = max(len(words.strip()) for words, *_ in lines)
    shown = [f'  redres {name} {words.strip():<{width}}  {"".join(why)}' for words, *why in lines]
    command: Parser = commands.add_parser(
        name,
        help=says,
        description=f'{says[0].upper()}{says[1:]}.',
        epilog='examples:\n' + '\n'.join(map(str.rstrip, shown)),
    )
    command.set_defaults(run=run)
    return command


def option(
    group: Any,
    name: str,
    metavar: str | None,
    says: str,
    default: Any = None,
    *,
    within: tuple[float, float] | None = None,
    **others: Any,
) -> None:
    """Declare an option of its default's type, `within` two values; others go to add_argument."""
    kind: Any = others.pop('type', str if default is None else type(default))

    def _read(text: str) -> Any:
        value = kind(text)
        if within:
            from redres_ros.parameter import Parameter, check_value

            check_value(name.lstrip('-'), value, Parameter('', *within))
        return value

    _read.__name__ = kind.__name__  # for argparse, which says: invalid int value
    if default not in (None, ''):
        says += f'; default: {default:g}' if isinstance(default, float) else f'; default: {default}'
    group.add_argument(name, type=_read, metavar=metavar, default=default, help=says, **others)


def add_out(group: Any, says: str, default: Path | None = None, file: str = '') -> None:
    """--out, a directory; of a command that writes one `file`, also that file itself."""
    ending = Path(file).suffix

    def _read(text: str) -> Path:
        given = Path(text)
        if file and (given.suffix == ending or text.startswith('/dev/')):
            return given
        if given.suffix[1:2].isalpha() and not (isdir(text) or text.endswith('/')):
            other = f', or a file that ends in {ending}' if file else ''
            expected = f'a directory, such as {given.with_suffix("")}{other}'
            raise argparse.ArgumentTypeError(f'got {quoted(text)}; expected {expected}')
        return given / file

    option(group, '--out', f'DIR|FILE{ending}' if file else 'DIR', says, default, type=_read)


def add_motion(parser: Parser, *, several_laws: str = '', limits: str = NONE) -> None:
    """The options of every motion: `limits` in force by default, `several_laws` to compare."""
    arm = parser.add_argument_group('arm and task')
    points = "the points to pass; default: rectangle, or with --robot that robot's own"
    tip = "link that carries out the task; default: the robot's own, of a file the last link"
    elbow = "link of the elbow; default: the robot's own, of a file that of the middle joint"
    dynamics = "inertias: identified, or cylinders (the paper's Section 5.2)"
    option(arm, '--task', 'NAME|FILE.yaml|FILE.csv', points)
    option(arm, '--robot', 'NAME|FILE.urdf', 'a name from `redres laws`, or any serial arm')
    option(arm, '--tip', 'FRAME', tip, '')
    option(arm, '--elbow', 'FRAME', elbow, '')
    option(arm, '--dynamics', 'NAME', dynamics, 'identified')

    law = parser.add_argument_group('law')
    name = 'from `redres laws`; with its own damping or gain: minimum_acceleration@5, @horizon=2'
    damping = 'null-space damping k_d [1/s], 0 to 1/T; default: 10'
    prefer = 'preferences in the null space, such as joint_centering=4'
    secondary = 'secondary tasks, in order of priority; orientation: keep the initial orientation'
    gains = 'gains as in a parameter file, such as posture.gain=4; `redres laws` lists them; '
    gains += "or acceleration_limit='[10, 10, ...]', of each joint [rad/s^2], or MoveIt's file"
    if several_laws:
        option(law, '--law', 'A,B,...', f'names {name}', several_laws, dest='laws')
    else:
        option(law, '--law', 'NAME', f'a name {name}', 'minimum_acceleration')
    option(law, '--damping', 'K_D', damping, type=float)
    several: dict[str, Any] = {'nargs': '+', 'action': 'extend'}
    option(law, '--prefer', 'NAME[=GAIN]', prefer, **several)
    option(law, '--secondary', 'NAME', secondary, **several)
    option(law, '--set', 'NAME=VALUE', gains, **several)

    kept = parser.add_argument_group('limits')
    keep = f'limits to keep, such as {DEMO_LIMITS}; {NONE}: the law alone'
    scale = 'fraction of the velocity and acceleration limits to use'
    scaling = 'what limits scale: the task velocity as a whole, or translation and rotation each'
    option(kept, '--limits', 'A,B,...', keep, limits)
    option(kept, '--limit-scale', 'X', scale, 1.0)
    option(kept, '--torque-scale', 'X', 'fraction of the torque limits to use', 1.0)
    option(kept, '--scaling', None, scaling, 'task', choices=('task', 'components'))


def add_loop(parser: Parser) -> Any:
    """The group of options of the ideal loop, which has --period."""
    loop = parser.add_argument_group('loop')
    greedy = 'ask for the full speed of the path in every tick, also after limits have slowed it'
    option(loop, '--period', 'S', 'sampling time T [s]', 0.001)
    loop.add_argument('--greedy', action='store_true', help=greedy)
    return loop


def add_graph(parser: argparse.ArgumentParser) -> None:
    """--domain and --namespace of nodes that are running already."""
    domain = 'ROS domain of a running `redres demo`; default: ROS_DOMAIN_ID'
    namespace = 'namespace of the arm, if there are several; default: none'
    option(parser, '--domain', 'ID', domain, type=int)
    option(parser, '--namespace', 'NAME', namespace, '', type=graph_name)


def graph_name(text: str) -> str:
    """The name of a topic or a namespace as it is. Raises argparse's own error."""
    if len(text) > _LONGEST_NAME or not re.fullmatch(_NAMES, text, re.ASCII):
        raise argparse.ArgumentTypeError(
            f'got {quoted(text)}; expected names with / between them, such as left/joint_states, '
            f'of at most {_LONGEST_NAME} characters'
        )
    return text


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


def check_writable(*paths: Path) -> None:
    """Raise FileError for a file that cannot be written, before a long computation begins."""
    from redres_ros.files.text import writing

    for path in paths:
        with writing(path):
            is_new = not path.exists()
            path.open('a').close()
            if is_new:
                path.unlink()
