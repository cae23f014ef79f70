"""The safety filter: what it does with a reference, and how it reports that."""

from dataclasses import replace

import numpy as np
import pytest

from redres_ros import Command, Controller, RobotModel, make_law
from redres_ros.command import Published
from redres_ros.loop.safety import SafetyFilter

T = 0.002  # [s]
MODEL = RobotModel.named('lwr4_paper')
A = np.array(MODEL.arm.acceleration_limit)  # (n,) [rad/s^2]
JOINT = 2
AWAY = np.zeros(MODEL.n)  # [rad] from any end of a range


class Guarded:
    """A filter behind which the arm is at q (n,) [rad], and moves with dq (n,) [rad/s]."""

    def __init__(self, q: np.ndarray, dq: np.ndarray) -> None:
        limits = ('position', 'velocity', 'acceleration')
        self.controller = Controller(MODEL, make_law('minimum_velocity'), T, limits=limits)
        self.controller.published = Published(q, dq, np.zeros(MODEL.n), dq)
        self.filter = SafetyFilter(self.controller)

    def admit(self, desired: np.ndarray, missed: int) -> Command:
        plan = self.controller.plan(self.controller.reference, np.zeros(3), missed)
        return self.controller.commit(self.filter.admit(replace(plan, q_ref=desired)))


def only(value: float) -> np.ndarray:
    """A vector (n,) with this value at one joint."""
    return np.where(np.arange(MODEL.n) == JOINT, value, 0.0)


def test_a_reference_within_the_limits_passes_as_it_is() -> None:
    arm = Guarded(AWAY, only(0.5))
    wanted = AWAY + T * only(0.5 + 0.9 * A[JOINT] * T)
    assert (arm.admit(wanted, 0).q_ref == wanted).all()
    assert arm.filter.reason == ''
    assert arm.filter.count == 0


@pytest.mark.parametrize('step', [0.1, -0.1, np.nan, np.inf])
def test_a_step_becomes_a_motion_within_the_acceleration_that_names_the_joint(step: float) -> None:
    arm = Guarded(AWAY, only(0.5))
    admitted = arm.admit(AWAY + only(step), 0)
    change = np.abs(admitted.dq - only(0.5))
    assert (change <= A * T * (1.0 + 1e-9)).all()
    assert arm.filter.reason.startswith(MODEL.joint_names[JOINT])
    assert f'{step / T:.4g} rad/s, {(step / T - 0.5) / T:.4g} rad/s^2' in arm.filter.reason
    assert arm.filter.count == 1


def test_a_joint_that_cannot_stop_within_its_range_any_more_is_reported_while_it_brakes() -> None:
    q = AWAY + only(MODEL.q_max[JOINT] - 0.01)
    arm = Guarded(q, only(0.8))  # in 5 cycles without a command the robot moves it by 8 mm
    braking = only(0.8 - A[JOINT] * T)
    wanted = q + 5 * T * only(0.8) + T * braking
    np.testing.assert_allclose(arm.admit(wanted, 5).q_ref, wanted, rtol=0.0, atol=1e-12)
    assert 'too fast to stop' in arm.filter.reason
    assert arm.filter.count == 1
