"""The command of a tick, and its figures for recordings and topics."""

import math
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np

from redres_ros.resolution import ResistingLimit, Weight, resolve_one
from redres_ros.robot_model import RobotState


class Command(NamedTuple):
    """The command of a tick. Figures for recordings and topics are computed on request.

    Attributes:
        dq: Joint velocity, (n,) [rad/s].
        q_ref: Position reference, (n,) [rad].
        state: The state it responds to.
        T: Sampling time [s].
        J: Jacobian of the first task, (m, n).
        W: Weight of the law.
        s: Task scaling: the fraction of dx that the limits allow.
        unachieved: The part of dx that a singularity blocks, (m,).
        component_scaling: The fraction of each component of dx, translation and rotation, that the
            limits allow, if they are scaled separately; else empty.
        active_limit: The limit that resists hardest; None if none does.
    """

    dq: np.ndarray
    q_ref: np.ndarray
    state: RobotState
    T: float
    J: np.ndarray
    W: Weight
    s: float
    unachieved: np.ndarray
    component_scaling: tuple[float, ...] = ()
    active_limit: ResistingLimit | None = None

    @property
    def active_limits(self) -> str:
        """The most active limit as 'joint: limit'; empty if none is active."""
        return self.active_limit.name if self.active_limit else ''

    @property
    def escape(self) -> np.ndarray | None:
        """Joint velocity away from the most active limit, (n,), of any length; None if none is
        active.
        """
        return self.active_limit.escape if self.active_limit else None

    @property
    def null(self) -> np.ndarray:
        """The null-space term of Eq. (2), (n,) [rad/s].

        It is P dq, which is P b: P J_W^# = 0.
        """
        null, _ = resolve_one(self.J, np.zeros(len(self.J)), self.dq, self.W)
        return null

    @property
    def ddq(self) -> np.ndarray:
        """Joint acceleration (dq_k - dq_{k-1}) / T, (n,) [rad/s^2], Eq. (13)."""
        return (self.dq - self.state.dq_prev) / self.T

    @property
    def tau(self) -> np.ndarray:
        """Joint torque M(q_k) ddq_k + n(q_k, dq_{k-1}), (n,) [Nm], Eq. (6)."""
        return self.state.M @ self.ddq + self.state.n

    @property
    def min_singular_value(self) -> float:
        """Smallest singular value of the task Jacobian."""
        return float(np.linalg.svd(self.J, compute_uv=False)[-1])


def norm(vector: np.ndarray) -> float:
    """Euclidean norm of a vector (n,): as np.linalg.norm, to the bit, at a quarter of its cost."""
    return math.sqrt(vector.dot(vector))


def norms(vectors: Any) -> np.ndarray:
    """Euclidean norms of vectors (N, n), (N,)."""
    rows = np.asarray(vectors)
    return np.sqrt(np.einsum('ki,ki->k', rows, rows))


# By the names of columns and topics. All norms are Euclidean.
FIGURES: dict[str, Callable[[Command], float]] = {
    'joint_velocity_norm': lambda command: norm(command.dq),
    'joint_acceleration_norm': lambda command: norm(command.ddq),
    'null_velocity_norm': lambda command: norm(command.null),
    'joint_torque_norm': lambda command: norm(command.tau),
    'min_singular_value': lambda command: command.min_singular_value,
    'task_scaling': lambda command: command.s,
}
