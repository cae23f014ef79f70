"""Impedance and force control on the level of acceleration and torque: the yardsticks of the
admittance, which asks for velocities.

The task acceleration is ddx = ddx_d + dde with M dde + D de + K e = f - f_d at the end of the
cycle, as in the implicit Euler step of the admittance, but solved for the acceleration. A scheme of
the paper turns it into joint accelerations or torques; forces on the tip are taken off by J' f.
"""

import numpy as np

from redres_ros.contact import AdmittanceSettings
from redres_ros.contact.settings import as_array
from redres_ros.fake_robot.plant import MujocoPlant
from redres_ros.paper.contact.pushed import (
    COMPLIANCE,
    DAMPING,
    ELBOW_PUSH,
    LASTS,
    Force,
    PushedArm,
    PushedMotion,
    T,
)
from redres_ros.paper.second_order import Scheme, TorqueScheme, make_scheme
from redres_ros.robot_model import RobotModel, RobotState


class _SecondOrderImpedance:
    """Impedance and force control by a scheme of second order, sampled."""

    def __init__(self, model: RobotModel, scheme: Scheme, settings: AdmittanceSettings) -> None:
        self._model = model
        self._scheme = scheme
        self._mass = as_array(settings.mass)
        self._damping = as_array(settings.damping)
        self._stiffness = as_array(settings.stiffness)
        self._force = as_array(settings.force)
        self._J_prev: np.ndarray | None = None

    def acceleration(
        self, state: RobotState, e: np.ndarray, de: np.ndarray, force: np.ndarray
    ) -> np.ndarray:
        """ddq of the scheme, (n,) [rad/s^2], for e = x - x_d (3,) [m], its velocity de (3,) [m/s]
        and the force on the tip (3,) [N]; of a torque scheme by the arm's dynamics, Eq. (6).
        """
        dde = self._task_acceleration(e, de, force)
        return self._scheme.acceleration(self._model, state, dde, self._bent(state))

    def torque(
        self, state: RobotState, e: np.ndarray, de: np.ndarray, force: np.ndarray
    ) -> np.ndarray:
        """tau of a torque scheme, (n,) [Nm], which takes the force on the tip off."""
        assert isinstance(self._scheme, TorqueScheme)
        dde = self._task_acceleration(e, de, force)
        return self._scheme.torque(state, dde, self._bent(state)) - state.J[:3].T @ force

    def _task_acceleration(self, e: np.ndarray, de: np.ndarray, force: np.ndarray) -> np.ndarray:
        """dde, (3,) [m/s^2], with M dde + D (de + T dde) + K (e + T de + T^2 dde) = f - f_d."""
        stiffness = self._stiffness
        inertia = self._mass + T * self._damping + T**2 * stiffness
        drive = force - self._force - self._damping * de - stiffness * (e + T * de)
        return drive / inertia

    def _bent(self, state: RobotState) -> np.ndarray:
        """dJ dq by Eq. (9), (3,) [m/s^2]."""
        J = state.J[:3]
        dJ = (J - (J if self._J_prev is None else self._J_prev)) / T
        self._J_prev = J
        return dJ @ state.dq_prev


def by_scheme(law: str, settings: AdmittanceSettings, force: Force) -> PushedMotion:
    """The motion of an ideal arm by the scheme of second order that the law was made from.

    Args:
        law: Its name.
        settings: Settings of the impedance.
        force: Force on the tip.
    """
    arm = PushedArm(ELBOW_PUSH)
    impedance = _SecondOrderImpedance(arm.model, make_scheme(law, DAMPING, COMPLIANCE), settings)
    q = arm.q0
    dq = np.zeros(arm.model.n)
    e = np.zeros(3)
    de = np.zeros(3)
    rows = []
    for k in range(round(LASTS / T)):
        state = arm.state(k * T, q, dq)
        f = force(k * T, state.x - arm.x0)
        dq = dq + T * impedance.acceleration(state, e, de, f)  # Eq. (13)
        q = q + T * dq
        de = state.J[:3] @ dq
        e = e + T * de
        rows.append((dq, state.x - arm.x0))
    return PushedMotion.of(rows)


def by_torques(law: str, settings: AdmittanceSettings, force: Force) -> PushedMotion:
    """The motion of an arm on the plant, by torques.

    Args:
        law: Its name.
        settings: Settings of the impedance.
        force: Force on the tip.
    """
    arm = PushedArm(0.0)
    plant = MujocoPlant(arm.model.arm, T, arm.q0)
    impedance = _SecondOrderImpedance(arm.model, make_scheme(law, DAMPING), settings)
    rows = []
    for k in range(round(LASTS / T)):
        state = arm.model.state(plant.q, plant.dq)
        e = state.x - arm.x0
        f = force(k * T, e)
        torque = impedance.torque(state, e, state.J[:3] @ plant.dq, f)
        rows.append((plant.dq, e))
        plant.push(f)
        plant.step_torque(torque)
    return PushedMotion.of(rows)
