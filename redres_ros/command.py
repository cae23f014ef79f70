"""The command of a tick, and its values for recordings and topics."""

import math
from collections.abc import Callable
from dataclasses import dataclass
from operator import attrgetter
from typing import Any

import numpy as np

from redres_ros.resolution import Solution, resolve_one
from redres_ros.robot_model import RobotState
from redres_ros.types import (
    JointAccelerations,
    JointPositions,
    JointTorques,
    JointVelocities,
    Seconds,
    TaskVelocity,
)


@dataclass(slots=True)  # made in every tick
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

    @property
    def unachieved(self) -> TaskVelocity:
        """The part of dx that a singularity blocks."""
        unachieved = self.solution.unachieved
        return np.zeros(len(self.J)) if unachieved is None else unachieved

    @property
    def active_limits(self) -> str:
        """The limit that resists hardest, as 'joint: limit'; empty if none does."""
        return self.active_limit.name if self.active_limit else ''

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
        return self.state.M @ self.ddq + self.state.n

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
