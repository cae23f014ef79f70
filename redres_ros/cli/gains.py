"""Gains as options: every parameter that the tables of building blocks declare."""

import argparse
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any

from redres_ros.cli.parser import NONE, OptionError

_SHARED = ('damping', 'scale')  # they have options of their own


@dataclass(frozen=True)
class Gain:
    """A parameter of a law, preference, task or limit, as an option.

    Args:
        kind: Of its owner: 'law', 'preference', 'task' or 'limit'.
        owner: The name in its table.
        name: The field's name.
        key: The option's name, which is that of the ROS parameter too.
        default: The field's default, whose type is that of the option.
        description: The field's own, with its unit.
    """

    kind: str
    owner: str
    name: str
    key: str
    default: Any
    description: str

    @property
    def metavar(self) -> str:
        """The placeholder of a value in the help."""
        return 'X,Y,Z' if isinstance(self.default, tuple) else 'X'

    @property
    def help(self) -> str:
        """The description with the default, as argparse takes it."""
        shown = str(self.default) or NONE
        if isinstance(self.default, tuple):
            shown = ','.join(f'{member:g}' for member in self.default) or NONE
        elif isinstance(self.default, float):
            shown = f'{self.default:g}'
        return f'{self.description}; default: {shown}'.replace('%', '%%')

    def read(self, text: str) -> Any:
        """A value from its text. Raises argparse's own error."""
        kind = type(self.default)
        try:
            if kind is tuple and text == NONE:
                return ()
            if kind is tuple:
                return tuple(float(member) for member in text.split(','))
            if kind is bool:
                return {'true': True, 'false': False}[text]
            return kind(text)
        except (ValueError, KeyError):
            expected = {tuple: 'numbers, as 1,2,3', bool: 'true or false', int: 'a whole number'}
            raise argparse.ArgumentTypeError(
                f'got {text!r}; expected {expected.get(kind, "a number")}'
            ) from None


def gains_in(tables: Mapping[str, Mapping[str, type]]) -> Iterator[Gain]:
    """Every gain that is declared in the tables, in their order."""
    from redres_ros.parameter import gain_key, parameters

    for kind, table in tables.items():
        for owner, cls in table.items():
            for field, parameter in parameters(cls).items():
                if field.name not in _SHARED:
                    key = gain_key(owner, field.name)
                    yield Gain(kind, owner, field.name, key, field.default, parameter.description)


def find_tables(*, limits: bool) -> dict[str, Mapping[str, type]]:
    """The tables of laws, preferences, tasks and limits, by kind.

    Args:
        limits: With the limits, which take a second more to load, and once, a minute to compile.
    """
    if limits:
        from redres_ros.kernels.ahead import compile_ahead

        compile_ahead()  # laws would load formulas one after the other
    from redres_ros.laws import LAWS
    from redres_ros.preferences import PREFERENCES
    from redres_ros.tasks import TASKS

    tables: dict[str, Mapping[str, type]] = {'law': LAWS, 'preference': PREFERENCES, 'task': TASKS}
    if limits:
        from redres_ros.limits import LIMITS

        tables['limit'] = LIMITS
    return tables


def given_gains(options: argparse.Namespace) -> dict[Gain, Any]:
    """All gains that the command line gives."""
    values = {gain: getattr(options, gain.key) for gain in options.gains}
    return {gain: value for gain, value in values.items() if value is not None}


def check_gains(options: argparse.Namespace, in_use: set[tuple[str, str]]) -> None:
    """Refuse a gain whose owner is not in use: it would have no effect.

    Args:
        options: With the gains.
        in_use: Kind and name of all that is.

    Raises:
        OptionError: There is such a gain.
    """
    for gain in given_gains(options):
        if (gain.kind, gain.owner) not in in_use:
            used = ', '.join(sorted(' '.join(each) for each in in_use))
            raise OptionError(f'--{gain.key} acts on the {gain.kind} {gain.owner}; in use: {used}')
