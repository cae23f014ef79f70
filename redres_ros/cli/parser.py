"""The parser of the command line, with errors in one line."""

import argparse
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any, NoReturn

from redres_ros.errors import RangeError, RedresError, quoted

NONE = 'none'  # the word for no limits at all

_EXAMPLES = 'examples:\n'
_WIDTH = 54  # columns that the text of an option has in a terminal of 80


class OptionError(RedresError):
    """An option that cannot be parsed, or conflicts with others."""


class _Help(argparse.ArgumentDefaultsHelpFormatter):
    """Shows the defaults that say something."""

    def _get_help_string(self, action: argparse.Action) -> str | None:
        said = action.help or ''
        if action.default in (None, False, '', (), argparse.SUPPRESS):
            return said
        return f'{said}; default: {_shown(action.default)}'

    def _fill_text(self, text: str, width: int, indent: str) -> str:
        """As the base class, but with one example a line."""
        if text.startswith(_EXAMPLES):
            return text
        return super()._fill_text(text, width, indent)


def _shown(default: Any) -> str:
    """A default as one would write it; a list of names so that a narrow terminal can break it."""
    if isinstance(default, float):
        return f'{default:g}'
    text = str(default)
    return text if len(text) < _WIDTH else text.replace(',', ', ')


class Parser(argparse.ArgumentParser):
    """A parser without abbreviations, and with errors in one line."""

    def __init__(self, **kwargs: Any) -> None:
        super().__init__(**{'formatter_class': _Help, 'allow_abbrev': False, **kwargs})
        for kind, reading in _READINGS.items():
            self.register('type', kind, reading)

    def error(self, message: str) -> NoReturn:
        """Refuse the command line in one line; the base class prints twenty."""
        self.exit(2, f'{self.prog}: {message}; see {self.prog} --help\n')

    def _print_message(self, message: str, file: Any = None) -> None:
        """As of the base class, which passes over output that cannot be written."""
        if message and file is not None:
            file.write(message)


def add_command(commands: Any, name: str, says: str, *examples: str) -> Parser:
    """Declare a subcommand, whose help begins with what it does and ends with examples.

    Args:
        commands: What argparse's add_subparsers gave.
        name: Name of the subcommand.
        says: What it does, as the list of all commands says it.
        examples: Command lines without `redres NAME`; after # a remark, if one is needed.
    """
    lines = [example.partition('#') for example in examples]
    width = max(len(words.strip()) for words, *_ in lines)
    shown = [f'  redres {name} {words.strip():<{width}}  {"".join(why)}' for words, *why in lines]
    command: Parser = commands.add_parser(
        name,
        help=says,
        description=f'{says[0].upper()}{says[1:]}.',
        epilog=_EXAMPLES + '\n'.join(map(str.rstrip, shown)),
    )
    return command


def option(
    group: Any,
    name: str,
    metavar: str | None,
    says: str,
    default: Any = None,
    *,
    within: tuple[float, float, str] | None = None,
    **others: Any,
) -> None:
    """Declare an option with a value, of the type of its default.

    Args:
        group: A parser, or a group of its options.
        name: Such as '--period'.
        metavar: Stands for the value in the help; None for the name's, or for choices.
        says: What it means.
        default: Its value when it is not given.
        within: The least and the largest number that are allowed, and their unit; None: any.
        **others: As add_argument takes them, such as the type if there is no default.
    """
    kind: type | None = type(default) if isinstance(default, (int, float)) else None
    if isinstance(default, Path):
        kind = Path
    declared = {'type': kind, 'metavar': metavar, 'default': default, 'help': says, **others}
    if within:
        declared['type'] = partial(
            _read_within, name.lstrip('-'), within, _READINGS[declared['type']]
        )
    group.add_argument(name, **declared)


def _read_text(text: str) -> str:
    if not text:
        raise argparse.ArgumentTypeError('got nothing; expected a name')
    return text


def _read_path(text: str) -> Path:
    if not text:
        raise argparse.ArgumentTypeError('got nothing; expected a path')
    return Path(text)


def _read_number(text: str, kind: type = float, expected: str = 'a number') -> Any:
    try:
        return kind(text)
    except ValueError:
        raise argparse.ArgumentTypeError(f'got {quoted(text)}; expected {expected}') from None


def _read_within(
    name: str, within: tuple[float, float, str], read: Callable[[str], Any], text: str
) -> Any:
    """A number in its range. Raises RangeError."""
    lower, upper, unit = within
    value = read(text)
    if not lower <= value <= upper:
        raise RangeError(name, value, lower, upper, unit)
    return value


# What reads an option's text, by the type that it is declared with; None for plain text.
_READINGS: dict[type | None, Callable[[str], Any]] = {
    None: _read_text,
    Path: _read_path,
    float: _read_number,
    int: partial(_read_number, kind=int, expected='a whole number'),
}
