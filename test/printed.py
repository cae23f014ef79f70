"""Compares what is printed with what was printed elsewhere."""

import re
from decimal import Decimal
from itertools import zip_longest

# neither within a word nor behind a point
_FIGURE = re.compile(r'(?<![\w.])([-−]?\d+(?:\.\d+)?%?)')
_COUNT = 100  # a whole number below it counts something, from there on it is rounded


def differences(printed: str, other: str) -> list[str]:
    """Where two texts differ otherwise than by one unit of a figure's last digit.

    The last bits of a figure are those of the processor that computed it. Where it lies half-way
    between two that can be printed, they decide which one is.

    Args:
        printed: One text.
        other: What it is compared with.
    """
    pairs = zip_longest(_parts(printed), _parts(other), fillvalue='nothing')
    return [f'{one!r} for {two!r}' for one, two in pairs if not _agree(one, two)]


def _parts(text: str) -> list[str]:
    """Words and figures by turns, whatever space is between them."""
    parts = [' '.join(part.split()) for part in _FIGURE.split(text)]
    return [part for part in parts if part]


def _agree(one: str, two: str) -> bool:
    if one == two:
        return True
    if not (_FIGURE.fullmatch(one) and _FIGURE.fullmatch(two)):
        return False
    if one.endswith('%') != two.endswith('%'):
        return False
    first = _value(one)
    second = _value(two)
    is_count = '.' not in one + two and not one.endswith('%') and abs(first) < _COUNT
    # The finer of both: 8.50 may have been shortened to 8.5.
    unit = min(Decimal((0, (1,), int(each.as_tuple()[2]))) for each in (first, second))
    return abs(first - second) <= (0 if is_count else unit)


def _value(figure: str) -> Decimal:
    return Decimal(figure.rstrip('%').replace('−', '-'))
