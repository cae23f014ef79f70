"""Runs a subcommand and turns its result into an exit status."""

import os
import sys
from itertools import pairwise
from typing import TextIO

from redres_ros.cli import (
    batch,
    bench,
    check,
    compare,
    dampings,
    demo,
    laws,
    record,
    reproduce,
    simulate,
    teleop,
    view,
    watch,
)
from redres_ros.cli.parser import Parser, Version
from redres_ros.errors import RedresError, quoted

_GROUPS = (
    demo,
    simulate,
    compare,
    batch,
    dampings,
    reproduce,
    laws,
    view,
    watch,
    record,
    check,
    teleop,
    bench,
)  # in the order of `redres --help`

_PLUGIN = '--plugin'

_BEGINNING = """\
redres moves an arm that has more joints than its task needs. What to try first:
  redres demo       see an arm move: planner, controller and a simulated robot as ROS 2 nodes
  redres compare    see what the choice of a law changes, in plots and a table; without ROS
  redres simulate   every tick of a motion as numbers; without ROS
  redres laws       what there is to choose from: laws, preferences, tasks, limits, arms
  redres --help     all commands; redres COMMAND --help: their options
"""


def run_command(arguments: list[str] | None) -> int:
    """The exit status of a subcommand; every error has become one line."""
    given = sys.argv[1:] if arguments is None else arguments
    # Pictures go to files. A window system that the user named for other programs may not be here.
    os.environ.pop('MPLBACKEND', None)
    command = ' '.join(['redres', *given[:1]])
    if sys.stdout is None:  # there is nowhere to print
        _complain(f'{command}: standard output is closed; expected an open one, as /dev/null')
        return 1
    try:
        try:
            return _run(given)
        finally:
            sys.stdout.flush()
    except BrokenPipeError:  # who read our output, as in `redres laws | head`, has gone
        _let_go_of(sys.stdout)
        return 1
    except (RedresError, OSError, ImportError, MemoryError) as error:
        _complain(f'{command}: {_line(error)}')
        return 1


def _run(given: list[str]) -> int:
    if not given:
        sys.stderr.write(_BEGINNING)
        return 2
    _load_plugins(given)
    options, others = make_parser().parse_known_args(given)
    if others:
        program = f'redres {options.command}'
        Parser(prog=program).error(f'unknown: {" ".join(" ".join(others).split())}')
    status: int = options.run(options)
    return status


def _load_plugins(words: list[str]) -> None:
    """Load the files of --plugin, so that the parser knows their gains."""
    words = [part for word in words for part in _parts(word)]
    paths = [path for word, path in pairwise(words) if word == _PLUGIN]
    if paths:
        from redres_ros.files.plugins import load_plugins

        load_plugins(paths)


def _parts(word: str) -> list[str]:
    """A word, or both of --plugin=FILE."""
    if word.startswith(f'{_PLUGIN}='):
        return word.split('=', 1)
    return [word]


def _line(error: BaseException) -> str:
    """An error in one line, with a remedy where there is one."""
    if isinstance(error, ModuleNotFoundError):
        if (error.name or '').startswith('redres_ros'):
            raise error
        from redres_ros.files.remedy import not_installed

        return not_installed(error.name or '')
    if isinstance(error, OSError) and error.strerror:
        place = f': {error.filename}' if error.filename else ''
        return f'{error.strerror}{place}'
    if isinstance(error, MemoryError):
        return f'out of memory {quoted(error)}'
    return ' '.join(str(error).split())


def _complain(line: str) -> None:
    try:
        if sys.stdout is not None:
            sys.stdout.flush()
    except OSError:
        _let_go_of(sys.stdout)
    if sys.stderr is None:  # as it is when the process was started without one
        return
    try:
        print(line, file=sys.stderr, flush=True)
    except OSError:
        _let_go_of(sys.stderr)


def _let_go_of(stream: TextIO) -> None:
    """Discard unwritten output; without this Python would try once more."""
    nowhere = os.open(os.devnull, os.O_WRONLY)
    os.dup2(nowhere, stream.fileno())


def make_parser() -> Parser:
    """The parser of `redres` with all its subcommands."""
    description = 'Redundancy resolution for arms behind a position interface.'
    parser = Parser(prog='redres', description=description)
    parser.add_argument('--version', action=Version, help='print the version, and end')
    commands = parser.add_subparsers(
        dest='command', required=True, metavar='COMMAND', title='commands'
    )
    commands.type = str  # the words after a command are not its business, not even an empty one
    for group in _GROUPS:
        group.add(commands)
    for subparser in commands.choices.values():
        subparser.add_argument(
            _PLUGIN,
            action='append',
            metavar='FILE.py',
            help='a file with laws, preferences, tasks or limits of your own; it is executed',
        )
    return parser
