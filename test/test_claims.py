"""The claims of the paper: what is measured can also come out otherwise."""

import csv
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from redres_ros.cli import main
from redres_ros.errors import FileError
from redres_ros.paper import claims, figures
from redres_ros.paper.claim import Claim, Finding, write_csv
from redres_ros.paper.claims import CLAIMS
from redres_ros.paper.runs import Runs

GOOD = Claim('1', 'One', lambda _: Finding(True, 'a = 1'))
BAD = Claim('2', 'Two', lambda _: Finding(False, 'b = 2', 'because'))
WRITTEN = ['section,claim,held,measured,remark', '1,One,yes,a = 1,', '2,Two,no,b = 2,because']


def test_the_lengths_of_the_arm_are_those_that_fit_the_paper() -> None:
    found = claims._geometry.measure(Runs())
    assert found.held, found.measured


@pytest.mark.parametrize(('apart', 'held'), [(0.9e-9, True), (1.1e-9, False)])
def test_a_law_that_is_not_its_scheme_is_found_out(apart: float, held: bool) -> None:
    law, scheme = (SimpleNamespace(vectors=lambda _, x=x: np.full((1, 1), x)) for x in (0.0, apart))
    assert claims._same_motion({'law': law, 'scheme': scheme}, 'law', 'scheme').held == held


def test_the_page_lists_each_claim_once_with_what_was_measured() -> None:
    page = Path(__file__).resolve().parents[1] / 'docs' / 'claims.csv'
    with page.open(encoding='utf-8', newline='') as file:
        rows = list(csv.DictReader(file))
    assert [row['claim'] for row in rows] == [claim.says for claim in CLAIMS]
    assert all(row['section'] and row['measured'] for row in rows)


def test_a_file_that_cannot_be_written_is_named() -> None:
    with pytest.raises(FileError, match='cannot write'):
        write_csv({}, Path('/dev/null/claims.csv'))


def test_the_command_draws_measures_and_writes(tmp_path, monkeypatch, capsys):
    drawn: list[Path] = []
    monkeypatch.setattr(Runs, 'prepare', lambda self, progress: None)
    monkeypatch.setattr(figures, 'draw_all', lambda out, progress, runs: drawn.append(out))
    monkeypatch.setattr(claims, 'CLAIMS', (GOOD, BAD))
    assert main(['reproduce', '--out', str(tmp_path)]) == 0
    assert drawn == [tmp_path]
    shown = ' '.join(capsys.readouterr().out.split())
    assert 'NOT HELD' in shown
    assert '1 of 2 claims held' in shown
    assert (tmp_path / 'claims.csv').read_text().splitlines() == WRITTEN
