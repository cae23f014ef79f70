"""The claims of the paper: what is measured can also come out otherwise."""

import csv
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from redres_ros.cli import main
from redres_ros.errors import FileError
from redres_ros.paper import claims, figures
from redres_ros.paper.claims import (
    CLAIMS,
    Claim,
    Finding,
    assumptions,
    check_all,
    damping,
    table,
    theoretical,
    write_csv,
)
from redres_ros.paper.claims.claim import ROUNDING
from redres_ros.paper.contact import claims as contact
from redres_ros.paper.contact.pushed import IMPEDANCE, by_velocity, pushed_tip
from redres_ros.paper.contact.second_order import by_scheme
from redres_ros.paper.runs import Runs
from redres_ros.paper.saturation import LWR_DAMPED, angle_between, run_benchmark

pytestmark = pytest.mark.slow


@pytest.fixture(scope='module')
def runs() -> Runs:
    return Runs()


CHEAP = (
    theoretical.square_task,
    theoretical.two_forms,
    theoretical.special_case_35,
    theoretical.optimality,
    damping.resting_place,
    damping.regimes,
    theoretical.damped_variation,
    theoretical.several_tasks,
    theoretical.unneeded_joint,
    damping.stops_at_once,
    assumptions.geometry,
)


@pytest.mark.parametrize('claim', CHEAP, ids=lambda claim: claim.measure.__name__)
def test_what_is_proved_in_the_paper_holds(runs: Runs, claim: Claim) -> None:
    finding = claim.measure(runs)
    assert finding.held, finding.measured


def test_a_law_that_is_not_optimal_is_found_out(
    runs: Runs, monkeypatch: pytest.MonkeyPatch
) -> None:
    resolve = theoretical.resolve

    def spoiled(*arguments: np.ndarray) -> np.ndarray:
        return resolve(*arguments) + 1e-6

    monkeypatch.setattr(theoretical, 'resolve', spoiled)
    assert not theoretical.optimality.measure(runs).held


def test_every_claim_names_its_place_in_the_paper_and_is_measured_once() -> None:
    assert all(claim.section and claim.says for claim in CLAIMS)
    assert len({claim.measure for claim in CLAIMS}) == len(CLAIMS)


def test_the_page_lists_only_claims_that_exist() -> None:
    page = Path(__file__).resolve().parents[1] / 'docs' / 'claims.csv'
    with page.open(encoding='utf-8', newline='') as file:
        rows = list(csv.DictReader(file))
    assert {row['claim'] for row in rows} <= {claim.says for claim in CLAIMS}
    assert all(row['measured'] for row in rows)


def test_findings_are_shown_and_written_whole(tmp_path: Path) -> None:
    good = Claim('1', 'One', lambda _: Finding(True, 'a = 1'))
    bad = Claim('2', 'Two', lambda _: Finding(False, 'b = 2', 'because'))
    shares: list[float] = []
    findings = check_all((good, bad), None, shares.append)
    assert shares[-1] == 1.0
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


def test_the_command_measures_contact_alone(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    few = (contact.keeps_limits,)
    monkeypatch.setattr(contact, 'CONTACT_CLAIMS', few)
    assert main(['reproduce', 'contact', '--out', str(tmp_path)]) == 0
    assert 'contact: 1 of 1 claims held' in capsys.readouterr().out
    assert len((tmp_path / 'contact.csv').read_text().splitlines()) == 2


@pytest.mark.parametrize('law', ['minimum_acceleration', 'dynamically_consistent'])
def test_the_admittance_is_the_impedance_of_second_order_to_rounding(law: str) -> None:
    finding = contact.same_as_scheme(law)
    assert finding.held, finding.measured


def test_a_wrong_admittance_is_found_out() -> None:
    wrong = replace(IMPEDANCE, mass=(5.0, 5.001, 5.0))
    one = by_velocity('minimum_acceleration', wrong, pushed_tip)
    two = by_scheme('minimum_acceleration', IMPEDANCE, pushed_tip)
    assert np.abs(one.dq - two.dq).max() > ROUNDING


@pytest.mark.parametrize('claim', [contact.reactions, contact.keeps_limits])
def test_what_is_promised_about_contact_holds(runs: Runs, claim: Claim) -> None:
    finding = claim.measure(runs)
    assert finding.held, finding.measured


def test_the_page_lists_every_claim_about_contact() -> None:
    page = Path(__file__).resolve().parents[1] / 'docs' / 'contact.csv'
    with page.open(encoding='utf-8', newline='') as file:
        rows = list(csv.DictReader(file))
    assert [row['claim'] for row in rows] == [claim.says for claim in contact.CONTACT_CLAIMS]


def test_a_motion_of_others_is_as_fast_here_and_straighter() -> None:
    ours = run_benchmark(LWR_DAMPED)
    assert ours.seconds == pytest.approx(LWR_DAMPED.seconds, rel=0.01)
    assert ours.heading_error < 0.1 * LWR_DAMPED.heading_error
    assert ours.limit_usage < 1.0 + 1e-9


def test_angles_are_exact_for_small_and_large_ones() -> None:
    x = np.array((1.0, 0.0))
    for angle in (1e-12, 0.3, 3.0):
        turned = 2.0 * np.array((np.cos(angle), np.sin(angle)))
        assert angle_between(x, turned) == pytest.approx(angle, rel=1e-9)
