"""ProgressMonitor: what counts as progress, and for how long there is none."""

import pytest

from redres_ros.planning.progress import ProgressMonitor


def enter(monitor: ProgressMonitor, seconds: float, left: float) -> bool:
    """Steps of 0.1 s in which nothing changes; whether the motion is given up."""
    given_up = [monitor.enter(0.1, 1, left, 0.1) for _ in range(round(seconds / 0.1))]
    return any(given_up)


def test_a_motion_that_stands_is_stuck_and_then_hopeless() -> None:
    monitor = ProgressMonitor()
    assert not enter(monitor, 4.9, left=2.0)
    assert not monitor.remark
    assert not enter(monitor, 0.3, left=2.0)
    assert 'for 5 s' in monitor.remark
    assert enter(monitor, 25.0, left=2.0)
    assert 'for 30 s' in monitor.remark


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
    monitor = ProgressMonitor()
    for second in range(20):
        monitor.enter(1.0, 1, left[0] + left[1] * second, error[0] * error[1] ** second)
    assert bool(monitor.remark) is is_stuck


def test_the_next_segment_is_progress() -> None:
    monitor = ProgressMonitor()
    enter(monitor, 6.0, left=0.0)
    monitor.enter(0.1, 2, 3.0, 0.1)
    assert not monitor.remark
