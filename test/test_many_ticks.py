"""The proof of the limits by numbers, small; benchmarks/many_ticks.py makes it large."""

import sys
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).parents[1] / 'benchmarks'))

import many_ticks

pytestmark = pytest.mark.nightly


def test_many_random_and_hostile_ticks_have_no_fault(capsys: pytest.CaptureFixture[str]) -> None:
    assert many_ticks.main(['--count', '1000']) == 0
    assert 'faults: none' in capsys.readouterr().out


def test_a_command_outside_its_box_is_a_fault(monkeypatch: pytest.MonkeyPatch) -> None:
    stopping_speed = many_ticks.stopping_speed
    monkeypatch.setattr(many_ticks, 'stopping_speed', lambda *now: 0.5 * stopping_speed(*now))
    assert many_ticks.try_ticks(1000, seed=0)['outside the box'] > 0
