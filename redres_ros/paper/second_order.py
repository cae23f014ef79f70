"""The original schemes on the acceleration and torque level, sampled: the yardsticks of the
velocity laws.

Written as the paper states them, with explicit pseudoinverses and the arm's forward dynamics
instead of `resolve`, so that a law and its scheme can only agree because the conversion is right. J
is taken to have full rank, as in Sections 3 and 4: unlike a law, a scheme damps nothing near a
singularity.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from redres_ros.command import Command, norm
from redres_ros.errors import DivergedError, UnknownNameError
from redres_ros.laws import LAWS
from redres_ros.policy import SPEED_LIMIT
from redres_ros.preferences import Preference
from redres_ros.preview import Preview
from redres_ros.resolution import Solution, Weight
from redres_ros.robot_model import RobotModel, RobotState
from redres_ros.types import (
    Jacobian,
    JointAccelerations,
    JointPositions,
    JointVelocities,
    Seconds,
    TaskAcceleration,
    TaskVelocity,
)


@dataclass(frozen=True)
class Scheme:
    """A redundancy resolution scheme of second order: of all ddq with J ddq + dJ dq = ddx, Eq. (4),
    the best in a norm. Its dq is state.dq_prev, Eq. (10). Raises UnknownNameError.
    """

    law: str  # the velocity law that is made from it
    damping: float = 10.0  # k_d [1/s], in the null space
    preference: Preference | None = None  # a further preferred acceleration

    def __post_init__(self) -> None:
        if self.law not in SCHEMES:
            raise UnknownNameError('scheme of second order', self.law, SCHEMES)

    def acceleration(
        self, state: RobotState, ddx: TaskAcceleration, dJ_dq: TaskAcceleration
    ) -> JointAccelerations:
        """ddq for a task acceleration ddx (m,) [m/s^2], of which dq alone brings about dJ_dq."""
        ddq_N = -self.damping * state.dq_prev  # Eq. (21)
        if self.preference is not None:
            ddq_N = ddq_N + self.preference.acceleration_in(state, self.metric(state))
        return SCHEMES[self.law](state, ddx - dJ_dq, ddq_N)

    def step(
        self, state: RobotState, J_prev: Jacobian, ddx: TaskAcceleration, T: Seconds
    ) -> JointVelocities:
        """dq_k from the state (q_k, dq_{k-1}), J_{k-1} and a task acceleration."""
        dJ = (state.J[:3] - J_prev) / T  # Eq. (9)
        ddq = self.acceleration(state, ddx, dJ @ state.dq_prev)  # with dq by Eq. (10)
        return state.dq_prev + T * ddq  # Eq. (13)

    def metric(self, state: RobotState) -> Weight:
        """W, in which the scheme chooses among the ddq; None for the identity."""
        return LAWS[self.law]().weight(state)


# --- ddq for J ddq = ddx - dJ dq, (m,), and a preferred ddq_N, (n,) -------------------------------


def _minimum_acceleration(state: RobotState, Jddq: np.ndarray, ddq_N: np.ndarray) -> np.ndarray:
    """Least joint acceleration: Eq. (22), which is Eq. (16) for ddq_N = 0."""
    J = state.J[:3]
    J_pinv = _pseudoinverse(J)
    return J_pinv @ Jddq + ddq_N - J_pinv @ (J @ ddq_N)  # Eq. (18)


# These choose the tau nearest to tau_N = M ddq_N in a norm of their own. For ddq_N = -k_d dq that
# is Eq. (34), which opposes the generalized momentum M dq.


def _minimum_weighted_torque(state: RobotState, Jddq: np.ndarray, ddq_N: np.ndarray) -> np.ndarray:
    """Least torque in the norm of M^-2: Eq. (25), with ddq_N in the null space, as in Eq. (18)."""
    J = state.J[:3]
    J_pinv = _pseudoinverse(J)
    tau = state.M @ (J_pinv @ (Jddq + J @ np.linalg.solve(state.M, state.n)))  # Eq. (25)
    return _driven(state, tau + state.M @ (ddq_N - J_pinv @ (J @ ddq_N)))  # M P ddq_N


def _dynamically_consistent(state: RobotState, Jddq: np.ndarray, ddq_N: np.ndarray) -> np.ndarray:
    """Least torque in the norm of M^-1: Eq. (29) with tau_N of Eq. (34)."""
    J = state.J[:3]
    tau_N = state.M @ ddq_N  # Eq. (34)
    drive = Jddq + J @ np.linalg.solve(state.M, state.n)  # (m,)
    Minv_JT = np.linalg.solve(state.M, J.T)  # (n, m)
    force = np.linalg.solve(J @ Minv_JT, drive)  # (m,)
    JT_pinv = np.linalg.solve(J @ Minv_JT, Minv_JT.T)  # Eq. (30), (m, n)
    return _driven(state, J.T @ force + tau_N - J.T @ (JT_pinv @ tau_N))  # Eq. (29)


def _minimum_torque(state: RobotState, Jddq: np.ndarray, ddq_N: np.ndarray) -> np.ndarray:
    """Least torque in the plain norm: Eq. (7), and tau_N of Eq. (34) in the null space of J M^-1.

    With b = (1 - k_d T) dq_{k-1} - T M^-1 n, Eq. (6) gives M (dq_k - b) = T (tau - tau_N): the law
    has the least |dq_k - b| in the norm of M^2.
    """
    A = np.linalg.solve(state.M, state.J[:3].T).T  # J M^-1, (m, n)
    A_pinv = _pseudoinverse(A)
    tau_N = state.M @ ddq_N
    tau = A_pinv @ (Jddq + A @ state.n)  # Eq. (7)
    return _driven(state, tau + tau_N - A_pinv @ (A @ tau_N))


def _driven(state: RobotState, tau: np.ndarray) -> np.ndarray:
    """ddq of the arm under a torque, (n,)."""
    return np.linalg.solve(state.M, tau - state.n)  # Eq. (6)


def _pseudoinverse(A: np.ndarray) -> np.ndarray:
    """A^# = A' (A A')^-1, (n, m), of a matrix A (m, n) of full rank."""
    return np.linalg.solve(A @ A.T, A).T


