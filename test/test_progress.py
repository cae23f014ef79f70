"""ProgressMonitor: what counts as progress, and for how long there is none."""

from redres_ros.planning.progress import ProgressMonitor


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
