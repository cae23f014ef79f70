"""The preferences. One that is added to the table PREFERENCES goes through every test of the first
part by itself.
"""

from dataclasses import replace
from typing import ClassVar

import numpy as np
import pytest

from redres_ros import (
    PREFERENCES,
    Controller,
    ElbowHeight,
    JointCentering,
    JointLimitAvoidance,
    Manipulability,
    Posture,
    Preference,
    RobotModel,
    RobotState,
    make_law,
    make_preference,
)
from redres_ros.errors import ArrayError, RangeError
from redres_ros.policy import make_policy

T = 0.002  # [s]
DX = np.array((0.0, -0.1, 0.0))  # [m/s]
EVERY_PREFERENCE = pytest.mark.parametrize('name', PREFERENCES)
STEP = 1e-5  # [rad]; rounding 1e-16 / STEP and the cubic term STEP^2 both stay below 1e-9


def begun(name: str, state: RobotState) -> Preference:
    """Of that name, with what is left open taken from another state nearby."""
    elsewhere = state.model.state(state.q + 0.1, state.dq_prev)
    return make_preference(name).with_initial_targets(elsewhere)


class NullSpaceTorque(Preference):
    """A torque of a user's own."""

    tau: ClassVar[np.ndarray] = np.array((3.0, -2.0, 1.0, 4.0, -0.5, 0.2, 0.1))  # [Nm]

    def acceleration(self, state: RobotState) -> np.ndarray:
        return np.linalg.solve(state.M, self.tau)


def test_a_torque_in_the_null_space_is_that_of_equation_32(states):
    policy = make_policy(
        states[0].model,
        make_law('dynamically_consistent', damping=0.0),
        preferences=(NullSpaceTorque(),),
    )
    for state in states[:10]:
        M_inverse = np.linalg.inv(state.M)
        J = state.J[:3]
        inverse = M_inverse @ J.T @ np.linalg.inv(J @ M_inverse @ J.T)  # J_M^#, Eq. (A.5)
        free = state.dq_prev + T * M_inverse @ (NullSpaceTorque.tau - state.n)
        expected = inverse @ DX + (np.eye(7) - inverse @ J) @ free  # Eq. (32)
        assert policy.solve(state, DX, T).dq == pytest.approx(expected, abs=1e-9)


@EVERY_PREFERENCE
def test_the_acceleration_grows_with_the_gain(name, states):
    for state in states[:10]:
        preference = begun(name, state)
        twice = replace(preference, gain=2.0 * preference.gain)
        once = preference.acceleration(state)
        assert once.shape == (7,)
        assert twice.acceleration(state) == pytest.approx(2.0 * once, rel=1e-12)


@EVERY_PREFERENCE
@pytest.mark.parametrize('gain', [-1.0, np.nan, np.inf])
def test_a_gain_outside_its_range_is_refused(name, gain):
    with pytest.raises(RangeError, match=f'gain is {gain}'):
        make_preference(name, gain=gain)


@EVERY_PREFERENCE
def test_the_task_is_executed_beside_a_preference(name, model, task):
    controller = Controller(model, make_law('minimum_acceleration'), T, preferences=(name,))
    q = task.start
    for _ in range(100):
        command = controller.update(q, DX)
        assert command.J @ command.dq == pytest.approx(DX, abs=1e-10)
        q = command.q_ref


def centering(model: RobotModel, q: np.ndarray) -> float:
    middle = (model.q_max + model.q_min) / 2.0
    return float(np.sum(((q - middle) / (model.q_max - model.q_min)) ** 2)) / (2.0 * len(q))


def dexterity(rows: int) -> object:
    def measure(model: RobotModel, q: np.ndarray) -> float:
        J = model.state(q, np.zeros(len(q))).J[:rows]
        return float(np.sqrt(np.linalg.det(J @ J.T)))

    return measure


def height(model: RobotModel, q: np.ndarray) -> float:
    return float(model.position(q, model.elbow_frame)[2])


