"""Errors that a user can mend: each says in one line what was got and what is allowed."""

from collections.abc import Iterable


class RedresError(Exception):
    """Base of every error that this package raises on purpose."""


class UnknownNameError(RedresError):
    """A name that is in no table: law, robot, task, dynamics."""

    def __init__(self, kind: str, got: str, allowed: Iterable[str]) -> None:
        self.kind = kind
        self.got = got
        self.allowed = tuple(sorted(allowed))
        super().__init__(f'unknown {kind} {got!r}; allowed: {", ".join(self.allowed)}')


class RangeError(RedresError):
    """A number outside its range, or not a finite number at all."""

    def __init__(self, name: str, got: float, lower: float, upper: float, why: str = '') -> None:
        self.name = name
        self.got = got
        self.lower = lower
        self.upper = upper
        super().__init__(
            f'{name} is {got}; allowed: {lower:g} to {upper:g}' + (f' ({why})' if why else '')
        )


class ArrayError(RedresError):
    """An array of the wrong shape, or one that holds NaN or infinity."""


class JointNamesError(RedresError):
    """Joint names of a message that are not those of the arm."""

    def __init__(self, got: Iterable[str], expected: Iterable[str]) -> None:
        self.got = tuple(got)
        self.expected = tuple(expected)
        missing = [name for name in self.expected if name not in self.got]
        surplus = [name for name in self.got if name not in self.expected]
        twice = sorted({name for name in self.got if self.got.count(name) > 1})
        parts = [
            f'{word} {", ".join(names)}'
            for word, names in (
                ('missing', missing),
                ('not of this arm', surplus),
                ('more than once', twice),
            )
            if names
        ]
        super().__init__(
            f'wrong joint names: {"; ".join(parts)}; expected {", ".join(self.expected)} in any order'
        )


class FileError(RedresError):
    """A file that is not there, cannot be read, or does not hold what it should."""
