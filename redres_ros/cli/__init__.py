"""The command `redres`: runs a subcommand and turns its result into an exit status.

What takes long to load is loaded within functions, so that Ctrl-C meanwhile ends quietly.
"""

import os
import sys
from typing import TYPE_CHECKING, TextIO

if TYPE_CHECKING:
    from redres_ros.cli.options import Parser

# Threads do not speed up matrices of seven joints, and a process that forks
# should have one thread only. Read when numpy is loaded.
os.environ.setdefault('OPENBLAS_NUM_THREADS', '1')


def main(arguments: list[str] | None = None) -> int:
    """Run one subcommand, by default that of this process; every error becomes one line.

    Returns 0 if it did as it was asked, 1 if not, 2 for a wrong command line, 130 after Ctrl-C.
    """
    try:
        from redres_ros.files.processes import open_error_output

        open_error_output()
        return _run(sys.argv[1:] if arguments is None else arguments)
    except KeyboardInterrupt:
        return 130


def _run(given: list[str]) -> int:
    from redres_ros.errors import RedresError

    # Pictures go to files. A window system that the user named for other programs may not be here.
    os.environ.pop('MPLBACKEND', None)
    command = ' '.join(['redres', *given[:1]])
    if sys.stdout is None:  # there is nowhere to print
        _complain(f'{command}: standard output is closed; expected an open one, such as /dev/null')
        return 1
    try:
        try:
            return _run_command(given)
        finally:
            sys.stdout.flush()
    except BrokenPipeError:  # who read our output, as in `redres laws | head`, has gone
        _let_go_of(sys.stdout)
        return 1
    except (RedresError, OSError, ImportError, MemoryError) as error:
        _complain(f'{command}: {_line(error)}')
        return 1


def _run_command(given: list[str]) -> int:
    if not given:
        make_parser().print_help(sys.stderr)
        return 2
    parser = make_parser()
    options, others = parser.parse_known_args(given)
    others += [word for word in given if not word or word.endswith('=')]
    if others:
        parser.prog = f'redres {options.command}'
        parser.error(_refusal(others, parser.prog))
    for plugin in options.plugin or ():
        from redres_ros.files.plugins import load_plugin

        load_plugin(plugin)
    status: int = options.run(options)
    return status


def _refusal(words: list[str], command: str) -> str:
    """Why words of a command line are refused."""
    from redres_ros.files.text import replacements

    gone = replacements(command, 'every command')
    gains = replacements('parameters')
    for word in words:
        name, equals, value = word.partition('=')
        if name.startswith('--') and '.' in name:
            gone[name] = gains.get(name[2:], f'--set {name[2:]}=VALUE')
        if name in gone:
            return f'{name} is gone; instead: {gone[name]}'
        if not name or (equals and not value):
            return f'got nothing for {name or "a value"}; expected a value'
    return f'unknown: {" ".join(" ".join(words).split())}'


def _line(error: BaseException) -> str:
    """An error in one line, with a remedy if there is one."""
    if isinstance(error, ModuleNotFoundError):
        if (error.name or '').startswith('redres_ros'):
            raise error
        from redres_ros.files.installation import not_installed

        return not_installed(error.name or '')
    if isinstance(error, OSError) and error.strerror:
        place = f': {error.filename}' if error.filename else ''
        return f'{error.strerror}{place}'
    from redres_ros.errors import quoted, reason_of

    if isinstance(error, MemoryError):
        return f'out of memory {quoted(error)}'
    return reason_of(error)


def _complain(line: str) -> None:
    try:
        if sys.stdout is not None:
            sys.stdout.flush()
    except OSError:
        _let_go_of(sys.stdout)
    try:
        print(line, file=sys.stderr, flush=True)
    except OSError:
        _let_go_of(sys.stderr)


def _let_go_of(stream: TextIO) -> None:
    """Discard unwritten output; without this Python would try once more."""
    nowhere = os.open(os.devnull, os.O_WRONLY)
    os.dup2(nowhere, stream.fileno())


def make_parser() -> 'Parser':
    """The parser of `redres` with all its subcommands."""
    from redres_ros.cli import commands, demo, simulate
    from redres_ros.cli.options import Parser
    from redres_ros.files.installation import share_path

    package = share_path('package.xml').read_text(encoding='utf-8')
    version = package.partition('<version>')[2].partition('<')[0]
    description = 'Redundancy resolution for arms behind a position interface.'
    parser = Parser(prog='redres', description=description)
    prints = 'print the version, and exit'
    parser.add_argument('--version', action='version', version=f'redres_ros {version}', help=prints)
    subparsers = parser.add_subparsers(
        dest='command', required=True, metavar='COMMAND', title='commands'
    )
    for module in (demo, simulate, commands):
        module.add(subparsers)
    plugin = 'a Python file with your own laws, preferences, tasks or limits; it is executed'
    for subparser in subparsers.choices.values():
        subparser.add_argument('--plugin', action='append', metavar='FILE.py', help=plugin)
    return parser
