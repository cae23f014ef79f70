"""Errors of the user's input: each says in one line what was got and what is allowed."""

from collections.abc import Iterable
from difflib import get_close_matches
from numbers import Real
from typing import Any

_LONGEST = 60  # characters of a value that an error quotes
_LONGEST_LINE = 1000  # characters of a line
_MOST_NAMES = 60  # that an error lists as allowed
_ALIKE = 0.85  # similarity of two names; target_timeout must not count as state_timeout


def quoted(value: Any) -> str:
    """The value in an error: on one line, and truncated."""
    if isinstance(value, Real) and hasattr(value, 'item'):
        value = value.item()  # of numpy, whose repr names the type
    try:
        text = ' '.join(repr(value).split())
    except (ValueError, RecursionError):  # a number of too many digits, or lists nested too deeply
        text = f'a value of type {type(value).__name__}'
    if len(text) <= _LONGEST:
        return text
    return f'{text[: _LONGEST // 2]} ... {text[-_LONGEST // 4 :]}'


def reason_of(error: BaseException) -> str:
    """What an error says, on one line; of the operating system without the name of a file."""
    text = getattr(error, 'strerror', None) or str(error)
    return ' '.join(text.split())


def one_line(text: str) -> str:
    """A text from outside, safe for a log or a terminal: truncated, without control characters."""
    cut = text[:_LONGEST_LINE]
    seen = ''.join(each if each.isprintable() else ' ' for each in cut)
    return seen if len(cut) == len(text) else f'{seen} ...'


class RedresError(Exception):
    """Base class of the errors of this package."""


class UnknownNameError(RedresError):
    """A name that is in no table: of a law, a robot, a task, a frame."""

    def __init__(self, kind: str, got: object, allowed: Iterable[str]) -> None:
        self.kind = kind
        self.got = got
        self.allowed = tuple(sorted(allowed))
        shown = self.allowed[:_MOST_NAMES]
        others = len(self.allowed) - len(shown)
        more = f' and {others} others' if others else ''
        meant = ''.join(f' (is {name} meant?)' for name in alike(str(got), self.allowed))
        super().__init__(f'unknown {kind} {quoted(got)}{meant}; allowed: {", ".join(shown)}{more}')


def alike(name: str, known: Iterable[str]) -> list[str]:
    """The known name that a misspelt one resembles most, if there is one."""
    return get_close_matches(name, known, 1, _ALIKE)


class RangeError(RedresError):
    """A number outside its range, or not a finite number at all; `why` is a remark."""

    def __init__(self, name: str, got: float, lower: float, upper: float, why: str = '') -> None:
        self.name = name
        self.got = got
        self.lower = lower
        self.upper = upper
        self.why = why
        remark = f' ({why})' if why else ''
        super().__init__(f'{name} is {quoted(got)}; allowed: {lower:g} to {upper:g}{remark}')


class RepeatedNameError(RedresError):
    """A name that is given twice."""

    def __init__(self, kind: str, name: str) -> None:
        self.kind = kind
        self.name = name
        super().__init__(f'{kind} {quoted(name)} is named twice; allowed: once')


class ArrayError(RedresError):
    """An array of the wrong shape, or one that holds NaN or infinity."""


class DivergedError(RedresError):
    """A speed of the joints [rad/s] beyond any arm's, which is not commanded."""

    def __init__(self, speed: float, limit: float, reason: str) -> None:
        self.speed = speed
        self.limit = limit
        self.reason = reason
        asked = f'the joints would have to move at {speed:.3g} rad/s'
        super().__init__(f'{asked}; allowed: up to {limit:g}; the reason is {reason}')


class JointNamesError(RedresError):
    """Joint names of a message that are not those of the arm."""

    def __init__(self, got: Iterable[str], expected: Iterable[str]) -> None:
        self.got = tuple(got)
        self.expected = tuple(expected)
        problems = {
            'missing': [name for name in self.expected if name not in self.got],
            'not of this arm': [name for name in self.got if name not in self.expected],
            'more than once': sorted({name for name in self.got if self.got.count(name) > 1}),
        }
        parts = [f'{problem} {", ".join(names)}' for problem, names in problems.items() if names]
        wanted = ', '.join(self.expected)
        super().__init__(f'wrong joint names: {"; ".join(parts)}; expected {wanted} in any order')


class FileError(RedresError):
    """A file that is not there, cannot be read, or does not hold what it should."""
