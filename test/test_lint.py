"""scripts/lint and scripts/lint_words.py find what they are there for."""

import subprocess
import sys
from pathlib import Path

import pytest

SCRIPTS = Path(__file__).resolve().parents[1] / 'scripts'
LINT = SCRIPTS / 'lint'
BARE = "import numpy as np\ndef f(q: np.ndarray) -> int:\n    '''The sum.'''\n"
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
        (BARE, 'f: q has neither shape nor unit'),
        (RAISING, 'f: OwnError is not below Raises:'),
    ],
)
def test_a_fault_is_found(source: str, said: str, tmp_path: Path) -> None:
    [line] = faults(source, tmp_path)
    assert said in line


def test_one_idea_and_one_argument_need_no_more(tmp_path: Path) -> None:
    source = 'a, b = pair()\n[i for row in rows for i in row]\ndef f(x): ...\n'
    assert faults(source, tmp_path) == []


PRIVATE = 'ecnalg'[::-1]  # written backwards, so that the script does not find it here


@pytest.mark.parametrize('text', [f'a {PRIVATE} at the page', f'last_{PRIVATE} = 0'])
def test_private_words_are_found_in_prose_and_in_names(text, tmp_path):
    assert words(text, tmp_path) == [f'{tmp_path}/page.md:1: {PRIVATE}, use: snapshot']


def test_words_of_the_field_pass(tmp_path):
    assert words('a snapshot of the null space', tmp_path) == []


def words(text: str, folder: Path) -> list[str]:
    """What scripts/lint_words.py prints of a page with that text."""
    page = folder / 'page.md'
    page.write_text(text)
    done = subprocess.run(
        [sys.executable, str(SCRIPTS / 'lint_words.py'), str(page)],
        capture_output=True,
        text=True,
        check=False,
    )
    lines = done.stdout.splitlines()
    assert done.returncode == bool(lines), done.stderr
    return lines
