"""An arm on the plant that presses on a table and slides, and one whose elbow is pushed."""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from redres_ros.contact import AdmittanceSettings, ContactControl
from redres_ros.controller import Controller
from redres_ros.fake_robot.environment import EnvironmentSettings
from redres_ros.fake_robot.mujoco_arm import MujocoSettings
from redres_ros.fake_robot.plant import MujocoPlant
from redres_ros.laws import Law, make_law
from redres_ros.preferences import Compliance, Posture
from redres_ros.robot_model import RobotModel, RobotState

FORCE = 20.0  # [N] with which the tip presses
APPROACH = 0.02  # [m/s]
GAP = 0.005  # [m] from the start to the surface
SLIDE = 0.05  # [m/s]
RAMP = 0.2  # [s] in which it is reached
PRESSED = 1.5  # [s] after which the tip slides
SETTLED = 2.0  # [s] after which the force is judged
PUSH = 30.0  # [N] on the elbow
PUSH_BEGINS = 1.5  # [s]
PUSH_ENDS = 2.5  # [s]
ELBOW_LAST = 8.5  # [s]
STIFF = 1e6  # [N s/m] of directions that do not yield
LIMITS = ('position', 'velocity', 'acceleration')
LAW = make_law('minimum_acceleration', damping=10.0)
COMPLIANCE = Compliance()


@dataclass(frozen=True)
class Pressing:
    """An arm, its cycle and servos, a surface, and the damping across it."""

    arm: str = 'fr3'
    T: float = 0.001
    bandwidth: float = 400.0
    stiffness: float = 1e4
    damping: float = 1000.0
    noise: float = 0.0
    delay: int = 1  # cycles from a state to the motion
    distance: float = 0.3


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
        """Of the force error while sliding [N]."""
        return float(np.sqrt(np.mean((self.force[self.t >= SETTLED] - FORCE) ** 2)))


def pressed(case: Pressing) -> Pressed:
    """The tip goes down to a table, presses on it, and slides."""
    model = RobotModel.named(case.arm)
    q0 = np.array(model.arm.start)
    x0, _ = model.tip(q0)
    surface = tuple(x0 - np.array((0.0, 0.0, GAP)))
    environment = EnvironmentSettings('table', surface, contact_stiffness=case.stiffness)
    servo = MujocoSettings(servo_bandwidth=case.bandwidth)
    plant = MujocoPlant(model.arm, case.T, q0, servo, environment)
    controller = Controller(model, LAW, case.T, limits=LIMITS)
    settings = AdmittanceSettings(
        enabled=True, damping=(STIFF, STIFF, case.damping), force=(0.0, 0.0, FORCE)
    )
    contact = ContactControl(settings, case.T)
    random = np.random.default_rng(0)
    on_the_way = [q0] * (case.delay - 1)
    forces = []
    positions = []
    times = case.T * np.arange(round((PRESSED + RAMP + case.distance / SLIDE) / case.T))
    for t in times:
        state = model.state(plant.q, np.zeros(model.n))
        wrench = plant.wrench
        forces.append((state.R @ wrench[:3])[2])
        positions.append(state.x)
        contact.sensor.enter(wrench + case.noise * random.normal(size=6))
        touched = max(forces) > 0.0
        down = 0.0 if touched else -(APPROACH - min(APPROACH, FORCE / case.damping))
        along = SLIDE * float(np.clip((t - PRESSED) / RAMP, 0.0, 1.0))
        dx = np.array((0.0, along, down))
        command = controller.update(plant.q, contact.velocity(dx, state))
        contact.record(command, dx)
        on_the_way.append(command.q_ref)
        plant.step(on_the_way.pop(0))
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
        """Of the force error [N]."""
        return float(np.sqrt(np.mean((self.force - FORCE) ** 2)))


def elbow_direction(state: RobotState) -> np.ndarray:
    """In which the elbow moves most while the tip rests, (3,)."""
    J = state.J[:3]
    P = np.eye(len(state.q)) - np.linalg.pinv(J) @ J
    U, _, _ = np.linalg.svd(state.jacobian(state.model.elbow_frame)[:3] @ P)
    direction: np.ndarray = U[:, 0]
    return direction * np.sign(direction[np.abs(direction).argmax()])


def elbow_pushed(
    arm: str,
    presses: bool,
    law: Law = LAW,
    compliance: Compliance = COMPLIANCE,
    *,
    push: float = PUSH,
    T: float = 0.002,
) -> Yielding:
    """The elbow is pushed for a second, while the tip presses on a table or is free.

    Args:
        arm: Its name.
        presses: Whether there is a table.
        law: In use.
        compliance: Beside a posture.
        push: On the elbow [N].
        T: Sampling time [s].
    """
    model = RobotModel.named(arm)
    q0 = np.array(model.arm.start)
    at_rest = np.zeros(model.n)
    start = model.state(q0, at_rest)
    surface = tuple(start.x - np.array((0.0, 0.0, 0.001)))
    shape = 'table' if presses else 'none'
    servo = MujocoSettings(servo_bandwidth=400.0)
    plant = MujocoPlant(model.arm, T, q0, servo, EnvironmentSettings(shape, surface))
    controller = Controller(
        model,
        law,
        T,
        limits=LIMITS,
        preferences=(compliance, Posture()),
    )
    settings = AdmittanceSettings(
        enabled=presses, damping=(STIFF, STIFF, 1000.0), force=(0.0, 0.0, FORCE)
    )
    contact = ContactControl(settings, T)
    direction = elbow_direction(start)
    rows = []
    for t in np.arange(0.0, ELBOW_LAST, T):
        pushed = PUSH_BEGINS <= t < PUSH_ENDS
        plant.push(push * direction * pushed, model.elbow_frame)
        state = model.state(plant.q, at_rest)
        elbow = model.position(plant.q, model.elbow_frame) @ direction
        rows.append((elbow, *state.x, (state.R @ plant.wrench[:3])[2]))
        contact.sensor.enter(plant.wrench)
        controller.measurements = {'external_torques': plant.external_torques}
        command = controller.update(plant.q, contact.velocity(np.zeros(3), state))
        contact.record(command, np.zeros(3))
        plant.step(command.q_ref)
    table = np.array(rows)[round(PUSH_BEGINS / T) :]
    return Yielding(table[:, 0] - table[0, 0], table[:, 1:4] - table[0, 1:4], table[:, 4])
