"""The recipes of CONTRIBUTING.md work: all are followed to the letter in a copy of the project."""

import os
import re
import shutil
import subprocess
import sys
from pathlib import Path
from typing import NamedTuple

import pytest

ROOT = Path(__file__).resolve().parents[1]
PAGE = (ROOT / 'CONTRIBUTING.md').read_text(encoding='utf-8')
# All that the recipes read, change or run; what mypy knows already spares it half a minute.
PARTS = ('redres_ros', 'test', 'config', 'package.xml', 'pyproject.toml', '.mypy_cache')

pytestmark = pytest.mark.nightly


class Step(NamedTuple):
    """A block of code, its language, and the file that the sentence before it names last."""

    file: str
    language: str
    code: str


def recipes() -> dict[str, list[Step]]:
    """The steps of every section, by what it adds."""
    found = {}
    for section in re.split(r'^## Add an? ', PAGE, flags=re.MULTILINE)[1:]:
        kind = section.partition('\n')[0]
        blocks = re.findall(r'(.*?)^```(\w+)\n(.*?)^```$', section, re.MULTILINE | re.DOTALL)
        found[kind] = []
        for text, language, code in blocks:
            files = re.findall(r'`([\w/]+\.\w+)`', text)
            found[kind].append(Step(files[-1] if files else '', language, code))
    return found


def apply(diff: str, content: str) -> str:
    """The content with each added line after the line of context before it."""
    lines = content.splitlines()
    place = -1
    for row in diff.splitlines():
        if row.startswith('+'):
            place += 1
            lines.insert(place, row[1:])
        else:
            assert place >= 0 or lines.count(row[1:]) == 1, f'not once in the file: {row[1:]}'
            place = lines.index(row[1:], place + 1)
    return '\n'.join(lines) + '\n'


def follow(step: Step, project: Path) -> None:
    file = project / step.file
    if step.language == 'sh':
        run(step.code, project)
    elif step.language == 'diff':
        file.write_text(apply(step.code, file.read_text(encoding='utf-8')), encoding='utf-8')
    else:
        assert not file.exists(), f'{step.file} is there already'
        file.write_text(step.code, encoding='utf-8')


def run(commands: str, project: Path) -> str:
    """What commands print in a copy of the project."""
    path = f'{Path(sys.executable).parent}{os.pathsep}{os.environ["PATH"]}'
    done = subprocess.run(
        ['bash', '-euc', commands],
        cwd=project,
        env=os.environ | {'PATH': path, 'PYTHONPATH': str(project)},
        capture_output=True,
        text=True,
        timeout=1800,  # what hangs fails; nothing is claimed about speed
        check=False,
    )
    assert done.returncode == 0, f'{commands}\n{done.stdout}{done.stderr}'
    return done.stdout


@pytest.fixture(scope='module')
def project(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A copy of the project in which all recipes are followed up to their last step, the look at
    what they made.
    """
    copy = tmp_path_factory.mktemp('project')
    for part in PARTS:
        if (ROOT / part).is_dir():  # with __pycache__: what is compiled already stays so
            shutil.copytree(ROOT / part, copy / part)
        elif (ROOT / part).exists():
            shutil.copy(ROOT / part, copy / part)
    for steps in recipes().values():
        for step in steps[:-1]:
            follow(step, copy)
    return copy


@pytest.mark.parametrize('kind', recipes())
def test_what_a_recipe_makes_passes_every_test_that_finds_it_and_runs(kind, project):
    *_, look = recipes()[kind]
    assert look.language == 'sh'
    assert ' passed' in run(look.code, project)


def test_what_all_recipes_make_is_in_good_style(project: Path) -> None:
    made = {step.file for steps in recipes().values() for step in steps if step.language != 'sh'}
    files = ' '.join(file for file in made if file.endswith('.py'))
    run(f'ruff format --check {files}; ruff check {files}; mypy {files}', project)
