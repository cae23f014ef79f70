"""The end of the reach, under limits: how fast the arm may go towards it.

Beside the stretched arm a tip speed rho along the arm takes joint speeds of rho / sigma, where
sigma is the singular value of that direction u. With v the joint motion that belongs to it, and

    h = -v' H v,    H = sum_c u_c dJ_c/dq,

sigma becomes smaller by h a radian, so that the joints have to accelerate by h rho^2 / sigma^3.
Where that is more than they can, they cannot keep the tip at its speed any further. Nor could they
stop where the arm is stretched: it would bend to the other side, and back, again and again. They
can from

    rho <= sqrt(a sigma^3 / h),

braking with a / 2; a is the acceleration along v at which the first joint is at its limit. This
speed is faded out, to zero at half of the sigma from which on it counts: there the joints come to
rest, before they are bent to the other side. The rest of rho is lost, and the other directions go
on as ever.
"""

from dataclasses import replace
from typing import NamedTuple

import numpy as np

from redres_ros.kernels.closed_form import SINGULAR_RATIO, is_far
from redres_ros.resolution import Level, Solution, resolve_one
from redres_ros.robot_model import RobotModel, RobotState
from redres_ros.tasks import Task

_NOTHING = 1e-9  # of dx, is not asked for
# of the curvature towards the end; a self-motion that bends less the other way is no way on
_NO_WAY = 0.1


class _EndOfReach(NamedTuple):
    """Directions of a task in which the arm nears its end too fast, and the others.

    Attributes:
        ended: (k, m) orthonormal rows.
        others: (m - k, m) orthonormal rows.
        most: (k,) the speed from which the arm can stop in the ended ones.
    """

    ended: np.ndarray
    others: np.ndarray
    most: np.ndarray


def end_of_reach(
    J: np.ndarray, dJ: np.ndarray, dx: np.ndarray, ddq_max: np.ndarray, near: float
) -> _EndOfReach | None:
    """The directions in which the arm would be too fast to stop at the end of its reach, or None.

    Args:
        J: (m, n) Jacobian of the task, with comparable rows.
        dJ: (n, m, n) its derivatives by each joint.
        dx: (m,) the task velocity.
        ddq_max: (n,) [rad/s^2] the acceleration limits.
        near: Fraction of the largest singular value below which a direction is beside its end.
    """
    U, s, Vt = np.linalg.svd(J)
    rho = U.T.dot(dx)  # (m,)
    most = np.full(len(rho), np.inf)
    is_asked = np.abs(rho) > _NOTHING * np.linalg.norm(dx)
    for i in range(len(s)):
        if is_asked[i] and s[i] < near * s[0]:
            H = np.einsum('c,icj->ij', np.copysign(1.0, rho[i]) * U[:, i], dJ)  # (n, n)
            most[i] = _fastest(i, (H + H.T) / 2.0, s, Vt, ddq_max, near)
    is_ended = np.abs(rho) > most
    if not is_ended.any():
        return None
    return _EndOfReach(U.T[is_ended], U.T[~is_ended], most[is_ended])


def _fastest(
    i: int, H: np.ndarray, s: np.ndarray, Vt: np.ndarray, ddq_max: np.ndarray, near: float
) -> float:
    """The speed from which the arm can stop before direction i ends, infinite where it does not, by
    the curvature H (n, n) of the path there, and the singular values s (k,) and vectors Vt (n, n).
    """
    v = Vt[i]
    h = -float(v.dot(H).dot(v))
    if h <= 0.0:
        return np.inf
    is_free = np.ones(len(Vt), bool)
    is_free[: len(s)] = s < SINGULAR_RATIO * s[0]
    is_free[i] = True
    Z = Vt[is_free]  # joint motions that leave the other directions alone
    curvatures = np.linalg.eigvalsh(Z.dot(H).dot(Z.T))
    if curvatures[-1] > -_NO_WAY * curvatures[0]:
        return np.inf  # a self-motion leads on
    a = float((ddq_max / np.maximum(np.abs(v), _NOTHING)).min())
    fade = max(2.0 * s[i] / (near * s[0]) - 1.0, 0.0)
    return fade * float(np.sqrt(a * s[i] ** 3 / h))


class BoundaryBraking:
    """Brakes the arm before the end of its reach: what leads there too fast is lost.

    Args:
        task: The first one.
        model: The arm.
        ddq_max: (n,) [rad/s^2] the acceleration limits.
        near: Fraction of the largest singular value below which a direction is beside its end.
            Farther off, limits make the arm slower on its path, and it may well stop in time.
    """

    def __init__(self, task: Task, model: RobotModel, ddq_max: np.ndarray, near: float) -> None:
        self._task = task
        self._scale = task.row_scale(model)
        self._ddq_max = ddq_max
        self._near = near

    def applied(
        self, free: Solution, level: Level, state: RobotState, rows: slice = slice(None)
    ) -> tuple[Solution, Level]:
        """The solution without what is too fast, and the level of the directions that go on.

        If an ending direction were a level, joints that hardly move the tip along it would
        accelerate as hard as they may for its sake, and swing.

        Args:
            free: Without limits.
            level: J (m, n) and the executed dx (m,) of the first task, with comparable rows.
            state: Of the arm at this tick.
            rows: Of the task, that must not be too fast; the others give way.
        """
        J, executed = level
        J = J[rows]
        executed = executed[rows]
        end = self._end(free, J, state, rows)
        if end is None:
            return free, level
        rho = end.ended.dot(executed)
        excess = end.ended.T.dot(rho - np.clip(rho, -end.most, end.most))  # (m,)
        less, _ = resolve_one(J, excess, np.zeros(len(free.dq)), free.W)
        dq = free.dq - less
        unachieved = free.wanted - free.J.dot(dq)
        stopped = replace(free, dq=dq, executed=free.J.dot(dq), unachieved=unachieved)
        return stopped, (end.others.dot(J), end.others.dot(J.dot(dq)))

    def _end(
        self, free: Solution, J: np.ndarray, state: RobotState, rows: slice
    ) -> _EndOfReach | None:
        if is_far(J, self._near):
            return None
        dJ = self._task.derivatives(state)
        if dJ is None:
            return None
        dx = free.wanted
        if self._scale is not None:
            dJ = self._scale[:, None] * dJ
            dx = self._scale * dx
        return end_of_reach(J, dJ[:, rows], dx[rows], self._ddq_max, self._near)
