"""The original schemes on the acceleration and torque level, sampled: the yardsticks of the
velocity laws.

Written as the paper states them, with explicit pseudoinverses and the arm's forward dynamics
instead of `resolve`, so that a law and its scheme can only agree because the conversion is right. J
is taken to have full rank, as in Sections 3 and 4: unlike a law, a scheme damps nothing near a
singularity.
"""

from abc import ABC, abstractmethod
from dataclasses import dataclass

import numpy as np

from redres_ros.command import Command, norm
from redres_ros.errors import DivergedError, UnknownNameError
from redres_ros.policy import SPEED_LIMIT
from redres_ros.preferences import Preference
from redres_ros.resolution import Solution, Square, Weight
from redres_ros.robot_model import RobotModel, RobotState
from redres_ros.types import (
    Jacobian,
    JointAccelerations,
    JointPositions,
    JointTorques,
    JointVelocities,
    Seconds,
    TaskAcceleration,
    TaskVelocity,
)


@dataclass(frozen=True)
class Scheme(ABC):
    """A redundancy resolution scheme of second order: of all ddq with J ddq + dJ dq = ddx, Eq. (4),
    the best in a norm. Its dq is state.dq_prev, Eq. (10).
    """

    damping: float = 10.0  # k_d [1/s], in the null space
    preference: Preference | None = None  # a further preferred acceleration

    @abstractmethod
    def acceleration(
        self, model: RobotModel, state: RobotState, ddx: TaskAcceleration, dJ_dq: TaskAcceleration
    ) -> JointAccelerations:
        """ddq for a task acceleration ddx (m,) [m/s^2], of which dq alone brings about dJ_dq."""

    def metric(self, state: RobotState) -> Weight:
        """W, in which the scheme chooses among the ddq; None for the identity."""
        return None

    def preferred(self, state: RobotState) -> JointAccelerations:
        """ddq_N of Eq. (18): null-space damping -k_d dq, Eq. (21), and the preference."""
        ddq_N = -self.damping * state.dq_prev
        if self.preference is None:
            return ddq_N
        return ddq_N + self.preference.acceleration_in(state, self.metric(state))


@dataclass(frozen=True)
class MinimumAccelerationScheme(Scheme):
    """Least joint acceleration: Eq. (22), which is Eq. (16) for damping = 0 and Eq. (18) for
    another ddq_N.
    """

    def acceleration(
        self, model: RobotModel, state: RobotState, ddx: TaskAcceleration, dJ_dq: TaskAcceleration
    ) -> JointAccelerations:
        J_pinv = _pseudoinverse(state.J[:3])
        ddq_N = self.preferred(state)
        return J_pinv @ (ddx - dJ_dq) + ddq_N - J_pinv @ (state.J[:3] @ ddq_N)  # Eq. (18)


@dataclass(frozen=True)
class TorqueScheme(Scheme):
    """A scheme that commands tau; the arm's dynamics, Eq. (6), make ddq of it.

    Each chooses the tau nearest to tau_N = M ddq_N in a norm of its own. For ddq_N = -k_d dq that
    is Eq. (34), which opposes the generalized momentum M dq.
    """

    def acceleration(
        self, model: RobotModel, state: RobotState, ddx: TaskAcceleration, dJ_dq: TaskAcceleration
    ) -> JointAccelerations:
        return model.acceleration(state.q, state.dq_prev, self.torque(state, ddx, dJ_dq))

    @abstractmethod
    def torque(
        self, state: RobotState, ddx: TaskAcceleration, dJ_dq: TaskAcceleration
    ) -> JointTorques:
        """tau for a task acceleration; see acceleration()."""


@dataclass(frozen=True)
class _MinimumWeightedTorqueScheme(TorqueScheme):
    """Least torque in the norm of M^-2: Eq. (25), with damping as ddq_N in the null space, as in
    Eq. (18).
    """

    def torque(
        self, state: RobotState, ddx: TaskAcceleration, dJ_dq: TaskAcceleration
    ) -> JointTorques:
        J = state.J[:3]
        M = state.M
        J_pinv = _pseudoinverse(J)
        ddq_N = self.preferred(state)
        tau = M @ (J_pinv @ (ddx - dJ_dq + J @ np.linalg.solve(M, state.n)))  # Eq. (25)
        return tau + M @ (ddq_N - J_pinv @ (J @ ddq_N))  # M P ddq_N


