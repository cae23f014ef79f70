"""Where each equation of the paper is in the code: its number stands at the line."""

import ast
import re
from collections.abc import Iterator
from pathlib import Path

from extension.markdown import code, table

PACKAGE = Path(__file__).resolve().parents[2] / 'redres_ros'

# 'Eq. (15)', and what goes on as 'Eq. (24)-(26) -> (27)' or 'Eq. (7) with (A.14)'
_NUMBER = r'\((\d+|[AB]\.\d+)\)'
_SEVERAL = re.compile(rf'Eqs?\. ?{_NUMBER}(?:(?:,|;| and| or| with|-|–| ->)? ?{_NUMBER})*')
_RANGE = re.compile(rf'{_NUMBER}[-–]{_NUMBER}')


def equations() -> Iterator[str]:
    """A row for each equation, in the paper's order."""
    places: dict[str, list[str]] = {}
    for path in sorted(PACKAGE.rglob('*.py')):
        for number, place in _in_file(path):
            known = places.setdefault(number, [])
            if place not in known:
                known.append(place)
    rows = [
        (f'({number})', ', '.join(map(code, places[number])))
        for number in sorted(places, key=_order)
    ]
    yield from table(('equation', 'in'), rows)


def _in_file(path: Path) -> Iterator[tuple[str, str]]:
    """Every number in the file, and the module with the class or function in which it stands."""
    text = path.read_text(encoding='utf-8')
    module = '.'.join(path.relative_to(PACKAGE).with_suffix('').parts).removesuffix('.__init__')
    outermost = [
        node for node in ast.parse(text).body if isinstance(node, ast.FunctionDef | ast.ClassDef)
    ]
    for line, words in enumerate(text.splitlines(), start=1):
        for number in _numbers(words):
            holder = [n.name for n in outermost if n.lineno <= line <= (n.end_lineno or 0)]
            yield number, '.'.join([module, *holder])


def _numbers(words: str) -> Iterator[str]:
    """The numbers of all equations that a line names, those between (24)-(26) too."""
    for found in _SEVERAL.finditer(words):
        yield from re.findall(_NUMBER, found[0])
        for first, last in _RANGE.findall(found[0]):
            yield from map(str, range(int(first) + 1, int(last)))


def _order(number: str) -> tuple[str, int]:
    appendix, _, digits = number.rpartition('.')
    return appendix, int(digits)
