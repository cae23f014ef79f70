"""Parameters as dataclass fields, declared once for Python, ROS, the command line and the docs; and
the tables of the building blocks that have them: laws, preferences, tasks and limits.
"""

import math
from collections import Counter
from collections.abc import Collection, Iterable, Iterator, Mapping
from dataclasses import Field, dataclass, field, fields
from numbers import Real
from types import MappingProxyType
from typing import Any, TypeVar

from redres_ros.errors import ArrayError, RangeError, RepeatedNameError, UnknownNameError, quoted
from redres_ros.files.plugins import installed, register

T = TypeVar('T')

_KEY = 'parameter'
# Gains that all building blocks of a kind have in common, and what they are called.
_COMMON = {
    'law': {'damping': 'damping', 'gravity': 'gravity', 'horizon': 'horizon'},
    'task': {'gain': 'task_gain'},
    'limit': {name: f'scene.{name}' for name in ('clearance', 'obstacles', 'walls', 'points')},
}
_NO_GAINS: Mapping[str, Any] = MappingProxyType({})


@dataclass(frozen=True)
class Parameter:
    """The declaration of a field beside its type and default."""

    description: str  # with its unit in brackets
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
    """A dataclass field that is a parameter: of Python, of a node, and of the command line."""
    return field(
        default=default, metadata={_KEY: Parameter(description, lower, upper, choices, live)}
    )


def parameters(of: Any) -> dict[Field[Any], Parameter]:
    """The fields of a dataclass, or of an instance, that were declared with `param`."""
    return {f: f.metadata[_KEY] for f in fields(of) if _KEY in f.metadata}


class Checked:
    """Base of dataclasses with parameters: RangeError or UnknownNameError for a value that a field
    does not allow; NaN is in no range. A numpy scalar becomes the Python number that it holds.
    """

    def __post_init__(self) -> None:
        for f, parameter in parameters(self).items():
            value = getattr(self, f.name)
            check_value(f.name, value, parameter)
            if isinstance(value, Real) and hasattr(value, 'item'):
                object.__setattr__(self, f.name, value.item())


def check_value(name: str, value: Any, parameter: Parameter) -> None:
    """Raise RangeError or UnknownNameError for a value, or one in a tuple, that is not allowed."""
    lower = -math.inf if parameter.lower is None else parameter.lower
    upper = math.inf if parameter.upper is None else parameter.upper
    is_text = parameter.lower is parameter.upper is None
    for member in value if isinstance(value, tuple) else (value,):
        is_number = isinstance(member, Real)
        if parameter.choices:
            if not isinstance(member, str) or member not in parameter.choices:
                raise UnknownNameError(name, member, parameter.choices)
        elif is_number and not lower <= member <= upper:
            raise RangeError(name, member, lower, upper)
        elif not is_number and not (is_text and isinstance(member, str)):
            raise RangeError(name, member, lower, upper, 'a number')


@dataclass(frozen=True)
class Gain:
    """A parameter of a building block."""

    kind: str  # of its owner, such as 'law'
    owner: str  # the name in its table
    name: str  # of its field
    key: str  # for nodes, the command line and errors, such as 'posture.gain'
    default: Any  # of its field, whose type it has
    parameter: Parameter


class Table(dict[str, type[T]]):
    """Classes of one kind by name, with those of installed packages; plugins add others.

    An entry may say more after an @, such as the frame in orientation@link_4: it sets the field
    that the class names as its `qualifier`.
    """

    def __init__(self, kind: str, base: type, **classes: type[T]) -> None:
        super().__init__(classes)
        self.kind = kind  # for errors: law, preference, task, limit
        self._base = base
        self.update(installed(f'{kind}s'))
        register(base, self)

    def __contains__(self, entry: object) -> bool:
        """Whether an object can be made by this name."""
        name, at, word = str(entry).partition('@')
        if not super().__contains__(name):
            return False
        return not at or bool(word and getattr(self[name], 'qualifier', ''))

    def make(self, entry: str, *arguments: object, **gains: object) -> T:
        """An object of the class of that name, also with an @.

        Args:
            *arguments: What comes before the gains: of a limit, the arm and a scale.
            **gains: Fields declared with `param` that differ from their defaults: damping=10.0.

        Raises UnknownNameError for no such name or gain; RangeError and ArrayError for its value.
        """
        if entry not in self:
            raise UnknownNameError(self.kind, entry, self)
        name, at, word = entry.partition('@')
        made: Any = self[name]
        allowed = [f.name for f in parameters(made)]
        for gain in gains:
            if gain not in allowed:
                raise UnknownNameError(f'gain of {name}', gain, allowed)
        if at:
            gains[made.qualifier] = word
        try:
            return made(*arguments, **gains)
        except RangeError as error:
            if error.name not in allowed:
                raise
            key = _key(self.kind, name, error.name)
            raise RangeError(key, error.got, error.lower, error.upper, error.why) from None

    def resolve(
        self, entry: str | T, gains: Mapping[str, Any] = _NO_GAINS, *arguments: object
    ) -> T:
        """What an entry stands for: a name, with its own of all the gains by their keys; or the
        object itself. Raises as make(), and UnknownNameError for an object of another kind.
        """
        if isinstance(entry, str):
            own = self.gains(entry.partition('@')[0])
            given = {gain.name: gains[gain.key] for gain in own if gain.key in gains}
            return self.make(entry, *arguments, **given)
        if not isinstance(entry, self._base):
            raise UnknownNameError(self.kind, entry, self)
        return entry

    def resolve_all(
        self, entries: str | Iterable[str | T], gains: Mapping[str, Any] = _NO_GAINS
    ) -> tuple[T, ...]:
        """What entries stand for, or a single one. Raises as make(), and RepeatedNameError."""
        given = as_tuple(f'{self.kind}s', entries)
        check_once(self.kind, given)
        return tuple(self.resolve(entry, gains) for entry in given)

    def name_of(self, entry: object) -> str:
        """The name of an object's class; the class's own name if the table does not have it."""
        cls = type(entry)
        return next((name for name, listed in self.items() if listed is cls), cls.__name__)

    def gains(self, *names: str) -> Iterator[Gain]:
        """The gains of the entries of those names, or of all; none of one that is not there."""
        for owner in names or self:
            for f, parameter in parameters(self[owner]).items() if owner in self else ():
                key = _key(self.kind, owner, f.name)
                yield Gain(self.kind, owner, f.name, key, f.default, parameter)

    @property
    def gain_keys(self) -> dict[str, None]:
        """The keys of all gains, in their order."""
        return dict.fromkeys(gain.key for gain in self.gains())


def as_tuple(name: str, entries: 'str | Iterable[str | T]') -> 'tuple[str | T, ...]':
    """Entries given by name or as objects; a single text is one name."""
    check_kind(name, entries, Iterable, 'a list of names or objects; () for none')
    return (entries,) if isinstance(entries, str) else tuple(entries)


def check_kind(name: str, value: object, kind: type, expected: str) -> None:
    """Raise ArrayError for a value of another kind than expected."""
    if not isinstance(value, kind):
        raise ArrayError(f'{name} is {quoted(value)}; expected {expected}')


def check_once(kind: str, entries: Iterable[object]) -> None:
    """Raise RepeatedNameError for a name of that kind that is given twice; objects may repeat."""
    names = Counter(entry for entry in entries if isinstance(entry, str))
    for name, count in names.items():
        if count > 1:
            raise RepeatedNameError(kind, name)


def _key(kind: str, owner: str, gain: str) -> str:
    return _COMMON.get(kind, {}).get(gain, f'{owner}.{gain}')
