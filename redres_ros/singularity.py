"""Singularities of the first task: how the arm leaves one, and how it brakes before the end of its
reach. How it moves beside one is in resolution.py: lost directions are damped.

Leaving. In the stretched arm no joint velocity moves the tip along the arm: J dq = dx has no part
in that direction u. But to second order a self-motion dq = z does: with H = sum_c u_c dJ_c/dq,

    u' ddx = z' H z,

and so the self-motion that takes the tip along u the most is the eigenvector of H, within the null
space, that belongs to the largest eigenvalue. If none is positive, there is no escape, as for
the outward direction of the stretched arm.

Braking. Beside the stretched arm a tip speed rho along the arm takes joint speeds of rho / sigma,
where sigma is the singular value of u. With v the joint motion that belongs to it, and

    h = -v' H v,

sigma becomes smaller by h a radian, so that the joints have to accelerate by h rho^2 / sigma^3.
Where that is more than they can, they cannot keep the tip at its speed any further. Nor could they
stop where the arm is stretched: it would bend to the other side, and back, again and again. They
can from

    rho <= sqrt(a sigma^3 / h),

braking with a / 2; a is the acceleration along v at which the first joint is at its limit. This
speed is faded out, to zero at half of the sigma from which on it counts: there the joints come to
rest, before they are bent to the other side. The rest of rho is lost; other directions are not.
"""

from dataclasses import replace
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from redres_ros.kernels.closed_form import SINGULAR_RATIO, is_far
from redres_ros.resolution import Level, Solution, resolve_one
from redres_ros.types import (
    Jacobian,
    JacobianDerivatives,
    JointAccelerations,
    JointVelocities,
    TaskVelocity,
)

if TYPE_CHECKING:
    from redres_ros.robot_model import RobotState
    from redres_ros.tasks import Task

# of the threshold below which a direction is damped: above it, the damped motion escapes
_STUCK = 0.1
# fraction of a task velocity; where less can be executed, its components lock each other
_LOCKED = 0.2
_NOTHING = 1e-9  # of dx, counts as zero; of H, is no escape
# of the curvature towards the end; a self-motion that bends less the other way leads nowhere
_NO_ESCAPE = 0.1


def locked(executed: float) -> float:
    """How far a task velocity counts as locked, if this fraction of it can be executed.

    1 if none can be, 0 from a fifth on, continuous between: what replaces it is blended in.
    """
    return max(1.0 - executed / _LOCKED, 0.0)


def escape(
    state: 'RobotState', task: 'Task', J: Jacobian, dx: TaskVelocity
) -> JointVelocities | float:
    """The self-motion that leads out of a singularity of a task as fast as that demands, in the
    sense of the last command; 0 if none is needed or known.
    """
    scale = task.row_scale(state.model)
    if scale is None:
        scale = np.full(len(dx), 1.0 / state.model.reach)
    dx = scale * dx
    U, s, Vt = np.linalg.svd(scale[:, None] * J)
    e = SINGULAR_RATIO * s[0]
    if e == 0.0:
        return 0.0
    kept = int(np.count_nonzero(s >= e))
    stuck = np.maximum(1.0 - s[kept:] / (_STUCK * e), 0.0)  # 1 at the singularity
    lost = U[:, kept : len(s)]
    asked = lost.dot(stuck * lost.T.dot(dx))  # (m,)
    size = float(np.linalg.norm(asked))
    dJ = task.derivatives(state) if size > _NOTHING * float(np.linalg.norm(dx)) else None
    if dJ is None:
        return 0.0
    H = np.dot(scale * asked, dJ)  # (n, n)
    Z = Vt[kept:].T  # (n, n - kept)
    curvatures, directions = np.linalg.eigh(Z.T.dot(H + H.T).dot(Z))  # twice those of H
    if curvatures[-1] <= _NOTHING * float(np.linalg.norm(H)):
        return 0.0
    z: JointVelocities = Z.dot(directions[:, -1])
    sense = z.dot(state.dq_prev) or z[np.argmax(np.abs(z))]
    return np.copysign(size, sense) * z


class _EndOfReach(NamedTuple):
    """Directions of a task in which the arm nears its end too fast, and the others."""

    ended: np.ndarray  # (k, m) orthonormal rows
    others: np.ndarray  # (m - k, m) orthonormal rows
    most: np.ndarray  # (k,) the speed from which the arm can stop in the ended ones


def brake_before_end(
    free: Solution,
    level: Level,
    task: 'Task',
    state: 'RobotState',
    ddq_max: JointAccelerations,
    near: float,
    rows: slice = slice(None),
) -> tuple[Solution, Level]:
    """The solution without what nears the end too fast, and the level of the directions that go on.

    If an ending direction were a level, joints that hardly move the tip along it would
    accelerate as hard as they may for its sake, and swing.

    Args:
        level: J and the executed dx of the first task, with comparable rows.
        near: Fraction of the largest singular value below which a direction is beside its end.
            Farther off, limits make the arm slower on its path, and it may well stop in time.
        rows: Of the task, that must not be too fast; the others give way.
    """
    J, executed = level
    J = J[rows]
    executed = executed[rows]
    dJ = None if is_far(J, near) else task.derivatives(state)
    if dJ is None:
        return free, level
    dx = free.desired
    scale = task.row_scale(state.model)
    if scale is not None:
        dJ = scale[:, None] * dJ
        dx = scale * dx
    end = end_of_reach(J, dJ[:, rows], dx[rows], ddq_max, near)
    if end is None:
        return free, level
    rho = end.ended.dot(executed)
    excess = end.ended.T.dot(rho - np.clip(rho, -end.most, end.most))  # (m,)
    less, _ = resolve_one(J, excess, np.zeros(len(free.dq)), free.W)
    dq = free.dq - less
    unachieved = free.desired - free.J.dot(dq)
    stopped = replace(free, dq=dq, executed=free.J.dot(dq), unachieved=unachieved)
    return stopped, (end.others.dot(J), end.others.dot(J.dot(dq)))


def end_of_reach(
    J: Jacobian, dJ: JacobianDerivatives, dx: TaskVelocity, ddq_max: JointAccelerations, near: float
) -> _EndOfReach | None:
    """Directions in which the arm could not stop at its end, of comparable rows, or None."""
    U, s, Vt = np.linalg.svd(J)
    rho = U.T.dot(dx)  # (m,)
    most = np.full(len(rho), np.inf)
    is_asked = np.abs(rho) > _NOTHING * np.linalg.norm(dx)
    for i in range(len(s)):
        if is_asked[i] and s[i] < near * s[0]:
            H = np.dot(np.copysign(1.0, rho[i]) * U[:, i], dJ)  # (n, n)
            most[i] = _fastest(i, (H + H.T) / 2.0, s, Vt, ddq_max, near)
    is_ended = np.abs(rho) > most
    if not is_ended.any():
        return None
    return _EndOfReach(U.T[is_ended], U.T[~is_ended], most[is_ended])


def _fastest(
    i: int, H: np.ndarray, s: np.ndarray, Vt: np.ndarray, ddq_max: JointAccelerations, near: float
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
    if curvatures[-1] > -_NO_ESCAPE * curvatures[0]:
        return np.inf  # a self-motion leads on
    a = float((ddq_max / np.maximum(np.abs(v), _NOTHING)).min())
    fade = max(2.0 * s[i] / (near * s[0]) - 1.0, 0.0)
    return fade * float(np.sqrt(a * s[i] ** 3 / h))