@dataclass(frozen=True)
class _DynamicallyConsistentScheme(TorqueScheme):
    """Least torque in the norm of M^-1: Eq. (29) with tau_N of Eq. (34)."""

    def torque(
        self, state: RobotState, ddx: TaskAcceleration, dJ_dq: TaskAcceleration
    ) -> JointTorques:
        J = state.J[:3]
        M = state.M
        tau_N = M @ self.preferred(state)  # Eq. (34)
        drive = ddx - dJ_dq + J @ np.linalg.solve(M, state.n)  # (m,)
        Minv_JT = np.linalg.solve(M, J.T)  # (n, m)
        force = np.linalg.solve(J @ Minv_JT, drive)  # (m,)
        JT_pinv = np.linalg.solve(J @ Minv_JT, Minv_JT.T)  # Eq. (30), (m, n)
        return J.T @ force + tau_N - J.T @ (JT_pinv @ tau_N)  # Eq. (29)

    def metric(self, state: RobotState) -> Weight:
        return state.M


@dataclass(frozen=True)
class _MinimumTorqueScheme(TorqueScheme):
    """Least torque in the plain norm: Eq. (7), and tau_N of Eq. (34) in the null space of J M^-1,
    (A.13) with y = tau.

    This is what the law's bias stands for: with T ddq = dq_k - dq_{k-1} and b = (1 - k_d T)
    dq_{k-1} - T M^-1 n, Eq. (6) gives M (dq_k - b) = T (tau + k_d M dq_{k-1}), so that |dq_k - b|
    in the norm of M^2 is T |tau - tau_N|.
    """

    def torque(
        self, state: RobotState, ddx: TaskAcceleration, dJ_dq: TaskAcceleration
    ) -> JointTorques:
        A = np.linalg.solve(state.M, state.J[:3].T).T  # J M^-1, (m, n)
        A_pinv = _pseudoinverse(A)
        tau_N = state.M @ self.preferred(state)
        tau = A_pinv @ (ddx - dJ_dq + A @ state.n)  # Eq. (7)
        return tau + tau_N - A_pinv @ (A @ tau_N)

    def metric(self, state: RobotState) -> Weight:
        return Square(state.M)


# Each scheme has the name of the velocity law that is made from it. Laws of first order have none.
SCHEMES: dict[str, type[Scheme]] = {
    'minimum_acceleration': MinimumAccelerationScheme,
    'minimum_weighted_torque': _MinimumWeightedTorqueScheme,
    'dynamically_consistent': _DynamicallyConsistentScheme,
    'minimum_torque': _MinimumTorqueScheme,
}


def make_scheme(name: str, damping: float = 10.0, preference: Preference | None = None) -> Scheme:
    """The scheme that the law of that name was made from. Raises UnknownNameError."""
    if name not in SCHEMES:
        raise UnknownNameError('scheme of second order', name, SCHEMES)
    return SCHEMES[name](damping, preference)


class SecondOrderController:
    """Turns task velocities into joint velocities by a scheme of second order, sampled and
    integrated. Used like a Controller for a position task; before the first update all is at rest.
    """

    def __init__(self, model: RobotModel, scheme: Scheme, T: Seconds) -> None:
        self.model = model
        self.scheme = scheme
        self.T = T
        self.m = 3
        self._last: Command | None = None
        self._dx_prev = np.zeros(3)

    def update(self, q: JointPositions, dx: TaskVelocity) -> Command:
        """The command at a tick. Raises DivergedError beyond SPEED_LIMIT."""
        last = self._last
        state = self.model.state(q, np.zeros(self.model.n) if last is None else last.dq)
        J_prev = state.J[:3] if last is None else last.state.J[:3]
        dq = step(self.model, self.scheme, self.T, state, J_prev, dx, self._dx_prev)
        if norm(dq) > SPEED_LIMIT:
            raise DivergedError(norm(dq), SPEED_LIMIT, 'the scheme')
        q_ref = (state.q if last is None else last.q_ref) + self.T * dq  # footnote 1
        W = self.scheme.metric(state)
        self._last = Command(Solution(dq, state.J[:3], dx, W=W), q_ref, state, self.T)
        self._dx_prev = dx
        return self._last


def step(
    model: RobotModel,
    scheme: Scheme,
    T: Seconds,
    state: RobotState,
    J_prev: Jacobian,
    dx: TaskVelocity,
    dx_prev: TaskVelocity,
) -> JointVelocities:
    """dq_k by a scheme, from the state (q_k, dq_{k-1}), J_{k-1}, dx_k and dx_{k-1}."""
    ddx = (dx - dx_prev) / T  # Eq. (8)
    dJ = (state.J[:3] - J_prev) / T  # Eq. (9)
    ddq = scheme.acceleration(model, state, ddx, dJ @ state.dq_prev)  # with dq by Eq. (10)
    return state.dq_prev + T * ddq  # Eq. (13)


def _pseudoinverse(A: np.ndarray) -> np.ndarray:
    """A^# = A' (A A')^-1, (n, m), of a matrix A (m, n) of full rank."""
    return np.linalg.solve(A @ A.T, A).T
