"""The gate: what it does with a reference, and how it reports that."""

import numpy as np
import pytest

from redres_ros import Controller, RobotModel, make_law
from redres_ros.loop.gate import Gate

T = 0.002  # [s]
MODEL = RobotModel.named('lwr4_paper')
A = np.array(MODEL.arm.acceleration_limit)  # (n,) [rad/s^2]
JOINT = 2
AWAY = np.zeros(MODEL.n)  # [rad] from any end of a range


def gate_at(q: np.ndarray, dq: np.ndarray) -> Gate:
    """A gate behind which the arm is at q (n,) [rad], and moves with dq (n,) [rad/s]."""
    limits = ('position', 'velocity', 'acceleration')
    gate = Gate(Controller(MODEL, make_law('minimum_velocity'), T, limits=limits))
    gate.record(q)
    gate.dq = dq
    return gate


def only(value: float) -> np.ndarray:
    """A vector (n,) with this value at one joint."""
    return np.where(np.arange(MODEL.n) == JOINT, value, 0.0)


def test_a_reference_within_the_limits_passes_as_it_is() -> None:
    gate = gate_at(AWAY, only(0.5))
    wanted = AWAY + T * only(0.5 + 0.9 * A[JOINT] * T)
    assert gate.admit(wanted, 0) == (pytest.approx(wanted, abs=0.0), pytest.approx(gate.dq), '')
    assert gate.count == 0


@pytest.mark.parametrize('step', [0.1, -0.1, np.nan, np.inf])
def test_a_step_becomes_a_motion_within_the_acceleration_that_names_the_joint(step: float) -> None:
    gate = gate_at(AWAY, only(0.5))
    admitted = gate.admit(AWAY + only(step), 0)
    change = np.abs(admitted.dq - only(0.5))
    assert (change <= A * T * (1.0 + 1e-9)).all()
    assert admitted.reason.startswith(MODEL.joint_names[JOINT])
    assert gate.count == 1


def test_a_joint_that_cannot_stop_within_its_range_any_more_is_reported_while_it_brakes() -> None:
    q = AWAY + only(MODEL.q_max[JOINT] - 0.01)
    gate = gate_at(q, only(0.8))  # in 5 cycles without a command the robot moves it by 8 mm
    braking = only(0.8 - A[JOINT] * T)
    wanted = q + 5 * T * only(0.8) + T * braking
    admitted = gate.admit(wanted, 5)
    np.testing.assert_allclose(admitted.q_ref, wanted, rtol=0.0, atol=1e-12)
    assert 'too fast to stop' in admitted.reason
    assert gate.count == 1