def off_height(model: RobotModel, q: np.ndarray) -> float:
    return (height(model, q) - 0.5) ** 2 / 2.0


def off_posture(model: RobotModel, q: np.ndarray) -> float:
    return float(np.sum((q - 0.3) ** 2)) / 2.0


GRADIENTS = {
    'joint_centering': (JointCentering(gain=3.0), centering, -3.0),
    'posture': (Posture(gain=3.0, target=(0.3,) * 7), off_posture, -3.0),
    'manipulability': (Manipulability(gain=3.0), dexterity(3), 3.0),
    'manipulability of the pose': (Manipulability(gain=3.0, rows='pose'), dexterity(6), 3.0),
    'elbow_height': (ElbowHeight(gain=3.0), height, 3.0),
    'elbow_height at a height': (ElbowHeight(gain=3.0, height=0.5), off_height, -3.0),
}


@pytest.mark.parametrize(('preference', 'measure', 'factor'), GRADIENTS.values(), ids=GRADIENTS)
def test_a_preference_is_the_gradient_of_its_measure(preference, measure, factor, model, states):
    for state in states[:30]:
        slopes = [
            (measure(model, state.q + e) - measure(model, state.q - e)) / (2.0 * STEP)
            for e in STEP * np.eye(7)
        ]
        assert preference.acceleration(state) == pytest.approx(factor * np.array(slopes), abs=1e-7)


@pytest.mark.parametrize('wanted', [1e308, -1e308])
def test_a_height_beyond_all_measure_pulls_no_harder_than_one_out_of_reach(wanted, states):
    pulled = ElbowHeight(gain=1e4, height=wanted).acceleration(states[0])
    assert 0.0 < np.abs(pulled).max() < 1e8


def test_several_preferences_add_up(model, task):
    pair = (JointCentering(gain=40.0), ElbowHeight(gain=2.0))
    law = make_law('minimum_acceleration')

    def first(*preferences: Preference) -> np.ndarray:
        return Controller(model, law, T, preferences=preferences).update(task.start, DX).dq

    alone = first()
    together = first(*pair) - alone
    apart = (first(pair[0]) - alone) + (first(pair[1]) - alone)
    assert np.linalg.norm(together) > 1e-5
    assert together == pytest.approx(apart, abs=1e-12)


def test_an_open_posture_is_that_of_the_start(model, task):
    controller = Controller(model, make_law('minimum_acceleration'), T, preferences=('posture',))
    plain = Controller(model, make_law('minimum_acceleration'), T)
    first = controller.update(task.start, DX)
    assert first.dq == pytest.approx(plain.update(task.start, DX).dq, abs=1e-15)
    second = controller.update(task.start + 0.1, DX)
    assert np.linalg.norm(second.dq - plain.update(task.start + 0.1, DX).dq) > 1e-4


def test_limit_avoidance_acts_beside_an_end_in_the_direction_of_motion_only():
    model = RobotModel.named('lwr4')
    preference = JointLimitAvoidance(gain=40.0, margin=0.2, horizon=0.5)
    middle = (model.q_min + model.q_max) / 2.0
    beside = model.q_max - 0.3

    def acceleration(q: np.ndarray, dq: float) -> np.ndarray:
        return preference.acceleration(RobotState(model, q, np.full(7, dq)))

    assert not acceleration(middle, 1.0).any()
    assert not acceleration(beside, 0.0).any()
    assert not acceleration(beside, -1.0).any()
    assert acceleration(beside, 1.0) == pytest.approx(-40.0 * 0.4)
    assert acceleration(-beside, -1.0) == pytest.approx(40.0 * 0.4)


def test_a_posture_of_another_arm_is_refused(model, states):
    with pytest.raises(ArrayError, match=r'target of posture has shape \(6,\); expected \(7,\)'):
        Posture(target=(0.0,) * 6).acceleration(states[0])
