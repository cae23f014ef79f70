"""The fake robot's clock on a computer that stalls: stamps and latencies."""

import numpy as np
import pytest

from redres_ros.fake_robot import robot_clock
from redres_ros.fake_robot.robot_clock import NANOSECONDS, RobotClock

PERIOD = 2_000_000  # [ns]
T = PERIOD / NANOSECONDS  # [s]
EPOCH = 1_700_000_000 * NANOSECONDS  # [ns]


class Computer:
    """A monotonic clock that goes on while somebody sleeps, or stalls."""

    def __init__(self) -> None:
        self.now = 1000.0  # [s]

    def monotonic(self) -> float:
        return self.now

    def sleep(self, seconds: float) -> None:
        self.now += seconds


@pytest.fixture
def computer(monkeypatch: pytest.MonkeyPatch) -> Computer:
    computer = Computer()
    monkeypatch.setattr(robot_clock, 'time', computer)
    return computer


@pytest.fixture
def clock(computer: Computer) -> RobotClock:
    return RobotClock(EPOCH, PERIOD)


def run(clock: RobotClock, computer: Computer, first: int, cycles: int) -> np.ndarray:
    """Stamp [s after the epoch] and time [s after the start] of every tick, (cycles, 2)."""
    rows = []
    for tick in range(first, first + cycles):
        rows.append(((clock.send(tick) - EPOCH) / NANOSECONDS, computer.now - 1000.0))
        clock.wait(computer.sleep)
    return np.array(rows)


def test_without_a_stall_stamps_are_the_computers_time(clock, computer):
    rows = run(clock, computer, 0, 1000)
    np.testing.assert_allclose(rows[:, 0], rows[:, 1], rtol=0.0, atol=1e-9)
    assert clock.stood_still == 0.0


@pytest.mark.parametrize('stall', [0.01, 2.0])
def test_after_a_stall_stamps_go_on_one_period_apart(clock, computer, stall):
    run(clock, computer, 0, 100)
    computer.sleep(stall)
    rows = run(clock, computer, 100, 100)
    assert np.diff(rows[:, 0]) == pytest.approx(T, abs=1e-9)
    assert np.diff(rows[1:, 1]) == pytest.approx(T, abs=1e-9)
    assert clock.stood_still == pytest.approx(stall, abs=2.0 * T)
    assert rows[-1, 1] - rows[-1, 0] == pytest.approx(clock.stood_still)


def test_only_the_stamp_of_a_state_that_went_out_has_a_tick(clock):
    stamps = [clock.send(tick) for tick in range(1000)]
    assert clock.tick(stamps[-1]) == 999
    assert clock.tick(stamps[-1] + 1) is None
    assert clock.tick(EPOCH + 1000 * PERIOD) is None
    assert clock.tick(stamps[0]) is None  # long ago
    assert [clock.tick(stamp) for stamp in stamps[-150:]] == list(range(850, 1000))


def test_latencies_do_not_count_what_the_clock_stood_still(clock, computer):
    stamp = clock.send(0)
    computer.sleep(0.0005)
    assert clock.latency(stamp, computer.now) == pytest.approx(0.0005)
    clock.wait(computer.sleep)
    computer.sleep(0.3)
    clock.stand_still()
    assert clock.latency(stamp, computer.now) == pytest.approx(T, abs=1e-9)
    assert clock.latency(stamp, computer.now - 0.3) == 0.0  # came before the pause was over
