"""The speed of a path: braked where limits act, and resumed slowly."""

from dataclasses import replace

import numpy as np
import pytest

from redres_ros import Controller, RobotModel, load_task, run
from redres_ros.planning.task_clock import FALL, RESUME, PathSpeed

T = 0.002  # [s]
ROUNDING = 1e-9


def test_the_speed_falls_with_what_is_executed_and_not_suddenly() -> None:
    speed = PathSpeed()
    speed.advance(0.999, T)
    assert speed.fraction == 0.999
    speed.advance(0.1, T)
    assert speed.fraction == pytest.approx(0.999 - FALL * T)


def test_the_speed_rises_again_with_a_limited_acceleration() -> None:
    """From half the speed the rest takes sqrt(2 0.5 / RESUME)."""
    speed = PathSpeed()
    while speed.fraction > 0.5:
        speed.advance(0.5, T)  # limits act
    fractions = [speed.fraction]
    while fractions[-1] < 1.0:
        speed.advance(1.0, T)
        fractions.append(speed.fraction)
    assert len(fractions) * T == pytest.approx(np.sqrt(1.0 / RESUME), abs=3 * T)
    assert np.diff(fractions, 2).max() < RESUME * T * T + ROUNDING


@pytest.mark.slow
def test_where_limits_act_joints_reverse_less_and_the_task_takes_no_longer() -> None:
    """Least acceleration at 0.4 of the limits, to the stretched arm and back."""
    task = load_task('rectangle')
    task = replace(task, waypoints=np.vstack((task.waypoints, task.waypoints[2::-1])))
    model = RobotModel.named(task.robot)
    period = 0.004  # [s]
    allowed = 0.4 * np.array(model.arm.acceleration_limit)

    def motion(greedy: bool) -> tuple[int, float]:
        """Ticks with a joint at its full acceleration, and the duration [s]."""
        controller = Controller(
            model,
            'minimum_acceleration',
            period,
            limits=('position', 'velocity', 'acceleration'),
            limit_scale=0.4,
        )
        recording = run(controller, task, greedy=greedy)
        assert recording.finished
        assert recording['task_error'].max() < 5e-4
        ddq = np.diff(recording.vectors('dq1'), axis=0) / period
        return int((np.abs(ddq) > 0.99 * allowed).any(axis=1).sum()), recording['t'][-1]

    greedy_ticks, greedy_time = motion(greedy=True)
    ticks, time = motion(greedy=False)
    assert ticks < greedy_ticks / 2
    assert time < 1.02 * greedy_time
