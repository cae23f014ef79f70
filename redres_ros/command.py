"""The command of a tick, its values for recordings and topics, and where a robot is without one."""

import math
from collections.abc import Callable
from dataclasses import dataclass
from operator import attrgetter
from typing import Any

import numpy as np

from redres_ros.resolution import Solution, resolve_one
from redres_ros.robot_model import RobotState
from redres_ros.types import (
    Cycles,
    JointAccelerations,
    JointPositions,
    JointTorques,
    JointVelocities,
    Radians,
    Seconds,
    TaskVelocity,
)

HOLD = 'hold'


@dataclass(slots=True, repr=False)  # made in every tick
class Command:
    """A solution and the position reference that it leads to. Other values are computed on request.

    Attributes:
        solution: The joint velocity, and how far it executes the tasks.
        state: The state that it responds to.
    """

    solution: Solution
    q_ref: JointPositions
    state: RobotState
    T: Seconds

    dq = property(attrgetter('solution.dq'))
    J = property(attrgetter('solution.J'))
    W = property(attrgetter('solution.W'))
    s = property(attrgetter('solution.s'))
    component_scaling = property(attrgetter('solution.component_scaling'))
    active_limit = property(attrgetter('solution.active_limit'))

    def __repr__(self) -> str:
        """Three lines for a person."""
        with np.printoptions(precision=4, suppress=True, linewidth=200):
            motion = f'dq {self.dq} rad/s\nq_ref {self.q_ref} rad'
        return f'{motion}\ns {self.s:.4g}, limited by {self.active_limits or "nothing"}'

    @property
    def unachieved(self) -> TaskVelocity:
        """The part of dx that a singularity blocks."""
        unachieved = self.solution.unachieved
        return np.zeros(len(self.J)) if unachieved is None else unachieved

    @property
    def active_limits(self) -> str:
        """The limit that resists hardest, as 'joint: limit'; empty if none does."""
        return self.active_limit() if self.active_limit else ''

    @property
    def null(self) -> JointVelocities:
        """The null-space term of Eq. (2), P dq; it is P b, for P J_W^# = 0."""
        null, _ = resolve_one(self.J, np.zeros(len(self.J)), self.dq, self.W)
        return null

    @property
    def ddq(self) -> JointAccelerations:
        """(dq_k - dq_{k-1}) / T, Eq. (13)."""
        return (self.dq - self.state.dq_prev) / self.T

    @property
    def tau(self) -> JointTorques:
        """M(q_k) ddq_k + n(q_k, dq_{k-1}), Eq. (6)."""
        state = self.state
        return state.model.torque(state.q, state.dq_prev, self.ddq)

    @property
    def min_singular_value(self) -> float:
        """Of the task Jacobian."""
        return float(np.linalg.svd(self.J, compute_uv=False)[-1])


def norm(vector: np.ndarray) -> float:
    """Euclidean norm of a vector (n,): as np.linalg.norm, to the bit, at a quarter of its cost."""
    return math.sqrt(vector.dot(vector))


def norms(vectors: Any) -> np.ndarray:
    """Euclidean norms of vectors (N, n), (N,)."""
    rows = np.asarray(vectors)
    return np.sqrt(np.einsum('ki,ki->k', rows, rows))


# By the names of columns and topics. All norms are Euclidean.
VALUES: dict[str, Callable[[Command], float]] = {
    'joint_velocity_norm': lambda command: norm(command.dq),
    'joint_acceleration_norm': lambda command: norm(command.ddq),
    'null_velocity_norm': lambda command: norm(command.null),
    'joint_torque_norm': lambda command: norm(command.tau),
    'min_singular_value': lambda command: command.min_singular_value,
    'task_scaling': lambda command: command.s,
}


@dataclass(slots=True)  # made in every tick
class Published:
    """The last reference, from which the robot and the next reference continue.

    Attributes:
        command: The velocity that was commanded; another one than dq, that of the reference, only
            if references are integrated from measurements.
        plan: What a law that looks ahead has planned from there.
    """

    q: JointPositions
    dq: JointVelocities
    ddq: JointAccelerations
    command: JointVelocities
    plan: Any = None

    @classmethod
    def at_rest(cls, q: JointPositions) -> 'Published':
        """A reference without velocity."""
        zeros = np.zeros(len(q))
        return cls(q, zeros, zeros, zeros)


@dataclass(frozen=True)
class RobotInterface:
    """What a kind of robot does. What follows from that is stated here, and not set for each robot.

    Attributes:
        bridging: What it does in a cycle without a command: 'hold' the last one, or continue at
            constant 'velocity' or 'acceleration'.
        lost: Commands that may get lost until three in a row have come, whose bridging at constant
            acceleration must not look like a jerk to the robot.
        restart_after: Cycles without a state after which it restarts from the measured position.
        following_tolerance: Following error at which an arm counts as stopped.
        patience: How long its clock waits for a late command.
        forwards_commands: Commands also go to forward_position_controller/commands.
    """

    bridging: str
    lost: Cycles = 0
    restart_after: Cycles = 5
    following_tolerance: Radians = 0.1
    patience: Seconds = 0.0
    forwards_commands: bool = False

    @property
    def holds(self) -> bool:
        """Whether the robot stays at its last command."""
        return self.bridging == HOLD

    def bridged(
        self,
        published: Published,
        missed: Cycles,
        q_range: tuple[JointPositions, JointPositions],
        T: Seconds,
    ) -> Published:
        """Where the robot is, `missed` cycles after the last reference, as if that was published.

        One that extrapolates stops at the ends of its range.
        """
        if not missed:
            return published
        q = published.q
        dq = published.dq
        ddq = published.ddq
        command = published.command
        zeros = np.zeros(len(q))
        if self.holds:
            return Published(q, zeros, zeros, command, published.plan)
        if self.bridging == 'velocity' or not dq.any():
            ddq = zeros
        ahead = q + T * missed * (dq + T * (missed + 1) / 2.0 * ddq)
        q_min, q_max = q_range
        stopped = np.clip(ahead, np.minimum(q_min, q), np.maximum(q_max, q))
        dq_ahead = np.where(stopped == ahead, dq + T * missed * ddq, 0.0)
        return Published(stopped, dq_ahead, ddq, command, published.plan)


ROBOT_INTERFACES: dict[str, RobotInterface] = {
    'fri': RobotInterface('velocity'),
    'fci': RobotInterface('acceleration', lost=3, restart_after=19),
    'ros2_control': RobotInterface(HOLD, forwards_commands=True),
    'sim': RobotInterface('velocity', patience=5.0),  # the node sim, whose clock waits
}
