"""The experiment without ROS: what the paper's robot did, in time with the fake robot's clock, the
same every time.
"""

from dataclasses import replace

import numpy as np
import pytest
from doubles import LateArm

from redres_ros import Controller, RobotModel, load_task, make_law
from redres_ros.errors import ArrayError
from redres_ros.paper.experiment import AFTERMATH, Experiment, differentiate, experiment
from redres_ros.simulation.closed_loop import run

pytestmark = pytest.mark.slow

T = 0.002  # [s]
TASK = load_task('rectangle')
MODEL = RobotModel.named(TASK.robot, dynamics='identified')
# Half of the first segment: long enough to move, short enough for a test.
SHORT = replace(
    TASK, waypoints=np.array((TASK.waypoints[0], TASK.waypoints[:2].mean(axis=0))), segment_time=1.5
)


def controller(law: str) -> Controller:
    return Controller(MODEL, make_law(law, damping=5.0), T, switch_time=0.2)


@pytest.fixture(scope='module')
def stopped() -> Experiment:
    return experiment(controller('minimum_velocity'), TASK)


@pytest.fixture(scope='module')
def finished() -> Experiment:
    return experiment(controller('minimum_acceleration'), TASK)


def test_the_robot_stops_the_law_of_least_velocity_after_seven_seconds(stopped):
    assert not stopped.finished
    assert stopped.stop_reason.startswith('protective stop')
    assert 7.0 < stopped['t'][-1] < 9.0
    assert stopped.stop_reason in stopped.ending


def test_the_law_of_least_acceleration_finishes_within_a_millimetre(finished):
    assert finished.finished
    assert not finished.stop_reason
    assert np.linalg.norm(MODEL.tip(finished.q[-1])[0] - TASK.waypoints[-1]) < 0.001


def test_a_stopped_arm_comes_to_rest_and_is_watched_doing_so(stopped):
    assert len(stopped.q) == len(stopped.data) + round(AFTERMATH / T)
    assert np.abs(stopped.q[-1] - stopped.q[-50]).max() < 1e-6


def test_no_joint_exceeds_its_speed_limit_though_the_command_does(finished):
    limit = MODEL.dq_max
    assert (np.abs(finished.vectors('dq1')) > limit).any()
    # The arm behind its servos may be faster than its reference by what they make up for.
    assert (np.abs(np.diff(finished.q, axis=0) / T) < 1.02 * limit).all()


def test_the_arm_moves_as_an_ideal_one_that_uses_each_command_a_tick_late():
    real = experiment(controller('minimum_acceleration'), SHORT)
    ideal = run(controller('minimum_acceleration'), SHORT, plant=LateArm(SHORT.start))
    ticks = min(len(real.data), len(ideal.data))
    apart = np.abs(real.vectors('q1')[:ticks] - ideal.vectors('q1')[:ticks]).max()
    # [rad]; a tick is 2e-3 at the joints' speed of 0.9 rad/s, of which feedback takes up a part
    assert apart < 2e-4


def test_a_polynomial_of_fifth_degree_is_differentiated_exactly():
    polynomial = np.polynomial.Polynomial(np.random.default_rng(0).uniform(-1.0, 1.0, 6))
    t = T * np.arange(1000) - 1.0  # [s]
    motion = differentiate(polynomial(t)[:, None], T)
    inner = slice(200, -200)  # half a window is left out at either end
    assert motion.t == pytest.approx(t[inner] + 1.0)
    assert (motion.q[:, 0] == polynomial(t)[inner]).all()
    # scipy fits the window's powers, up to 200^5, as they are: its coefficients have about eight
    # good digits.
    assert motion.dq[:, 0] == pytest.approx(polynomial.deriv(1)(t)[inner], abs=1e-6)
    assert motion.ddq[:, 0] == pytest.approx(polynomial.deriv(2)(t)[inner], abs=1e-6)


def test_too_few_samples_for_the_window_are_an_error():
    with pytest.raises(ArrayError, match='400 positions'):
        differentiate(np.zeros((400, 7)), T)
    assert differentiate(np.zeros((401, 7)), T).dq.shape == (1, 7)
