"""What the last cycles of a running arm come to: figures to be plotted, and limits that act."""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from sensor_msgs.msg import JointState

from redres_ros.command import Command
from redres_ros.errors import JointNamesError
from redres_ros.laws import Law
from redres_ros.limits import Limit, Limits, limit_name
from redres_ros.nodes.conversions import JointOrder
from redres_ros.nodes.stamps import to_nanoseconds
from redres_ros.nodes.wire import deserialised
from redres_ros.robot_model import RobotModel
from redres_ros.vectors import finite_vector

_STILL = 1e-3  # [m/s] below which a task asks for nothing that would show
_TOUCHING = 1e-6  # [rad/s] from a bound: what is commanded there, is commanded because of it


class Cycle(NamedTuple):
    """One answer of the controller: stamp [ns], q_ref (n,) [rad], dq (n,) [rad/s]."""

    stamp: int
    q_ref: np.ndarray
    dq: np.ndarray


@dataclass(frozen=True)
class Figures:
    """What is plotted of one instant; speed and acceleration are the largest since the last one.

    Args:
        time: Of the robot's clock [s].
        speed: Norm of the joint velocity [rad/s].
        acceleration: Norm of the joint acceleration [rad/s^2].
        null_speed: Norm of the part of the velocity that does not move the tip [rad/s].
        torque: Norm of the joint torques [Nm].
        singular_value: The smallest of the task's Jacobian.
        scaling: Share of the asked speed of the tip that is carried out, 0 to 1.
    """

    time: float
    speed: float
    acceleration: float
    null_speed: float
    torque: float
    singular_value: float
    scaling: float


def read_cycle(data: bytes, joints: JointOrder) -> Cycle:
    """A cycle from a command.

    Args:
        data: A serialised joint_command.
        joints: Of the arm, in whose order a controller names them.

    Raises:
        RedresError: The bytes are no message, it is of another arm, or lacks a velocity.
    """
    message = deserialised(data, JointState)
    if tuple(message.name) != joints.names:
        raise JointNamesError(message.name, joints.names)
    q_ref = joints.positions(message)
    dq = finite_vector(np.array(message.velocity), len(q_ref), 'velocity')
    return Cycle(to_nanoseconds(message.header.stamp), q_ref, dq)


@dataclass(frozen=True)
class Judge:
    """Knows arm, law and limits, and says what commands come to.

    Args:
        model: The arm.
        law: In force.
        limits: In force.
        period: Sampling time [s].
        rows: How many rows of the Jacobian the task has, 3 or 6.
    """

    model: RobotModel
    law: Law
    limits: Limits
    period: float
    rows: int = 3

    def figures(self, q: np.ndarray, cycles: list[Cycle], asked: float) -> Figures:
        """The figures of the newest of some cycles, two at least.

        Args:
            q: Measured positions, (n,) [rad].
            cycles: In their order.
            asked: The speed of the tip that the task asked for at the newest one [m/s].
        """
        before = cycles[-2]
        now = cycles[-1]
        state = self.model.state(q, before.dq)
        J = state.J[: self.rows]
        elapsed = max((now.stamp - before.stamp) / 1e9, self.period)
        W = self.law.weight(state)
        scaling = _share(asked, state.J[:3] @ now.dq)
        command = Command(
            now.dq, now.q_ref, state, elapsed, J, W, scaling, limiting='', lost=np.zeros(len(J))
        )
        dq = np.array([cycle.dq for cycle in cycles])  # (N, n)
        gaps = np.diff([cycle.stamp for cycle in cycles]) / 1e9  # (N - 1,) [s]
        ddq = np.diff(dq, axis=0) / np.maximum(gaps, self.period)[:, None]
        return Figures(
            time=now.stamp / 1e9,
            speed=float(np.linalg.norm(dq, axis=1).max()),
            acceleration=float(np.linalg.norm(ddq, axis=1).max()),
            null_speed=float(np.linalg.norm(command.null)),
            torque=float(np.linalg.norm(command.tau)),
            singular_value=command.min_singular_value,
            scaling=scaling,
        )

    def acting(self, before: Cycle, now: Cycle) -> set[tuple[str, str]]:
        """The limits at whose bounds a command is: name, and joint or what else it is about.

        Args:
            before: The cycle before.
            now: That of the command.
        """
        state = self.model.state(before.q_ref, before.dq)
        bounds = self.limits.at(state, self.period)
        touched: list[tuple[Limit, int]] = []
        for box_limit, box in zip(bounds.box_limits, bounds.boxes, strict=True):
            touched += [(box_limit, joint) for joint in _touched(now.dq, *box)]
        for row_limit, (C, low, high) in zip(bounds.row_limits, bounds.rows, strict=True):
            touched += [(row_limit, row) for row in _touched(C @ now.dq, low, high)]
        return {(limit_name(limit), limit.place(state, index)) for limit, index in touched}


def _share(asked: float, dx: np.ndarray) -> float:
    """How much of a speed [m/s] a velocity dx (3,) [m/s] is, 0 to 1; 1 where next to none is asked.

    Args:
        asked: The speed that was asked for [m/s].
        dx: The velocity that is commanded, (3,) [m/s].
    """
    if asked < _STILL:
        return 1.0
    return min(float(np.linalg.norm(dx)) / asked, 1.0)


def _touched(values: np.ndarray, lower: np.ndarray, upper: np.ndarray) -> list[int]:
    """Which values are at, or beyond, one of their bounds."""
    room = np.minimum(values - lower, upper - values)
    return np.flatnonzero(room < _TOUCHING).tolist()
