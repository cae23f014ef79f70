"""scripts/lint and scripts/lint_words.py find what they are there for."""

import subprocess
import sys
from pathlib import Path

import pytest

SCRIPTS = Path(__file__).resolve().parents[1] / 'scripts'
BARE = "import numpy as np\ndef f(q: np.ndarray) -> int:\n    '''The sum.'''\n"
RAISING = 'class OwnError(Exception): ...\ndef f() -> None:\n    raise OwnError()\n'


def complaints(script: str, looked_at: Path) -> list[str]:
    """What a script prints of a folder or file."""
    words = [sys.executable, str(SCRIPTS / script), str(looked_at)]
    done = subprocess.run(words, capture_output=True, text=True, check=False)
    lines = done.stdout.splitlines()
    assert done.returncode == bool(lines), done.stderr
    return lines


@pytest.mark.parametrize(
    ('source', 'said'),
    [
        ('a, b = 1, 2', 'several values'),
        ('[[i for i in row] for row in rows]', 'a comprehension'),
        ('x if p else y if q else z', 'a conditional expression'),
        (BARE, 'f: q has neither shape nor unit'),
        (RAISING, 'f: OwnError is not below Raises:'),
    ],
)
def test_a_fault_is_found(source: str, said: str, tmp_path: Path) -> None:
    (tmp_path / 'source.py').write_text(source)
    [line] = complaints('lint', tmp_path)
    assert said in line


def test_one_idea_and_one_argument_need_no_more(tmp_path: Path) -> None:
    source = 'a, b = pair()\n[i for row in rows for i in row]\ndef f(x): ...\n'
    (tmp_path / 'source.py').write_text(source)
    assert complaints('lint', tmp_path) == []


PRIVATE = 'ecnalg'[::-1]  # written backwards, so that the script does not find it here


@pytest.mark.parametrize(
    ('text', 'is_private'),
    [
        (f'a {PRIVATE} at the page', True),
        (f'last_{PRIVATE} = 0', True),
        ('a snapshot of the null space', False),
    ],
)
def test_private_words_are_found_in_prose_and_in_names(
    text: str, is_private: bool, tmp_path: Path
) -> None:
    page = tmp_path / 'page.md'
    page.write_text(text)
    expected = [f'{page}:1: {PRIVATE}, use: snapshot'] if is_private else []
    assert complaints('lint_words.py', page) == expected
