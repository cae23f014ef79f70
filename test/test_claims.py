"""The claims of the paper: what is measured can also come out otherwise."""

import csv
from pathlib import Path

import numpy as np
import pytest

from redres_ros.cli import main
from redres_ros.errors import FileError
from redres_ros.paper import claims, figures, theory
from redres_ros.paper.claim import Claim, Finding, table, write_csv
from redres_ros.paper.claims import CLAIMS
from redres_ros.paper.runs import Runs

pytestmark = pytest.mark.slow

CHEAP = (
    theory._square_task,
    theory._two_forms,
    theory._special_case_35,
    theory._optimality,
    theory._resting_place,
    theory._regimes,
    theory._damped_variation,
    theory._several_tasks,
    theory._unneeded_joint,
    theory._stops_at_once,
    claims._geometry,
)


@pytest.fixture(scope='module')
def runs() -> Runs:
    return Runs()


@pytest.mark.parametrize('claim', CHEAP, ids=lambda claim: claim.measure.__name__)
def test_what_is_proved_in_the_paper_holds(runs: Runs, claim: Claim) -> None:
    finding = claim.measure(runs)
    assert finding.held, finding.measured


def test_a_law_that_is_not_optimal_is_found_out(
    runs: Runs, monkeypatch: pytest.MonkeyPatch
) -> None:
    resolve = theory.resolve

    def spoiled(*arguments: np.ndarray) -> np.ndarray:
        return resolve(*arguments) + 1e-6

    monkeypatch.setattr(theory, 'resolve', spoiled)
    assert not theory._optimality.measure(runs).held


def test_the_page_lists_each_claim_once_with_what_was_measured() -> None:
    page = Path(__file__).resolve().parents[1] / 'docs' / 'claims.csv'
    with page.open(encoding='utf-8', newline='') as file:
        rows = list(csv.DictReader(file))
    assert [row['claim'] for row in rows] == [claim.says for claim in CLAIMS]
    assert all(row['section'] and row['measured'] for row in rows)


def test_findings_are_shown_and_written_whole(tmp_path: Path) -> None:
    good = Claim('1', 'One', lambda _: Finding(True, 'a = 1'))
    bad = Claim('2', 'Two', lambda _: Finding(False, 'b = 2', 'because'))
    findings = {good: good.measure(None), bad: bad.measure(None)}
    shown = table(findings)
    assert 'NOT HELD' in shown
    assert '1 of 2 claims held' in shown
    write_csv(findings, tmp_path / 'claims.csv')
    assert (tmp_path / 'claims.csv').read_text().splitlines() == [
        'section,claim,held,measured,remark',
        '1,One,yes,a = 1,',
        '2,Two,no,b = 2,because',
    ]
    with pytest.raises(FileError, match='cannot write'):
        write_csv(findings, Path('/dev/null/claims.csv'))


def test_the_command_draws_measures_and_writes(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    drawn: list[Path] = []
    monkeypatch.setattr(Runs, 'prepare', lambda self, progress: None)
    monkeypatch.setattr(figures, 'draw_all', lambda out, progress, runs: drawn.append(out))
    few = CHEAP[3:6]
    monkeypatch.setattr(claims, 'CLAIMS', few)
    assert main(['reproduce', '--out', str(tmp_path)]) == 0
    assert drawn == [tmp_path]
    assert f'{len(few)} of {len(few)} claims held' in capsys.readouterr().out
    assert len((tmp_path / 'claims.csv').read_text().splitlines()) == 1 + len(few)
