"""Impedance and force control on the level of acceleration and torque: the yardsticks of the
admittance, which asks for velocities.

The task acceleration is ddx = ddx_d + dde with M dde + D de + K e = f - f_d at the end of the
cycle, as in the implicit Euler step of the admittance, but solved for the acceleration. A scheme of
the paper turns it into joint accelerations or torques; forces on the tip are taken off by J' f.
"""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from redres_ros.contact import Admittance, AdmittanceSettings
from redres_ros.contact.settings import as_array
from redres_ros.controller import Controller
from redres_ros.fake_robot.mujoco_arm import MujocoSettings
from redres_ros.fake_robot.plant import MujocoPlant
from redres_ros.laws import make_law
from redres_ros.paper.contact.scenes import elbow_direction
from redres_ros.paper.second_order import Scheme, TorqueScheme, make_scheme
from redres_ros.preferences import Compliance
from redres_ros.robot_model import RobotModel, RobotState
from redres_ros.robots import find_arm

ARM = 'fr3'
T = 0.001  # [s]
DAMPING = 10.0  # k_d [1/s]
GAIN = 1.0  # of the compliance
IMPEDANCE = AdmittanceSettings(
    enabled=True, mass=(5.0,) * 3, damping=(100.0,) * 3, stiffness=(500.0,) * 3
)
FORCE_CONTROL = AdmittanceSettings(
    enabled=True,
    mass=(5.0,) * 3,
    damping=(100.0, 100.0, 1000.0),
    stiffness=(500.0, 500.0, 0.0),
    force=(0.0, 0.0, 20.0),
)
WALL = 1e4  # [N/m] below the start
_LASTS = 2.0  # [s]
_PUSH = 20.0  # [N] on the tip
_ELBOW_PUSH = 10.0  # [N]
_PUSHED = 1.0  # [s]

Force = Callable[[float, np.ndarray], np.ndarray]  # of time [s] and tip (3,) [m], (3,) [N]


class PushedMotion(NamedTuple):
    """Joint velocities (N, n) [rad/s], the tip's positions (N, 3) [m] and forces on it (N, 3)."""

    dq: np.ndarray
    x: np.ndarray
    force: np.ndarray


def push_at(t: float) -> float:
    """Rises and falls smoothly within a second, from 0 to 1 and back."""
    return float(np.sin(np.pi * t / _PUSHED) ** 2) if 0.0 < t < _PUSHED else 0.0


def pushed_tip(t: float, depth: np.ndarray) -> np.ndarray:
    """A hand that pushes the tip sideways, (3,) [N].

    Args:
        t: Time [s].
        depth: Of the tip, its place from the start on, (3,) [m].
    """
    return _PUSH * push_at(t) * np.array((0.6, 0.8, 0.0))


def wall_below(t: float, depth: np.ndarray) -> np.ndarray:
    """A table at the start of the tip, and the hand, (3,) [N].

    Args:
        t: Time [s].
        depth: As of pushed_tip().
    """
    return pushed_tip(t, depth) + np.array((0.0, 0.0, WALL * max(-depth[2], 0.0)))


class SecondOrderImpedance:
    """Impedance and force control by a scheme of second order, sampled.

    Args:
        model: Of the arm.
        scheme: On the level of acceleration or torque.
        settings: Mass, damping, stiffness and force in the axes of the base.
    """

    def __init__(self, model: RobotModel, scheme: Scheme, settings: AdmittanceSettings) -> None:
        self._model = model
        self._scheme = scheme
        self._mass = as_array(settings.mass)
        self._damping = as_array(settings.damping)
        self._stiffness = as_array(settings.stiffness)
        self._force = as_array(settings.force)
        self._J_prev: np.ndarray | None = None

    def task_acceleration(self, e: np.ndarray, de: np.ndarray, force: np.ndarray) -> np.ndarray:
        """dde, (3,) [m/s^2], with M dde + D (de + T dde) + K (e + T de + T^2 dde) = f - f_d.

        Args:
            e: x - x_d, (3,) [m].
            de: Its velocity, (3,) [m/s].
            force: f on the tip, (3,) [N].
        """
        stiffness = self._stiffness
        inertia = self._mass + T * self._damping + T**2 * stiffness
        drive = force - self._force - self._damping * de - stiffness * (e + T * de)
        dde: np.ndarray = drive / inertia
        return dde

    def acceleration(self, state: RobotState, dde: np.ndarray) -> np.ndarray:
        """ddq of the scheme, (n,) [rad/s^2]; of a torque scheme by the arm's dynamics, Eq. (6).

        Args:
            state: Of the arm, with its joint velocities.
            dde: Task acceleration, (3,) [m/s^2].
        """
        return self._scheme.acceleration(self._model, state, dde, self._bent(state))

    def torque(self, state: RobotState, dde: np.ndarray, force: np.ndarray) -> np.ndarray:
        """tau of a torque scheme, (n,) [Nm], which takes the force on the tip off.

        Args:
            state: Of the arm, with its joint velocities.
            dde: Task acceleration, (3,) [m/s^2].
            force: On the tip, (3,) [N].
        """
        assert isinstance(self._scheme, TorqueScheme)
        torque: np.ndarray = self._scheme.torque(state, dde, self._bent(state))
        return torque - state.J[:3].T @ force

    def _bent(self, state: RobotState) -> np.ndarray:
        """dJ dq by Eq. (9), (3,) [m/s^2]."""
        J = state.J[:3]
        dJ = (J - (J if self._J_prev is None else self._J_prev)) / T
        self._J_prev = J
        bent: np.ndarray = dJ @ state.dq_prev
        return bent


