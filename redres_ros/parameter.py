"""Parameters as dataclass fields: default, meaning with unit, and range, declared once for ROS, CLI
and docs.
"""

import math
from collections.abc import Collection, Iterable, Iterator, Mapping
from dataclasses import Field, dataclass, field, fields
from functools import cache
from numbers import Real
from typing import Any, TypeVar

from redres_ros.errors import RangeError, RepeatedNameError, UnknownNameError

SHARED_GAINS = ('damping',)  # all laws have them

_KEY = 'parameter'

T = TypeVar('T')


class Names(Collection[str]):
    """The names in a table at the time of the call, and further words.

    Args:
        table: Name to anything.
        words: What else is allowed.
    """

    def __init__(self, table: Mapping[str, Any], *words: str) -> None:
        self._table = table
        self._words = words

    def __iter__(self) -> Iterator[str]:
        yield from self._table
        yield from self._words

    def __len__(self) -> int:
        return len(self._table) + len(self._words)

    def __contains__(self, name: object) -> bool:
        return name in self._table or name in self._words


@dataclass(frozen=True)
class Parameter:
    """The declaration of a field beside its type and default."""

    description: str
    lower: float | None = None
    upper: float | None = None
    choices: Collection[str] = ()
    live: bool = False  # can be set while the node runs


def param(
    default: Any,
    description: str,
    lower: float | None = None,
    upper: float | None = None,
    *,
    choices: Collection[str] = (),
    live: bool = False,
) -> Any:
    """A dataclass field that is a parameter: of Python, of a node, and of the command line.

    Args:
        default: Its value unless another is given.
        description: What it is, with its unit in brackets.
        lower: Least number that is allowed.
        upper: Largest number that is allowed.
        choices: The words that are allowed.
        live: Whether a running node takes another value.
    """
    return field(
        default=default, metadata={_KEY: Parameter(description, lower, upper, choices, live)}
    )


def parameters(of: Any) -> dict[Field[Any], Parameter]:
    """The fields of a dataclass, or of an instance, that were declared with `param`."""
    return _declared(of if isinstance(of, type) else type(of))


@cache
def _declared(cls: Any) -> dict[Field[Any], Parameter]:
    return {f: f.metadata[_KEY] for f in fields(cls) if _KEY in f.metadata}


def check_parameters(instance: Any) -> None:
    """Raise RangeError or UnknownNameError for a value outside what its field allows; NaN is
    outside every range. A numpy scalar in a field becomes the Python number that it holds.
    """
    for f, parameter in parameters(instance).items():
        value = getattr(instance, f.name)
        check_value(f.name, value, parameter)
        if isinstance(value, Real) and hasattr(value, 'item'):
            object.__setattr__(instance, f.name, value.item())


def make(kind: str, table: Mapping[str, type[T]], name: str, gains: Mapping[str, Any]) -> T:
    """An object of the class that a table has under that name.

    Args:
        kind: What the table holds, for the errors: law, task, preference.
        table: Name to class.
        name: What is wanted.
        gains: Fields declared with `param` that are not to have their defaults.

    Raises:
        UnknownNameError: No such name in the table, or no such field.
        RangeError: A value outside its range.
    """
    if name not in table:
        raise UnknownNameError(kind, name, table)
    allowed = [f.name for f in parameters(table[name])]
    for gain in gains:
        if gain not in allowed:
            raise UnknownNameError(f'gain of {name}', gain, allowed)
    try:
        return table[name](**gains)
    except RangeError as error:
        raise error.about(gain_key(name, error.name)) from None


def gain_key(owner: str, gain: str) -> str:
    """The name of a gain for nodes, the command line and errors.

    Args:
        owner: Name of the law, preference, task or limit.
        gain: Name of its field. One that all laws have is called without the law's name.
    """
    return gain if gain in SHARED_GAINS else f'{owner}.{gain}'


def own_gains(table: Mapping[str, type], name: str, gains: Mapping[str, Any]) -> dict[str, Any]:
    """The gains of one entry of a table, by the names of its fields.

    Args:
        table: Name to class.
        name: In the table.
        gains: Of any entries, by their keys, such as 'posture.gain'.
    """
    keys = {field.name: gain_key(name, field.name) for field in parameters(table[name])}
    return {field: gains[key] for field, key in keys.items() if key in gains}


def check_once(kind: str, names: Iterable[object]) -> None:
    """Raise RepeatedNameError for a name that is given twice; what is no name may be.

    Args:
        kind: What the names are of: limit, preference, task.
        names: Names, or the objects themselves.
    """
    seen = set()
    for name in names:
        if isinstance(name, str) and name in seen:
            raise RepeatedNameError(kind, name)
        if isinstance(name, str):
            seen.add(name)


def resolve_entry(kind: str, table: Mapping[str, type[T]], base: type, entry: str | T) -> T:
    """An entry of a table, given by name or as an object.

    Args:
        kind: What the table holds, for the errors: law, task, preference.
        table: Name to class.
        base: Base class of that kind.
        entry: A name, whose gains then have their defaults; or an object of that kind.

    Raises:
        UnknownNameError: No such name in the table, or an object of another kind.
    """
    if isinstance(entry, str):
        return make(kind, table, entry, {})
    if not isinstance(entry, base):
        raise UnknownNameError(kind, entry, table)
    return entry


def as_tuple(entries: 'str | Iterable[str | T]') -> 'tuple[str | T, ...]':
    """Entries given by name or as objects; a single text is one name."""
    return (entries,) if isinstance(entries, str) else tuple(entries)


def name_of(entry: object, table: Mapping[str, type]) -> str:
    """The name of an object's class in a table; the class's own name if it is not in it.

    Args:
        entry: The object.
        table: Classes by their names.
    """
    cls = type(entry)
    return next((name for name, listed in table.items() if listed is cls), cls.__name__)


def check_value(name: str, value: Any, parameter: Parameter) -> None:
    """The same for one value; of a tuple, every member has to lie within the range.

    Args:
        name: How the value is called where it is refused.
        value: A number, a text, or a tuple of either.
        parameter: What is allowed.

    Raises:
        RangeError: A number outside the range, or no number where one is expected.
        UnknownNameError: A text that is not among the choices.
    """
    members = value if isinstance(value, tuple) else (value,)
    for member in members:
        if parameter.choices:
            _check_choice(name, member, parameter.choices)
        else:
            _check_range(name, member, parameter)


def _check_choice(name: str, value: Any, choices: Collection[str]) -> None:
    if not isinstance(value, str) or value not in choices:
        raise UnknownNameError(name, value, choices)


def _check_range(name: str, value: Any, parameter: Parameter) -> None:
    lower = -math.inf if parameter.lower is None else parameter.lower
    upper = math.inf if parameter.upper is None else parameter.upper
    is_number = isinstance(value, Real)
    is_free_text = isinstance(value, str) and parameter.lower is parameter.upper is None
    if is_number and not lower <= value <= upper:
        raise RangeError(name, value, lower, upper)
    if not is_number and not is_free_text:
        raise RangeError(name, value, lower, upper, 'a number')
