"""The commands in README.md and docs/ work, or say why no test runs them.

A comment before a block of code says what is special about it:

    <!-- not run: REASON -->                  no test runs it
    <!-- run by test_demo: test_it_runs -->   another test does
    <!-- given: q = 0.0 -->                   Python that comes before a block of Python
"""

import ast
import re
import shlex
import shutil
import textwrap
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

import pytest

from redres_ros.cli import main, make_parser
from redres_ros.robots import ARMS

ROOT = Path(__file__).resolve().parents[1]
PAGES = [ROOT / 'README.md', *sorted((ROOT / 'docs').rglob('*.md'))]

# A fenced block or one that is indented, after its comment.
_BLOCK = re.compile(
    r'^(?: *<!-- (?P<mark>[^\n]*?) -->\n)?'
    r'(?:(?P<indent> *)```(?P<language>sh|python)\n(?P<fenced>.*?)^(?P=indent)```$'
    r'|(?P<indented>^ {4}redres [^\n]*\n(?: {4}[^\n]*\n)*))',
    re.MULTILINE | re.DOTALL,
)
_STATUS = re.compile(r'exit status (\d)')
_EXAMPLE = re.compile(r'python3? examples/(\w+)\.py')  # all of them are run by test_examples
# Commands that take long, or wait for somebody: other tests run them. Here their options are read.
_ELSEWHERE = ('check', 'demo', 'reproduce', 'watch')
_QUICKER = {'simulate': ('--period', '0.01'), 'compare': ('--period', '0.01')}


class Block(NamedTuple):
    """Code on a page: what its comment says, its language, and the text."""

    page: str
    mark: str
    language: str
    text: str


def blocks(language: str) -> Iterator[Block]:
    """Those of all pages in that language."""
    for page in PAGES:
        name = str(page.relative_to(ROOT))
        for found in _BLOCK.finditer(page.read_text(encoding='utf-8')):
            if (found['language'] or 'sh') == language:
                text = textwrap.dedent(found['fenced'] or found['indented'])
                yield Block(name, found['mark'] or '', language, text)


def _with_files_of_a_reader(folder: Path) -> Path:
    """The folder with an arm and a task in it, as pages name them."""
    shutil.copy(ROOT / 'redres_ros/robots/planar4r.urdf', folder / 'my_arm.urdf')
    shutil.copy(ROOT / 'config/tasks/rectangle.yaml', folder / 'my_task.yaml')
    (folder / 'examples').symlink_to(ROOT / 'examples')
    return folder


def commands() -> Iterator[tuple[str, str]]:
    """Page and line of every command without a comment that says why it is not run here."""
    for block in blocks('sh'):
        if not block.mark:
            lines = block.text.replace('\\\n', '').splitlines()
            yield from ((block.page, line.strip()) for line in lines if line.strip())


def python_pages() -> dict[str, str]:
    """The Python of each page, one block after the other."""
    pages: dict[str, str] = {}
    for block in blocks('python'):
        if block.mark.startswith(('not run:', 'run by')):
            continue
        given = block.mark.removeprefix('given: ')
        pages[block.page] = f'{pages.get(block.page, "")}\n{given}\n{block.text}'
    return pages


@pytest.mark.slow
@pytest.mark.parametrize(('page', 'line'), list(commands()))
def test_a_command_does_what_it_is_there_for(
    page: str, line: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    if _EXAMPLE.match(line):
        assert (ROOT / 'examples' / f'{_EXAMPLE.match(line)[1]}.py').exists()
        return
    program, *arguments = shlex.split(line, comments=True)
    assert Path(program).name == 'redres', f'{page} does not say why no test runs: {line}'
    if arguments[0] in _ELSEWHERE:
        make_parser().parse_args(arguments)
        return
    wanted = _STATUS.search(line)
    monkeypatch.chdir(_with_files_of_a_reader(tmp_path))
    if '--period' not in arguments:  # the same motion in longer steps
        arguments += _QUICKER.get(arguments[0], ())
    assert main(arguments) == (int(wanted[1]) if wanted else 0)


@pytest.mark.slow
@pytest.mark.parametrize('page', python_pages())
def test_the_python_of_a_page_runs(
    page: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(_with_files_of_a_reader(tmp_path))
    exec(compile(python_pages()[page], page, 'exec'), {'__name__': page})


@pytest.mark.parametrize(
    ('page', 'mark'),
    [(block.page, block.mark) for block in (*blocks('sh'), *blocks('python')) if block.mark],
)
def test_a_comment_gives_a_reason_or_a_test_that_exists(page: str, mark: str) -> None:
    kind, _, said = mark.partition(': ')
    if kind.startswith('run by '):
        for file, test in re.findall(r'(test_\w+): (test_\w+)', mark):
            tree = ast.parse((ROOT / 'test' / f'{file}.py').read_text(encoding='utf-8'))
            assert test in {n.name for n in ast.walk(tree) if isinstance(n, ast.FunctionDef)}
        assert re.search(r'test_\w+: test_', mark)
    else:
        assert kind in ('not run', 'given')
        assert said


@pytest.mark.parametrize('page', ['README.md', 'CONTRIBUTING.md'])
def test_what_a_page_outside_the_site_links_to_is_there(page: str) -> None:
    links = re.findall(r'\]\(([^)#]+)', (ROOT / page).read_text(encoding='utf-8'))
    missing = [link for link in links if '://' not in link and not (ROOT / link).exists()]
    assert missing == []


@pytest.mark.parametrize('name', sorted(ARMS))
def test_every_arm_has_a_row_on_its_page(name: str) -> None:
    page = (ROOT / 'docs' / 'arms.md').read_text(encoding='utf-8')
    arm = ARMS[name]
    pose_task = f'`{name}_pose`' if len(arm.start) > 5 else '–'
    row = rf'\| `{name}` \|[^|]*\| {len(arm.start)} \| `{arm.task}` \| {pose_task} \|'
    assert len(re.findall(row, page)) == 1
