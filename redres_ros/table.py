"""Tables of building blocks by name: laws, preferences, tasks and limits."""

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Any, TypeVar

from redres_ros.errors import RangeError, RepeatedNameError, UnknownNameError
from redres_ros.files.installed import installed
from redres_ros.files.plugins import register
from redres_ros.parameter import Parameter, parameters

SHARED_GAINS = ('damping',)  # all laws have them

T = TypeVar('T')


@dataclass(frozen=True)
class Gain:
    """A parameter of a building block.

    Attributes:
        kind: Kind of its owner, such as 'law'.
        owner: The name in its table.
        name: Name of its field.
        default: Default of its field, whose type it has.
        parameter: Its declaration.
    """

    kind: str
    owner: str
    name: str
    default: Any
    parameter: Parameter

    @property
    def key(self) -> str:
        """Its name for nodes, the command line and errors, such as 'posture.gain'."""
        return _key(self.owner, self.name)


class Table(dict[str, type[T]]):
    """Classes of one kind by name, with those of installed packages; plugins add others.

    Args:
        kind: What they are, for errors: law, preference, task, limit.
        base: Their base class.
        **classes: Classes by name.
    """

    def __init__(self, kind: str, base: type, **classes: type[T]) -> None:
        super().__init__(classes)
        self.kind = kind
        self._base = base
        self.update(installed(f'{kind}s'))
        register(base, self)

    def make(self, name: str, *arguments: object, **gains: object) -> T:
        """An object of the class of that name.

        Args:
            name: Name in the table.
            *arguments: What comes before the gains: of a limit, the arm and a scale.
            **gains: Fields declared with `param` that differ from their defaults: damping=10.0.

        Raises:
            UnknownNameError: No such name in the table, or no such gain.
            RangeError: A gain outside its range.
            ArrayError: A gain that should be a vector of finite numbers.
        """
        if name not in self:
            raise UnknownNameError(self.kind, name, self)
        allowed = [field.name for field in parameters(self[name])]
        for gain in gains:
            if gain not in allowed:
                raise UnknownNameError(f'gain of {name}', gain, allowed)
        try:
            return self[name](*arguments, **gains)
        except RangeError as error:
            if error.name not in allowed:
                raise
            raise error.about(_key(name, error.name)) from None

    def resolve(
        self, entry: str | T, gains: Mapping[str, Any] = MappingProxyType({}), *arguments: object
    ) -> T:
        """What an entry stands for: a name, or the object itself.

        Args:
            entry: A name in the table, or an object of this kind.
            gains: Gains of any entries, by their keys, such as 'posture.gain'.
            *arguments: See make().

        Raises:
            UnknownNameError: No such name in the table, or an object of another kind.
            RangeError: A gain outside its range.
        """
        if isinstance(entry, str):
            own = {gain.name: gains[gain.key] for gain in self.gains(entry) if gain.key in gains}
            return self.make(entry, *arguments, **own)
        if not isinstance(entry, self._base):
            raise UnknownNameError(self.kind, entry, self)
        return entry

    def resolve_all(
        self, entries: str | Iterable[str | T], gains: Mapping[str, Any] = MappingProxyType({})
    ) -> tuple[T, ...]:
        """What several entries stand for.

        Args:
            entries: Names or objects, or a single name.
            gains: See resolve().

        Raises:
            RepeatedNameError: A name is given twice.
            As resolve().
        """
        given = as_tuple(entries)
        check_once(self.kind, given)
        return tuple(self.resolve(entry, gains) for entry in given)

    def name_of(self, entry: object) -> str:
        """The name of an object's class; the class's own name if the table does not have it."""
        cls = type(entry)
        return next((name for name, listed in self.items() if listed is cls), cls.__name__)

    def gains(self, *names: str) -> Iterator[Gain]:
        """The gains of the entries of those names, or of all; none of one that is not there."""
        for owner in names or self:
            for field, parameter in parameters(self[owner]).items() if owner in self else ():
                yield Gain(self.kind, owner, field.name, field.default, parameter)

    @property
    def gain_keys(self) -> dict[str, None]:
        """The keys of all gains, in their order."""
        return dict.fromkeys(gain.key for gain in self.gains())


def as_tuple(entries: 'str | Iterable[str | T]') -> 'tuple[str | T, ...]':
    """Entries given by name or as objects; a single text is one name."""
    return (entries,) if isinstance(entries, str) else tuple(entries)


def check_once(kind: str, names: Iterable[object]) -> None:
    """Raise RepeatedNameError for a name that is given twice; objects may repeat.

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


def _key(owner: str, gain: str) -> str:
    """The key of a gain. One that all laws have is called without the law's name."""
    return gain if gain in SHARED_GAINS else f'{owner}.{gain}'