class PushedArm:
    """An arm that carries its own weight, its start, and what pushes its elbow."""

    def __init__(self) -> None:
        model = RobotModel(find_arm(ARM), weight=False)
        self.model = model
        self.q0 = np.array(model.arm.start)
        start = model.state(self.q0, np.zeros(model.n))
        self.x0 = start.x
        self._direction = elbow_direction(start)

    def state(self, t: float, q: np.ndarray, dq: np.ndarray) -> RobotState:
        """With the torques of the push on the elbow.

        Args:
            t: Time [s].
            q: (n,) [rad].
            dq: (n,) [rad/s].
        """
        state = self.model.state(q, dq)
        push = _ELBOW_PUSH * push_at(t - 0.5) * self._direction
        torques = state.jacobian(self.model.elbow_frame)[:3].T @ push
        state.measurements = {Compliance.measurement: torques}
        return state


def by_velocity(law: str, settings: AdmittanceSettings, force: Force) -> PushedMotion:
    """In the ideal loop, by the admittance and a velocity law.

    Args:
        law: Its name.
        settings: Of the admittance.
        force: On the tip.
    """
    arm = PushedArm()
    preferences = (Compliance(gain=GAIN),)
    controller = Controller(arm.model, make_law(law, damping=DAMPING), T, preferences=preferences)
    admittance = Admittance(settings, T)
    q = arm.q0
    rows = []
    for k in range(round(_LASTS / T)):
        state = arm.state(k * T, q, np.zeros(arm.model.n))
        f = force(k * T, state.x - arm.x0)
        controller.measurements = state.measurements
        dx = np.zeros(3)
        velocity = admittance.velocity(dx, np.append(f, np.zeros(3)), state)
        command = controller.update(q, velocity)
        admittance.record(command, dx)
        rows.append((command.dq, state.x, f))
        q = command.q_ref
    return _motion(rows)


def by_scheme(law: str, settings: AdmittanceSettings, force: Force) -> PushedMotion:
    """The same by the scheme of second order that the law was made from.

    Args:
        law: Its name.
        settings: Of the impedance.
        force: On the tip.
    """
    arm = PushedArm()
    scheme = make_scheme(law, DAMPING, Compliance(gain=GAIN))
    impedance = SecondOrderImpedance(arm.model, scheme, settings)
    q = arm.q0
    dq = np.zeros(arm.model.n)
    e = np.zeros(3)
    de = np.zeros(3)
    rows = []
    for k in range(round(_LASTS / T)):
        state = arm.state(k * T, q, dq)
        f = force(k * T, state.x - arm.x0)
        dde = impedance.task_acceleration(e, de, f)
        dq = dq + T * impedance.acceleration(state, dde)  # Eq. (13)
        q = q + T * dq
        de = state.J[:3] @ dq
        e = e + T * de
        rows.append((dq, state.x, f))
    return _motion(rows)


def on_plant_by_positions(law: str, bandwidth: float) -> PushedMotion:
    """The impedance on the plant behind position servos, while a hand pushes tip and elbow.

    Args:
        law: Its name.
        bandwidth: Of the servos [rad/s].
    """
    arm = PushedArm()
    plant = MujocoPlant(arm.model.arm, T, arm.q0, MujocoSettings(servo_bandwidth=bandwidth))
    controller = Controller(arm.model, make_law(law, damping=DAMPING), T)
    admittance = Admittance(IMPEDANCE, T)
    rows = []
    for k in range(round(_LASTS / T)):
        state = arm.model.state(plant.q, np.zeros(arm.model.n))
        f = pushed_tip(k * T, state.x - arm.x0)
        dx = np.zeros(3)
        velocity = admittance.velocity(dx, np.append(f, np.zeros(3)), state)
        command = controller.update(plant.q, velocity)
        admittance.record(command, dx)
        rows.append((plant.dq, state.x, f))
        plant.push(f)
        plant.step(command.q_ref)
    return _motion(rows)


def on_plant_by_torques(law: str) -> PushedMotion:
    """The same by torques, the servos being off.

    Args:
        law: Its name.
    """
    arm = PushedArm()
    plant = MujocoPlant(arm.model.arm, T, arm.q0)
    scheme = make_scheme(law, DAMPING)
    impedance = SecondOrderImpedance(arm.model, scheme, IMPEDANCE)
    rows = []
    for k in range(round(_LASTS / T)):
        state = arm.model.state(plant.q, plant.dq)
        f = pushed_tip(k * T, state.x - arm.x0)
        de = state.J[:3] @ plant.dq
        dde = impedance.task_acceleration(state.x - arm.x0, de, f)
        torque = impedance.torque(state, dde, f)
        rows.append((plant.dq, state.x, f))
        plant.push(f)
        plant.step_torque(torque)
    return _motion(rows)


def _motion(rows: list[tuple[np.ndarray, np.ndarray, np.ndarray]]) -> PushedMotion:
    dq, x, force = (np.array(column) for column in zip(*rows, strict=True))
    return PushedMotion(dq, x, force)


def servo_deflection(bandwidth: float) -> float:
    """How far the hand pushes the tip of an arm whose servos hold it [m].

    Args:
        bandwidth: Of the servos [rad/s].
    """
    arm = PushedArm()
    plant = MujocoPlant(arm.model.arm, T, arm.q0, MujocoSettings(servo_bandwidth=bandwidth))
    distances = []
    for k in range(round(_PUSHED / T)):
        plant.push(pushed_tip(k * T, np.zeros(3)))
        plant.step(arm.q0)
        distances.append(np.linalg.norm(arm.model.tip(plant.q)[0] - arm.x0))
    return float(max(distances))
