"""Task velocities played out: in time, late, missing, seldom, sudden."""

import numpy as np
import pytest

from redres_ros.geometry import quintic
from redres_ros.loop.velocity_input import ANGULAR_ACCELERATION, LINEAR_ACCELERATION, _TwistBuffer

T = 0.002  # [s]
A = LINEAR_ACCELERATION


def along(cycle: int) -> np.ndarray:
    """The velocity of a quintic segment of 0.5 m in 3 s, (3,) [m/s]."""
    return np.array((0.5, 0.0, 0.0)) / 3.0 * quintic(cycle * T / 3.0)[1]


def played(arrivals: dict[int, list[int]], ticks: int, lag: int = 1) -> np.ndarray:
    """What is played, (ticks, 3), when task velocities of cycles come before a tick, as by
    arrivals.
    """
    twist_buffer = _TwistBuffer(3, T, lag)
    out = []
    for tick in range(ticks):
        for cycle in arrivals.get(tick, ()):
            twist_buffer.put(cycle, along(cycle))
        out.append(twist_buffer.play(tick))
    return np.array(out)


def peak_acceleration(out: np.ndarray) -> float:
    return float(np.linalg.norm(np.diff(out, axis=0), axis=1).max()) / T


PERFECT = np.array([along(max(k - 1, 0)) for k in range(1500)])
PEAK = peak_acceleration(PERFECT)


def test_within_the_lag_it_does_not_matter_when_task_velocities_come() -> None:
    random = np.random.default_rng(0)
    arrivals: dict[int, list[int]] = {}
    for k in range(1500):
        arrivals.setdefault(k + int(random.integers(0, 4)), []).append(k)
    for cycles in arrivals.values():
        random.shuffle(cycles)
    out = played(arrivals, 1500, lag=3)
    np.testing.assert_array_equal(out[3:], [along(k) for k in range(1497)])


def test_a_task_velocity_that_is_missing_now_and_then_hardly_shows() -> None:
    random = np.random.default_rng(1)
    out = played({k + 1: [k] for k in range(1500) if random.random() > 0.3}, 1500)
    # A straight line misses a quintic by its curvature, 60 d/T^3 T^2 / 2 a cycle squared: for gaps
    # of up to six cycles at most 36 times that.
    curvature = 60.0 * 0.5 / 3.0**3 * T * T
    np.testing.assert_allclose(out[5:], PERFECT[5:], rtol=0.0, atol=36 * curvature)
    assert peak_acceleration(out) < 1.1 * PEAK


@pytest.mark.parametrize('length', [10, 30, 50])
def test_a_planner_that_was_held_up_is_caught_up_with_smoothly(length: int) -> None:
    gaps = [range(start, start + length) for start in range(200, 1300, 250)]
    arrivals = {k + 1: [k] for k in range(1500) if not any(k in gap for gap in gaps)}
    out = played(arrivals, 1500)
    assert peak_acceleration(out) < 1.3 * PEAK
    np.testing.assert_array_equal(out[1460:], PERFECT[1460:])


def test_task_velocities_that_come_late_count_as_late_and_their_cycles_as_missing() -> None:
    twist_buffer = _TwistBuffer(3, T, 1)
    for tick in range(1, 100):
        late = 40 <= tick < 60
        if not late:
            twist_buffer.put(tick - 1, along(tick - 1))
        twist_buffer.play(tick)
        if late:
            twist_buffer.put(tick - 1, along(tick - 1))
    assert twist_buffer.missing == 20
    assert twist_buffer.late == 20


@pytest.mark.parametrize('every', [10, 17, 50])
def test_a_source_that_sends_seldom_is_followed_smoothly(every: int) -> None:
    random = np.random.default_rng(2)
    arrivals = {}
    tick = 0
    while tick < 1500:
        arrivals[tick + 1] = [tick]
        tick += every + int(random.integers(-2, 3))
    out = played(arrivals, 1500)
    # By intervals that differ by a fifth, an even slope is ridden at most a third too fast.
    assert peak_acceleration(out) < 1.5 * PEAK
    lag = np.linalg.norm(out - PERFECT, axis=1).max()
    assert lag < 2.5 * (every + 2) * T * PEAK  # two intervals behind


@pytest.mark.parametrize('rows', [3, 6])
def test_a_sudden_velocity_is_approached_with_the_largest_acceleration(rows: int) -> None:
    twist_buffer = _TwistBuffer(rows, T, 1)
    dx = np.full(rows, 0.3)
    out = []
    for tick in range(900):
        if tick >= 50:
            twist_buffer.put(tick, dx if tick < 400 else -dx)
        out.append(twist_buffer.play(tick))
    steps = np.diff(np.array(out), axis=0) / T
    linear = np.linalg.norm(steps[:, :3], axis=1).max()
    assert linear <= A * (1.0 + 1e-9)
    largest = linear / A
    if rows == 6:
        angular = np.linalg.norm(steps[:, 3:], axis=1).max() / ANGULAR_ACCELERATION
        assert angular <= 1.0 + 1e-9
        largest = max(largest, angular)
    assert largest > 0.95
    np.testing.assert_allclose(out[400], dx, atol=1e-12)
    np.testing.assert_allclose(out[-1], -dx, rtol=0.0, atol=1e-12)


@pytest.mark.slow
@pytest.mark.parametrize('spread', [0, 5, 50])
def test_whatever_stamps_task_velocities_have_the_largest_acceleration_is_kept_twice_at_most(
    spread: int,
) -> None:
    for seed in range(40):
        random = np.random.default_rng(seed)
        twist_buffer = _TwistBuffer(3, T, int(random.integers(0, 4)))
        before = np.zeros(3)
        cycle = 0
        for _ in range(300):
            cycles = 1 if random.random() < 0.9 else int(random.integers(2, 6))
            cycle += cycles
            for _ in range(random.integers(0, 4)):
                stamped = cycle + int(random.integers(-spread, spread + 1))
                twist_buffer.put(max(stamped, 0), random.normal(0.0, random.choice((0.01, 1.0)), 3))
            out = twist_buffer.play(cycle)
            # The way back to a line that itself rises as steeply as that.
            assert np.linalg.norm(out - before) <= 2.0 * A * T * cycles * (1.0 + 1e-9)
            before = out
