"""The scripts that time the pieces of a tick, and its slow ones."""

import sys
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).parents[1] / 'benchmarks'))

import slow_ticks
import where_a_tick_goes

from redres_ros import RobotModel
from redres_ros.bench.tick import controllers, recorded

pytestmark = pytest.mark.nightly


def test_every_piece_is_timed(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(sys, 'argv', ['where_a_tick_goes.py', '--calls', '1'])
    where_a_tick_goes.main()
    _, _, *rows = capsys.readouterr().out.splitlines()
    times = {row.split('|')[1].strip(): float(row.split('|')[2].split()[0]) for row in rows}
    assert min(times.values()) > 0.0


def test_ticks_that_come_again_and_again_take_their_least_time(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], model: RobotModel
) -> None:
    monkeypatch.setattr(sys, 'argv', ['slow_ticks.py', '--rounds', '2'])
    monkeypatch.setattr(slow_ticks, 'recorded', lambda model: recorded(model, 5))
    slow_ticks.main()
    _, _, *rows = capsys.readouterr().out.splitlines()
    times = {row.split('|')[1].strip(): [float(x) for x in row.split('|')[2:8]] for row in rows}
    assert times.keys() == controllers(model).keys()
    for median, _, worst, least_median, _, least_worst in times.values():
        assert 0.0 < least_median <= median
        assert least_worst <= worst
