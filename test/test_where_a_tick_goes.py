"""The script that times the pieces of a tick."""

import sys
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).parents[1] / 'benchmarks'))

import where_a_tick_goes


def test_every_piece_is_timed(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(sys, 'argv', ['where_a_tick_goes.py', '--calls', '1'])
    where_a_tick_goes.main()
    _, _, *rows = capsys.readouterr().out.splitlines()
    times = {row.split('|')[1].strip(): float(row.split('|')[2].split()[0]) for row in rows}
    assert len(times) > 15
    assert min(times.values()) > 0.0
