"""scripts/lint finds what it is there for."""

import subprocess
import sys
from pathlib import Path

import pytest

LINT = Path(__file__).resolve().parents[1] / 'scripts' / 'lint'
UNDESCRIBED = """
class OwnError(Exception): ...
def f(x: int, y: int) -> int:
    '''The sum.

    Args:
        x: One.
    '''
"""
RAISING = 'class OwnError(Exception): ...\ndef f() -> None:\n    raise OwnError()\n'


def faults(source: str, folder: Path) -> list[str]:
    """What the script prints of a file with that source."""
    (folder / 'source.py').write_text(source)
    done = subprocess.run(
        [sys.executable, str(LINT), str(folder)], capture_output=True, text=True, check=False
    )
    lines = done.stdout.splitlines()
    assert done.returncode == (1 if lines else 0), done.stderr
    return lines


@pytest.mark.parametrize(
    ('source', 'said'),
    [
        ('a, b = 1, 2', 'several values'),
        ('[[i for i in row] for row in rows]', 'a comprehension'),
        ('x if p else y if q else z', 'a conditional expression'),
        (UNDESCRIBED, 'f: y is not below Args:'),
        (RAISING, 'f: OwnError is not below Raises:'),
    ],
)
def test_a_fault_is_found(source: str, said: str, tmp_path: Path) -> None:
    [line] = faults(source, tmp_path)
    assert said in line


def test_one_idea_and_one_argument_need_no_more(tmp_path: Path) -> None:
    source = 'a, b = pair()\n[i for row in rows for i in row]\ndef f(x): ...\n'
    assert faults(source, tmp_path) == []
