"""The executables. Each loads its node in here: help needs no ROS, and Ctrl-C ends it quietly."""

import ast
import sys
from collections.abc import Iterator
from functools import partial
from importlib import import_module
from itertools import pairwise, takewhile
from pathlib import Path
from typing import Any

from redres_ros.errors import RedresError, UnknownNameError, reason_of
from redres_ros.files.installed import installed
from redres_ros.files.remedy import not_installed

_ROS = '--ros-args'
_LAWS = Path(__file__).parents[1] / 'laws' / '__init__.py'
_OPTIONS = {'composed': ('--no-sim',)}  # of an executable, before those of ROS
_REMEDY = f'parameters go as {_ROS} -p NAME:=VALUE, see --help'


def run_node(name: str, arguments: list[str] | None = None) -> int:
    """Run a node until it ends.

    Args:
        name: Name of its module.
        arguments: What follows the name of the executable; None: those of this process.

    Returns:
        The exit status: 0, 1 after an error, 2 for a wrong command line, or 130 after Ctrl-C before
        the node began.
    """
    arguments = sys.argv[1:] if arguments is None else arguments
    try:
        if {'-h', '--help'} & set(arguments):
            print(_help(name), flush=True)
            return 0
        for word in takewhile(lambda word: word != _ROS, arguments):
            if word not in _OPTIONS.get(name, ()):
                print(f'redres_{name}: got {word!r}; {_REMEDY}', file=sys.stderr)
                return 2
        _check_law(arguments)
        status: int = import_module(f'redres_ros.nodes.{name}').main()
        return status
    except KeyboardInterrupt:
        return 130
    except BrokenPipeError:  # who read our help, as `| head` does, has gone
        return 1
    except ModuleNotFoundError as error:
        print(f'redres_{name}: {not_installed(error.name or "")}', file=sys.stderr)
        return 1
    except (OSError, ImportError, RedresError) as error:
        print(f'redres_{name}: {reason_of(error)}', file=sys.stderr)
        return 1


# The executables redres_composed and so on, and those that `ros2 run redres_ros` starts.
composed = partial(run_node, 'composed')
controller = partial(run_node, 'controller')
planner = partial(run_node, 'planner')
sim = partial(run_node, 'sim')


def _check_law(arguments: list[str]) -> None:
    """Refuse a mistyped law before formulas are compiled. With plugins, the node itself decides."""
    given = [word.partition(':=')[::2] for word in arguments]
    for option, file in pairwise(arguments):
        if option == '--params-file':
            given += _parameters_in(Path(file))
    if any(name == 'plugins' for name, _ in given):
        return
    for name, law in given:
        if name == 'law' and law:
            check_law(str(law))


def check_law(name: str) -> None:
    """Refuse a name that is no law's, and that no plugin adds. Raises UnknownNameError.

    The names come from the source of their table: loading it would compile the formulas, which
    takes a quarter of a minute the first time.
    """
    own = _law_names()
    if name not in own:
        known = [*own, *installed('laws')]
        if name not in known:
            raise UnknownNameError('law', name, known)


def _law_names() -> list[str]:
    """The names in the table LAWS."""
    tree = ast.parse(_LAWS.read_text(encoding='utf-8'))
    [table] = [node.value for node in tree.body if isinstance(node, ast.AnnAssign)]
    keywords = table.keywords if isinstance(table, ast.Call) else []
    return [keyword.arg for keyword in keywords if keyword.arg]


def _parameters_in(file: Path) -> Iterator[tuple[str, Any]]:
    """Names and values that a file of parameters has for the controller. Raises FileError."""
    from redres_ros.files.yaml import read_yaml

    sections = read_yaml(file)
    for key, section in sections.items() if isinstance(sections, dict) else ():
        if str(key).endswith(('/**', 'controller')) and isinstance(section, dict):
            values = section.get('ros__parameters')
            yield from values.items() if isinstance(values, dict) else ()


def _help(name: str) -> str:
    """The help text of an executable, from its module's docstring without loading it."""
    from redres_ros.files.share import share_path

    source = Path(__file__).with_name(f'{name}.py').read_text(encoding='utf-8')
    called = ' '.join([f'redres_{name}', *(f'[{option}]' for option in _OPTIONS.get(name, ()))])
    return f"""\
usage: {called} [{_ROS} [-p NAME:=VALUE ...] [--params-file FILE.yaml] [-r __ns:=/NAME]]

{ast.get_docstring(ast.parse(source))}

The common parameters, with defaults and units: {share_path('config/redres.yaml')}
What is allowed for one of a running node: ros2 param describe /{name} PARAMETER"""
