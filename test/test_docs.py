"""docs/troubleshooting.md: every row is shown by a test that exists, and nothing that can go
wrong is left out.
"""

import ast
from dataclasses import fields
from pathlib import Path

import pytest

from redres_ros.fake_robot.faults import Faults
from redres_ros.fake_robot.profile import FCI
from redres_ros.fake_robot.session import Refusal
from redres_ros.robots import ARMS

HERE = Path(__file__).parent
PAGE = HERE.parent / 'docs' / 'troubleshooting.md'


_COLUMNS = 4  # of a table of what to do


def rows() -> list[list[str]]:
    """The cells of every row of the page's tables of what to do: heads, and rows without a test,
    are left out.
    """
    lines = [
        line for line in PAGE.read_text(encoding='utf-8').splitlines() if line.startswith('| ')
    ]
    cells = [[cell.strip() for cell in line.strip('|').split('|')] for line in lines]
    return [row for row in cells if len(row) == _COLUMNS and row[-1].startswith('test_')]


def functions(file: str) -> set[str]:
    """Names of all functions and methods of a test file."""
    tree = ast.parse((HERE / f'{file}.py').read_text(encoding='utf-8'))
    return {node.name for node in ast.walk(tree) if isinstance(node, ast.FunctionDef)}


@pytest.mark.parametrize('shown_by', [row[-1] for row in rows()])
def test_what_a_row_says_is_shown_by_a_test_that_exists(shown_by: str) -> None:
    file, name = shown_by.split(': ')
    assert name in functions(file)


def test_every_scenario_of_recovery_has_a_row() -> None:
    shown = {row[-1].partition(': ')[2] for row in rows()}
    scenarios = {name for name in functions('test_recovery') if name.startswith('test_')}
    # The law that is switched in every tick has one already; this is the same over DDS.
    assert scenarios - shown == {
        'test_a_law_switched_as_fast_as_the_graph_can_moves_the_arm_softly'
    }


@pytest.mark.parametrize('kind', list(Refusal))
def test_every_kind_of_refusal_has_a_row(kind: Refusal) -> None:
    assert any(f'*{kind.value}*' in row[0] for row in rows())


@pytest.mark.parametrize('name', sorted(set(FCI.reflexes.values())))
def test_every_reflex_of_a_franka_arm_has_a_row(name: str) -> None:
    assert any(f'`{name}: …`' in row[0] for row in rows())


@pytest.mark.parametrize('fault', [field.name for field in fields(Faults)])
def test_every_fault_has_a_row(fault: str) -> None:
    of = fault.removesuffix('_spread').removesuffix('_burst')
    assert any(f'`{of}`' in row[1] for row in rows())


@pytest.mark.parametrize('name', sorted(ARMS))
def test_every_arm_has_a_row_on_its_page(name: str) -> None:
    page = PAGE.with_name('arms.md').read_text(encoding='utf-8')
    rows = [row.split('|') for row in page.splitlines() if row.startswith(f'| `{name}` |')]
    arm = ARMS[name]
    pose_task = f'`{name}_pose`' if len(arm.start) > 5 else '–'
    assert [[cell.strip() for cell in row[3:6]] for row in rows] == [
        [str(len(arm.start)), f'`{arm.task}`', pose_task]
    ]
