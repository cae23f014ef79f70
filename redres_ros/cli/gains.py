"""Gains as options: every parameter that the tables of building blocks declare."""

import argparse
from typing import TYPE_CHECKING, Any

from redres_ros.cli.parser import NONE, OptionError

if TYPE_CHECKING:
    from redres_ros.parameter import Gain, Table


def metavar(gain: 'Gain') -> str:
    """The placeholder of a gain's value in the help."""
    return 'X,Y,Z' if isinstance(gain.default, tuple) else 'X'


def help_text(gain: 'Gain') -> str:
    """The description of a gain with its default, as argparse takes it."""
    shown = str(gain.default) or NONE
    if isinstance(gain.default, tuple):
        shown = ','.join(f'{member:g}' for member in gain.default) or NONE
    elif isinstance(gain.default, float):
        shown = f'{gain.default:g}'
    return f'{gain.parameter.description}; default: {shown}'.replace('%', '%%')


def read_value(gain: 'Gain', text: str) -> Any:
    """A value of a gain from its text. Raises argparse's own error.

    Args:
        gain: The gain, whose default has the type of the value.
        text: Text from the command line.
    """
    kind = type(gain.default)
    try:
        if kind is tuple and text == NONE:
            return ()
        if kind is tuple:
            return tuple(float(member) for member in text.split(','))
        if kind is bool:
            return {'true': True, 'false': False}[text]
        return kind(text)
    except (ValueError, KeyError):
        expected = {tuple: 'numbers, such as 1,2,3', bool: 'true or false', int: 'a whole number'}
        raise argparse.ArgumentTypeError(
            f'got {text!r}; expected {expected.get(kind, "a number")}'
        ) from None


def find_tables(*, limits: bool) -> 'list[Table[Any]]':
    """The tables of laws, preferences, tasks and limits.

    Args:
        limits: With the limits, which take longer to load, and are compiled the first time.
    """
    from redres_ros.laws import LAWS
    from redres_ros.preferences import PREFERENCES
    from redres_ros.tasks import TASKS

    tables: list[Table[Any]] = [LAWS, PREFERENCES, TASKS]
    if limits:
        from redres_ros.limits import LIMITS

        tables.append(LIMITS)
    return tables


def given_gains(options: argparse.Namespace) -> 'list[tuple[Gain, Any]]':
    """All gains that the command line gives, with their values."""
    values = [(gain, getattr(options, gain.key)) for gain in options.gains]
    return [(gain, value) for gain, value in values if value is not None]


def check_gains(options: argparse.Namespace, in_use: set[tuple[str, str]]) -> None:
    """Refuse a gain whose owner is not in use: it would have no effect.

    Args:
        options: Command line with the gains.
        in_use: Kind and name of all that is.

    Raises:
        OptionError: There is such a gain.
    """
    used_keys = {gain.key for gain in options.gains if (gain.kind, gain.owner) in in_use}
    for gain, _ in given_gains(options):
        if gain.key not in used_keys:
            used = ', '.join(sorted(' '.join(each) for each in in_use))
            raise OptionError(f'--{gain.key} acts on the {gain.kind} {gain.owner}; in use: {used}')
