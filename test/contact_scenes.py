"""An arm on the plant that presses on a table and slides, and one whose elbow is pushed."""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from redres_ros.contact import AdmittanceSettings, ContactControl
from redres_ros.controller import Controller
from redres_ros.fake_robot.mujoco_arm import EnvironmentSettings
from redres_ros.fake_robot.plant import MujocoPlant
from redres_ros.laws import Law, make_law
from redres_ros.preferences import Compliance, Posture, Preference
from redres_ros.robot_model import RobotModel, RobotState

FORCE = 20.0  # [N] with which the tip presses
APPROACH = 0.02  # [m/s]
SLIDE = 0.05  # [m/s]
RAMP = 0.2  # [s] in which it is reached
PUSH = 30.0  # [N] on the elbow
LIMITS = ('position', 'velocity', 'acceleration')
LAW = make_law('minimum_acceleration', damping=10.0)
COMPLIANCE = Compliance()

_STIFF = 1e6  # [N s/m] of directions that do not yield
_PRESSED = 1.5  # [s] after which the tip slides
_SETTLED = 2.0  # [s] after which the force is judged
_PUSH_BEGINS = 1.5  # [s]
_PUSH_ENDS = 2.5  # [s]
_ELBOW_LAST = 8.5  # [s]


@dataclass(frozen=True)
class Pressing:
    """An arm, its cycle and servos, a surface below the tip, and the damping across it."""

    arm: str = 'fr3'
    T: float = 0.001
    bandwidth: float = 400.0
    stiffness: float = 1e4
    damping: float = 1000.0
    noise: float = 0.0
    delay: int = 1  # cycles from a state to the motion
    gap: float = 0.005  # [m] from the start to the surface
    force_limit: float = 100.0


class PressingArm:
    """An arm on the plant that asks for a force, above a table or in free space."""

    def __init__(
        self,
        case: Pressing,
        law: Law = LAW,
        preferences: tuple[Preference, ...] = (),
        *,
        has_table: bool = True,
    ) -> None:
        self.model = RobotModel.named(case.arm)
        q0 = np.array(self.model.arm.start)
        surface = tuple(self.model.tip(q0)[0] - np.array((0.0, 0.0, case.gap)))
        shape = 'table' if has_table else 'none'
        environment = EnvironmentSettings(shape, surface, contact_stiffness=case.stiffness)
        self.plant = MujocoPlant(
            self.model.arm, case.T, q0, environment=environment, servo_bandwidth=case.bandwidth
        )
        self.controller = Controller(
            self.model, law, case.T, limits=LIMITS, preferences=preferences
        )
        settings = AdmittanceSettings(
            enabled=has_table,
            damping=(_STIFF, _STIFF, case.damping),
            force=(0.0, 0.0, FORCE),
            force_limit=case.force_limit,
        )
        self._contact = ContactControl(settings, case.T)
        self._noise = case.noise
        self._random = np.random.default_rng(0)
        self._pending = [q0] * (case.delay - 1)

    def state(self) -> RobotState:
        """The arm's state at this tick; the admittance needs no joint velocities."""
        return self.model.state(self.plant.q, np.zeros(self.model.n))

    def force(self, state: RobotState) -> float:
        """The table's force on the tip, along z of the base [N]."""
        return float((state.R @ self.plant.wrench[:3])[2])

    def advance(self, state: RobotState, dx: np.ndarray) -> None:
        """A cycle at a task velocity. Raises ContactError."""
        self._contact.sensor.enter(self.plant.wrench + self._noise * self._random.normal(size=6))
        command = self.controller.update(self.plant.q, self._contact.velocity(dx, state))
        self._contact.record(command, dx)
        self._pending.append(command.q_ref)
        self.plant.step(self._pending.pop(0))


class Pressed(NamedTuple):
    """Times (N,) [s], force of a table on the tip (N,) [N], the tip's positions (N, 3) [m]."""

    t: np.ndarray
    force: np.ndarray
    x: np.ndarray

    @property
    def first(self) -> int:
        """The first tick in contact."""
        return int(np.argmax(self.force > 0.0))

    @property
    def rms(self) -> float:
        """RMS of the force error while sliding [N]."""
        return _rms_error(self.force[self.t >= _SETTLED])


def pressed(case: Pressing, distance: float = 0.3) -> Pressed:
    """The tip goes down to a table, presses on it, and slides."""
    arm = PressingArm(case)
    forces = []
    positions = []
    times = case.T * np.arange(round((_PRESSED + RAMP + distance / SLIDE) / case.T))
    for t in times:
        state = arm.state()
        forces.append(arm.force(state))
        positions.append(state.x)
        touched = max(forces) > 0.0
        down = 0.0 if touched else -(APPROACH - min(APPROACH, FORCE / case.damping))
        along = SLIDE * float(np.clip((t - _PRESSED) / RAMP, 0.0, 1.0))
        arm.advance(state, np.array((0.0, along, down)))
    return Pressed(times, np.array(forces), np.array(positions))


class Yielding(NamedTuple):
    """From the push on the elbow on: how far it gives (N,) [m], what the tip does (N, 3) [m], and
    the force of the table (N,) [N].
    """

    elbow: np.ndarray
    tip: np.ndarray
    force: np.ndarray

    @property
    def rms(self) -> float:
        """RMS of the force error [N]."""
        return _rms_error(self.force)


def elbow_direction(state: RobotState) -> np.ndarray:
    """The direction in which the elbow moves most while the tip rests, (3,)."""
    J = state.J[:3]
    P = np.eye(len(state.q)) - np.linalg.pinv(J) @ J
    U, _, _ = np.linalg.svd(state.jacobian(state.model.elbow_frame)[:3] @ P)
    direction = U[:, 0]
    return direction * np.sign(direction[np.abs(direction).argmax()])


def elbow_pushed(
    arm: str,
    presses: bool,
    law: Law = LAW,
    compliance: Compliance = COMPLIANCE,
    *,
    push: float = PUSH,
) -> Yielding:
    """The elbow is pushed for a second, while the tip presses on a table or is free."""
    T = 0.002  # [s]
    case = Pressing(arm, T, gap=0.001)
    pushed = PressingArm(case, law, (compliance, Posture()), has_table=presses)
    elbow = pushed.model.elbow_frame
    direction = elbow_direction(pushed.state())
    rows = []
    for t in np.arange(0.0, _ELBOW_LAST, T):
        is_pushed = _PUSH_BEGINS <= t < _PUSH_ENDS
        pushed.plant.push(push * direction * is_pushed, elbow)
        state = pushed.state()
        given = pushed.model.position(pushed.plant.q, elbow) @ direction
        rows.append((given, *state.x, pushed.force(state)))
        pushed.controller.measurements = {'external_torques': pushed.plant.external_torques}
        pushed.advance(state, np.zeros(3))
    table = np.array(rows)[round(_PUSH_BEGINS / T) :]
    return Yielding(table[:, 0] - table[0, 0], table[:, 1:4] - table[0, 1:4], table[:, 4])


def _rms_error(force: np.ndarray) -> float:
    """RMS of the error of forces (N,) from the desired one [N]."""
    return float(np.sqrt(np.mean((force - FORCE) ** 2)))
