"""docs/arms.md has what the table of arms has."""

from pathlib import Path

import pytest

from redres_ros.robots import ARMS

PAGE = Path(__file__).parents[1] / 'docs' / 'arms.md'


@pytest.mark.parametrize('name', sorted(ARMS))
def test_every_arm_has_a_row_on_its_page(name: str) -> None:
    page = PAGE.read_text(encoding='utf-8')
    rows = [row.split('|') for row in page.splitlines() if row.startswith(f'| `{name}` |')]
    arm = ARMS[name]
    pose_task = f'`{name}_pose`' if len(arm.start) > 5 else '–'
    assert [[cell.strip() for cell in row[3:6]] for row in rows] == [
        [str(len(arm.start)), f'`{arm.task}`', pose_task]
    ]