# Each scheme has the name of the velocity law that is made from it. Laws of first order have none.
SCHEMES: dict[str, Callable[[RobotState, np.ndarray, np.ndarray], np.ndarray]] = {
    'minimum_acceleration': _minimum_acceleration,
    'minimum_weighted_torque': _minimum_weighted_torque,
    'dynamically_consistent': _dynamically_consistent,
    'minimum_torque': _minimum_torque,
}


# --- sampled --------------------------------------------------------------------------------------


class SecondOrderController:
    """A scheme, sampled and integrated, used like a Controller of a position; at rest at first."""

    horizon: Seconds = 0.0

    def __init__(self, model: RobotModel, scheme: Scheme, T: Seconds) -> None:
        self.model = model
        self.T = T
        self.m = 3
        self._scheme = scheme
        self._last: Command | None = None
        self._dx_prev = np.zeros(3)

    def update(
        self, q: JointPositions, dx: TaskVelocity, *, ahead: Preview | None = None
    ) -> Command:
        """The command at a tick. Raises DivergedError beyond SPEED_LIMIT."""
        last = self._last
        state = self.model.state(q, np.zeros(self.model.n) if last is None else last.dq)
        J_prev = state.J[:3] if last is None else last.state.J[:3]
        ddx = (dx - self._dx_prev) / self.T  # Eq. (8)
        dq = self._scheme.step(state, J_prev, ddx, self.T)
        if norm(dq) > SPEED_LIMIT:
            raise DivergedError(norm(dq), SPEED_LIMIT, 'the scheme')
        q_ref = (state.q if last is None else last.q_ref) + self.T * dq  # footnote 1
        W = self._scheme.metric(state)
        self._last = Command(Solution(dq, state.J[:3], dx, W=W), q_ref, state, self.T)
        self._dx_prev = dx
        return self._last
