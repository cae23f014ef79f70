"""ProgressMonitor: what counts as progress, and for how long there is none."""

import numpy as np

from redres_ros.planning.progress import ProgressMonitor, Standstill


def monitor() -> ProgressMonitor:
    return ProgressMonitor(stuck_after=5.0, give_up_after=30.0)


def enter(watched: ProgressMonitor, seconds: float, left: float, error: float = 0.1) -> None:
    """Steps of 0.1 s in which nothing changes."""
    for _ in range(round(seconds / 0.1)):
        watched.enter(0.1, 1, left, error)


def test_a_motion_that_stands_is_stuck_and_then_hopeless() -> None:
    watched = monitor()
    enter(watched, 4.9, left=2.0)
    assert not watched.is_stuck
    enter(watched, 0.3, left=2.0)
    assert watched.is_stuck
    enter(watched, 25.0, left=2.0)
    assert watched.is_hopeless


def test_a_slow_motion_is_no_standstill() -> None:
    watched = monitor()
    for step in range(1000):
        watched.enter(0.1, 1, 10.0 - 0.002 * step, 0.1)
    assert not watched.is_stuck


def test_time_that_passes_without_an_error_that_shrinks_is_no_progress() -> None:
    watched = monitor()
    enter(watched, 4.0, left=0.0)
    enter(watched, 4.0, left=0.0, error=0.099)
    assert watched.is_stuck


def test_an_error_that_shrinks_after_the_time_is_progress() -> None:
    watched = monitor()
    for step in range(20):
        enter(watched, 1.0, left=0.0, error=0.9**step)
    assert not watched.is_stuck


def test_the_next_segment_is_progress() -> None:
    watched = monitor()
    enter(watched, 6.0, left=0.0)
    watched.enter(0.1, 2, 3.0, 0.1)
    assert not watched.is_stuck


def test_a_tip_that_is_asked_to_move_and_does_not_is_at_a_standstill() -> None:
    standstill = Standstill()
    found = []
    for k in range(400):
        moves = k < 200
        x = np.array((0.1 * 0.002 * min(k, 200), 0.0, 0.0))  # at 0.1 m/s, then at rest
        found.append((moves, standstill.enter(k * 2_000_000, x, 0.1)))
    assert not any(rests for moves, rests in found if moves)
    assert all(rests for _, rests in found[300:])


def test_a_pause_of_the_states_is_no_standstill() -> None:
    standstill = Standstill()
    x = np.zeros(3)
    assert not standstill.enter(10**9, x, 0.1)
    assert not standstill.enter(5 * 10**9, x, 0.1)
