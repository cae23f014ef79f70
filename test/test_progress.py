"""ProgressMonitor: what counts as progress, and for how long there is none."""

import numpy as np
import pytest

from redres_ros.planning.progress import ProgressMonitor, Standstill


def enter(watched: ProgressMonitor, seconds: float, left: float, error: float = 0.1) -> None:
    """Steps of 0.1 s in which nothing changes."""
    for _ in range(round(seconds / 0.1)):
        watched.enter(0.1, 1, left, error)


def test_a_motion_that_stands_is_stuck_and_then_hopeless() -> None:
    watched = ProgressMonitor()
    enter(watched, 4.9, left=2.0)
    assert not watched.remark
    enter(watched, 0.3, left=2.0)
    assert watched.remark and not watched.is_hopeless
    enter(watched, 25.0, left=2.0)
    assert watched.is_hopeless


@pytest.mark.parametrize(
    ('left', 'error', 'is_stuck'),
    [
        ((10.0, -0.02), (0.1, 1.0), False),  # time of the segment goes on, slowly
        ((0.0, 0.0), (0.1, 0.9), False),  # an error that shrinks afterwards
        ((0.0, 0.0), (0.1, 0.9999), True),
        ((2.0, 0.0), (0.1, 0.9), True),  # an error says nothing before the time is over
    ],
)
def test_progress_is_time_and_afterwards_a_smaller_error(left, error, is_stuck) -> None:
    watched = ProgressMonitor()
    for second in range(20):
        enter(watched, 1.0, left[0] + left[1] * second, error[0] * error[1] ** second)
    assert bool(watched.remark) is is_stuck


def test_the_next_segment_is_progress() -> None:
    watched = ProgressMonitor()
    enter(watched, 6.0, left=0.0)
    watched.enter(0.1, 2, 3.0, 0.1)
    assert not watched.remark


def test_a_tip_that_is_asked_to_move_and_does_not_is_at_a_standstill() -> None:
    standstill = Standstill()
    found = []
    for k in range(400):
        x = np.array((0.1 * 0.002 * min(k, 200), 0.0, 0.0))  # at 0.1 m/s, then at rest
        found.append(standstill.enter(k * 2_000_000, x, 0.1))
    assert not any(found[:200])
    assert all(found[300:])


def test_a_pause_of_the_states_is_no_standstill() -> None:
    standstill = Standstill()
    x = np.zeros(3)
    assert not standstill.enter(10**9, x, 0.1)
    assert not standstill.enter(5 * 10**9, x, 0.1)
