"""The figures in README.md and docs/choosing_a_law.md are those of the code as it is."""

import sys
from pathlib import Path

import pytest
from printed import differences

sys.path.append(str(Path(__file__).resolve().parents[1] / 'docs'))

import make_numbers as numbers

pytestmark = pytest.mark.slow


def on_page(page: int, name: str) -> str:
    """What stands in a block; a page without it is an error."""
    found = numbers.block(numbers.PAGES[page].read_text(encoding='utf-8'), name)
    assert found, f'{name} is empty'
    return found


def cells(table: str, law: str) -> list[str]:
    """What stands in a law's row of a table."""
    rows = [row.replace('*', '').split(' | ') for row in table.splitlines()]
    return next(row for row in rows if f'`{law}`' in row[0])


def test_readme_says_what_the_laws_do_on_the_rectangle() -> None:
    cases = [
        numbers.Case('minimum_velocity'),
        numbers.Case('minimum_acceleration'),
        numbers.Case('minimum_velocity', limits=numbers.LIMITS),
    ]
    results = {case: numbers.result(case) for case in cases}
    assert not differences(on_page(0, 'headline'), numbers.headline(results))
    # A row of each table, which has the same runs.
    effort = results[cases[1]].effort
    row = cells(on_page(1, 'efforts'), cases[1].law)
    assert not differences(row[2], f'{effort.acceleration:.3g}')
    assert not differences(row[7].rstrip(' |'), f'{effort.elbow:.3g}')


def test_every_law_and_damping_has_its_place() -> None:
    rows = on_page(1, 'efforts').splitlines()[2:]
    assert [row.split('`')[1] for row in rows] == list(numbers.LAWS)
    heads, _, *rows = on_page(1, 'dampings').splitlines()
    assert [float(cell) for cell in heads.split('|')[2:-1]] == list(numbers.DAMPINGS)
    assert len(rows) == 3


def test_the_tables_of_the_study_are_those_of_its_results() -> None:
    pytest.importorskip('pyarrow')
    import make_evidence as evidence

    short = evidence.read_results(evidence.STUDIES / 'laws.parquet')
    long = evidence.read_results(evidence.STUDIES / 'long.parquet')
    assert on_page(1, 'evidence_sample') == evidence.sample(short, long)
    ahead = evidence.read_results(evidence.STUDIES / 'ahead.parquet')
    assert not differences(on_page(1, 'evidence_ahead'), evidence.ahead_table(ahead))
    assert not differences(on_page(1, 'evidence_long'), evidence.long_table(long))
