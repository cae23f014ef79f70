"""The second picture of `redres compare`: how much of the limits motions use."""

import numpy as np
import pytest

from redres_ros.robot_model import RobotModel
from redres_ros.simulation.comparison import draw_limit_usage
from redres_ros.simulation.effort import acceleration_usage, velocity_usage
from redres_ros.simulation.recording import Recording, columns

T = 0.01  # [s]


def speeding_up(model: RobotModel) -> Recording:
    """Joint 2 gains a fifth of its velocity limit in every one of ten ticks."""
    names = columns(model.n)
    data = np.zeros((10, len(names)))
    data[:, names.index('t')] = T * np.arange(10)
    data[:, names.index('dq2')] = -0.2 * model.dq_max[1] * np.arange(1, 11)
    data[:, names.index('task_scaling')] = 1.0
    return Recording(data, model.n, T, finished=True, ending='')


def test_limit_usage_are_those_of_the_joint_nearest_to_its_limit(model: RobotModel) -> None:
    recording = speeding_up(model)
    assert velocity_usage(recording, model) == pytest.approx(0.2 * np.arange(1, 11))
    gained = 0.2 * model.dq_max[1] / T
    usage = gained / model.arm.acceleration_limit[1]
    assert acceleration_usage(recording, model) == pytest.approx(np.full(10, usage))


def test_the_picture_reports_what_is_allowed_and_what_goes_beyond_it(model: RobotModel) -> None:
    recording = speeding_up(model)
    recording.data[-1, recording.columns.index('dq2')] *= 10.0
    figure = draw_limit_usage({'a law': recording}, model, 0.5, 'title')
    velocity, acceleration, scaling = figure.axes
    assert velocity.get_lines()[-1].get_ydata()[0] == 0.5
    assert '(up to 20)' in velocity.get_ylabel()
    assert '(up to' in acceleration.get_ylabel()
    assert scaling.get_lines()[0].get_ydata() == pytest.approx(np.ones(10))
