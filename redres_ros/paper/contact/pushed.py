"""An arm that yields by the admittance to a hand, a table or a step of force on its tip."""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from redres_ros.contact import Admittance, AdmittanceSettings
from redres_ros.controller import Controller
from redres_ros.fake_robot.mujoco_arm import MujocoSettings
from redres_ros.fake_robot.plant import IdealPlant, MujocoPlant
from redres_ros.laws import make_law
from redres_ros.paper.contact.scenes import elbow_direction
from redres_ros.preferences import Compliance
from redres_ros.robot_model import RobotModel, RobotState, TickContext
from redres_ros.robots import find_arm

T = 0.001  # [s]
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
DAMPING = 10.0  # k_d [1/s]
COMPLIANCE = Compliance(gain=1.0)
LASTS = 2.0  # [s]
ELBOW_PUSH = 10.0  # [N]
STEP = 10.0  # [N] along y
_STEP_T = 0.002  # [s]
_MASS = 4.0  # [kg]
STIFFNESS = 400.0  # [N/m]

_STEP_DAMPING = 40.0  # [N s/m]
_WALL = 1e4  # [N/m] below the start
_PUSH = 20.0  # [N] on the tip
_PUSHED = 1.0  # [s]

Force = Callable[[float, np.ndarray], np.ndarray]  # of time [s] and tip (3,) [m], (3,) [N]


class PushedMotion(NamedTuple):
    """Joint velocities (N, n) [rad/s], and the tip's positions from its start on (N, 3) [m]."""

    dq: np.ndarray
    x: np.ndarray

    @classmethod
    def of(cls, rows: list[tuple[np.ndarray, np.ndarray]]) -> 'PushedMotion':
        """A motion from dq (n,) and x (3,) of each tick."""
        return cls(*(np.array(column) for column in zip(*rows, strict=True)))

    @property
    def distance(self) -> float:
        """The largest one of the tip from its start [m]."""
        return float(np.linalg.norm(self.x, axis=1).max())


def pushed_tip(t: float, depth: np.ndarray) -> np.ndarray:
    """A hand that pushes the tip sideways, (3,) [N].

    Args:
        t: Time [s].
        depth: Displacement of the tip from its start, (3,) [m].
    """
    return _PUSH * _push_at(t) * np.array((0.6, 0.8, 0.0))


def wall_below(t: float, depth: np.ndarray) -> np.ndarray:
    """A table at the start of the tip, and the hand, (3,) [N].

    Args:
        t: Time [s].
        depth: See pushed_tip().
    """
    return pushed_tip(t, depth) + np.array((0.0, 0.0, _WALL * max(-depth[2], 0.0)))


def _push_at(t: float) -> float:
    """Rises and falls smoothly within a second, from 0 to 1 and back."""
    return float(np.sin(np.pi * t / _PUSHED) ** 2) if 0.0 < t < _PUSHED else 0.0


class PushedArm:
    """An arm that carries its own weight, its start, and what pushes its elbow.

    Args:
        push: Push on the elbow [N].
    """

    def __init__(self, push: float) -> None:
        model = RobotModel(find_arm('fr3'), weight=False)
        self.model = model
        self.q0 = np.array(model.arm.start)
        start = model.state(self.q0, np.zeros(model.n))
        self.x0 = start.x
        self._push = push * elbow_direction(start)

    def plant(self, bandwidth: float | None, T: float) -> IdealPlant | MujocoPlant:
        """The arm at its start.

        Args:
            bandwidth: Bandwidth of its servos in MuJoCo [rad/s]; None: an ideal arm.
            T: The cycle [s].
        """
        if bandwidth is None:
            return IdealPlant(self.model.joint_names, T, self.q0)
        settings = MujocoSettings(servo_bandwidth=bandwidth)
        return MujocoPlant(self.model.arm, T, self.q0, settings)

    def state(self, t: float, q: np.ndarray, dq: np.ndarray) -> RobotState:
        """The state, with the torques of the push on the elbow as a measurement.

        Args:
            t: Time [s].
            q: (n,) [rad].
            dq: (n,) [rad/s].
        """
        J = self.model.jacobian(q, self.model.elbow_frame)[:3]
        measurements = {Compliance.measurement: J.T @ (_push_at(t - 0.5) * self._push)}
        return RobotState(self.model, q, dq, tick=TickContext(measurements))


def by_velocity(
    law: str,
    settings: AdmittanceSettings,
    force: Force,
    bandwidth: float | None = None,
    *,
    elbow_push: float = ELBOW_PUSH,
    felt: float = 1.0,
    T: float = T,
) -> PushedMotion:
    """The motion by the admittance and a velocity law.

    Args:
        law: Its name.
        settings: Settings of the admittance.
        force: Force on the tip.
        bandwidth: Bandwidth of the servos of an arm on the plant [rad/s]; None: an ideal arm.
        elbow_push: Force on the elbow that the law feels [N].
        felt: Fraction of the force that the sensor measures.
        T: Sampling time [s].
    """
    arm = PushedArm(elbow_push)
    plant = arm.plant(bandwidth, T)
    made = make_law(law, damping=DAMPING)
    controller = Controller(arm.model, made, T, preferences=(COMPLIANCE,))
    admittance = Admittance(settings, T)
    dx = np.zeros(3)
    rows = []
    for k in range(round(LASTS / T)):
        state = arm.state(k * T, plant.q, np.zeros(arm.model.n))
        depth = state.x - arm.x0
        f = force(k * T, depth)
        controller.measurements = state.measurements
        wrench = np.append(felt * f, np.zeros(3))
        command = controller.update(plant.q, admittance.velocity(dx, wrench, state))
        admittance.record(command, dx)
        rows.append((command.dq, depth))
        plant.push(f)
        plant.step(command.q_ref)
    return PushedMotion.of(rows)


def stepped(bandwidth: float | None = None, felt: float = 1.0) -> np.ndarray:
    """What the tip does along a step of force, (N,) [m].

    Args:
        bandwidth: See by_velocity().
        felt: Likewise.
    """
    settings = AdmittanceSettings(
        enabled=True, mass=(_MASS,) * 3, damping=(_STEP_DAMPING,) * 3, stiffness=(STIFFNESS,) * 3
    )
    push = np.array((0.0, STEP, 0.0))
    moved = by_velocity(
        'minimum_acceleration',
        settings,
        lambda *_: push,
        bandwidth,
        elbow_push=0.0,
        felt=felt,
        T=_STEP_T,
    )
    return moved.x[:, 1]


def analytic() -> np.ndarray:
    """The motion of mass, damper and spring after the same step, (N,) [m]."""
    t = _STEP_T * np.arange(round(LASTS / _STEP_T))
    sigma = _STEP_DAMPING / (2.0 * _MASS)
    omega = np.sqrt(STIFFNESS / _MASS - sigma**2)
    decay = np.exp(-sigma * t) * (np.cos(omega * t) + sigma / omega * np.sin(omega * t))
    return STEP / STIFFNESS * (1.0 - decay)
