"""Redundancy resolution: of all joint velocities that execute a task, the one nearest to a bias in
a chosen norm; and the same for several tasks in order of priority.

The formula itself is compiled, in kernels/closed_form.py. This file adds tasks in
order of priority, damping near singularities, and errors that name their reason.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np

from redres_ros.errors import ArrayError
from redres_ros.kernels.closed_form import (
    FACTOR,
    IDENTITY,
    INCOMPLETE,
    INDEFINITE,
    NOT_FINITE,
    SINGULAR,
    SINGULAR_RATIO,
    SOLVED,
    SQUARE,
    WEIGHT,
    closed_form,
    fill_factor,
    solve_rows,
)
from redres_ros.types import FLOAT64, Jacobian, JointVelocities, TaskVelocity

# [rad/s] beyond which a direction of a lower task is dropped; several times what arms can do
_FASTEST = 100.0
# rows whose singular value is below this fraction are dependent: lower tasks may use the rest
_DEPENDENT_RATIO = 1e-9
# |c_i|^2 of a direction in which nothing is free to move; only keeps a division finite
_NO_FREEDOM = 1e-30
_NO_WEIGHT = np.zeros((0, 0))
_NO_LEVEL = None, None


class Factor:
    """A weight W = F'F that is known by its factor F (n, n), upper triangular.

    Solving with F twice keeps the digits that forming W would lose: its condition is the root of
    W's. np.asarray gives W itself.
    """

    form = FACTOR  # as kernels/closed_form.py calls it

    def __init__(self, F: np.ndarray) -> None:
        self.F = np.asarray(F, FLOAT64)
        self.shape = F.shape

    def solved(self, rows: np.ndarray, *, transposed: bool) -> np.ndarray:
        """F^-1 x, or F'^-1 x, for each of the rows x, (k, n)."""
        X = np.array(rows, np.float64, order='C')
        triangle = _cholesky(self.F) if self.form == SQUARE else self.F
        solve_rows(triangle, self.form, transposed, X)
        return X

    def __array__(self, dtype: np.dtype | None = None, copy: bool | None = None) -> np.ndarray:
        W: np.ndarray = self.F.T.dot(self.F)
        return W


class Square(Factor):
    """The weight W = M M; solving raises ArrayError unless M (n, n) is positive definite."""

    form = SQUARE


Weight = np.ndarray | Factor | None  # (n, n) symmetric positive definite; None for the identity
Level = tuple[Jacobian, TaskVelocity]  # of one task


@dataclass(slots=True)  # made in every tick: in two thirds of the time of a NamedTuple
class Solution:
    """The joint velocity of one tick."""

    dq: JointVelocities
    J: Jacobian  # of the first task
    executed: TaskVelocity  # the part of dx that dq is meant to execute
    unachieved: TaskVelocity | None = None  # that a singularity does not let through; None: nothing
    W: Weight = None
    levels: Sequence[Level] = ()  # all tasks in order, with comparable rows, if there are several
    scale: np.ndarray | None = None  # (m,), makes the rows of the first task comparable; None: are
    plan: Any = None  # of a law that looks ahead
    s: float = 1.0  # task scaling: the fraction of `executed` that limits allow
    active_limit: Callable[[], str] | None = None  # the name of the limit that resists hardest
    old: 'Solution | None' = None  # in a crossfade: that of the old motion
    # of `executed` along each component, translation and rotation, if scaled separately
    component_scaling: tuple[float, ...] = ()

    @property
    def desired(self) -> TaskVelocity:
        """dx."""
        return self.executed if self.unachieved is None else self.executed + self.unachieved


def resolve(J: Jacobian, dx: TaskVelocity, b: JointVelocities, W: Weight = None) -> JointVelocities:
    """The minimum of 1/2 (dq - b)' W (dq - b) subject to J dq = dx.

    Eq. (A.13) with y = dq, A = J, y_N = b; the rows of J are of one unit, or made comparable. Near
    a singularity of J, where the solution would be unbounded, the lost direction u is executed only
    in part: with s its singular value and e = SINGULAR_RATIO max(s) > s, the fraction s^2/e^2 of
    the motion that executes u, and the rest of the motion that does without it (end of Appendix A).
    The other directions are executed exactly.

    Raises ArrayError for shapes that do not fit, NaN or infinity, an indefinite W.
    """
    check_shapes(J, dx, b, W)
    if not 1 <= len(J) <= len(b):
        raise ArrayError(f'J has shape {J.shape}; expected (m, n) with 1 <= m <= n')
    dq, _ = resolve_one(J, dx, b, W)
    return dq


def resolve_in_order(
    levels: Sequence[Level], b: JointVelocities, W: Weight = None
) -> tuple[JointVelocities, bool]:
    """dq for tasks in order of priority, Eq. (20), and whether the first one is damped.

    Each task is executed as well as those before it allow, in their null space and in the metric of
    W; b acts in the null space that is left. Where tasks conflict, a lower one has no solution, and
    next to that one far too fast: a direction of it counts as lost, too, that would take more than
    FASTEST. Raises ArrayError as `resolve` does.
    """
    fastest = _FASTEST if len(levels) > 1 else math.inf
    return resolve_one(*levels[0], b, W, fastest=fastest, lower=levels[1:])


def resolve_one(
    J: Jacobian,
    dx: TaskVelocity,
    b: JointVelocities,
    W: Weight,
    size: float = 0.0,
    fastest: float = math.inf,
    lower: Sequence[Level] = (),
) -> tuple[JointVelocities, bool]:
    """As `resolve`, unchecked, also for m > n, above `lower` tasks; whether a direction was damped.

    Singular values are judged against the largest one of J, or against size if that is larger. A
    direction that takes more than `fastest` [rad/s] is damped as well. Raises ArrayError.
    """
    J_lower, dx_lower = stacked(lower, len(b)) if lower else _NO_LEVEL
    array, form = (None, IDENTITY) if W is None else as_array(W)
    if not (J.dtype is dx.dtype is b.dtype is FLOAT64 and J.ndim == 2):  # these are users'
        J, dx, b = (np.asarray(each, FLOAT64) for each in (J, dx, b))
        check_shapes(J, dx, b, W)
    dq = b.copy()
    outcome = closed_form(J, dx, J_lower, dx_lower, array, form, size, fastest, dq)
    if outcome == SOLVED:
        return dq, False
    if outcome == INDEFINITE:
        raise _indefinite(np.asarray(array))
    if outcome == SINGULAR:
        if lower:
            return _resolve_in_order_carefully([(J, dx), *lower], b, W)
        dq, damped = _resolve_carefully(J, dx, b, W, size, fastest)
        if math.isfinite(sum(dq.tolist())):
            return dq, damped
    if outcome in (NOT_FINITE, SINGULAR):
        raise ArrayError(_complaint(J, dx, b, W, dq))
    return dq, outcome == INCOMPLETE


def solve_weight(W: Weight, x: np.ndarray) -> np.ndarray:
    """W^-1 x, (n,)."""
    if W is None:
        return x
    if isinstance(W, Factor):
        return W.solved(W.solved(x[None], transposed=True), transposed=False)[0]
    return np.linalg.solve(W, x)


def stacked(levels: Sequence[Level], n: int) -> Level:
    """J and dx of all tasks, stacked, for n joints; of a single task its own arrays."""
    if len(levels) == 1:  # nothing to copy
        J, dx = levels[0]
        return np.asarray(J, FLOAT64), np.asarray(dx, FLOAT64)
    J = np.concatenate([np.zeros((0, n)), *(J for J, _ in levels)], dtype=FLOAT64)
    dx = np.concatenate([np.zeros(0), *(dx for _, dx in levels)], dtype=FLOAT64)
    return J, dx


def scaled(J: Jacobian, dx: TaskVelocity, scale: np.ndarray | None) -> Level:
    """J and dx with each row multiplied by its scale (m,); None for all by one."""
    if scale is None:
        return J, dx
    return scale[:, None] * J, scale * dx


def as_array(W: Weight) -> tuple[np.ndarray, int]:
    """The array of a weight, and its kind: IDENTITY, WEIGHT, FACTOR or SQUARE."""
    if W is None:
        return _NO_WEIGHT, IDENTITY
    if isinstance(W, Factor):
        return W.F, W.form
    return np.asarray(W, FLOAT64), WEIGHT


def _resolve_in_order_carefully(
    levels: Sequence[Level], b: JointVelocities, W: Weight
) -> tuple[JointVelocities, bool]:
    """As `resolve_in_order`, one task after the other, where not all can be executed exactly."""
    dq, damped = resolve_one(*levels[0], b, W)
    Z = np.eye(len(b))  # (n, k) null space of the tasks so far
    for (J_above, _), (J, dx) in pairwise(levels):
        Z = Z.dot(_null_space(J_above.dot(Z), float(np.linalg.norm(J_above, 2))))
        if not Z.shape[1]:
            break
        # What is left to do is judged from the slowest velocity that executes the tasks above. A
        # law may ask for joints far faster than that, as of a light wrist in the metric M M.
        z_b = Z.T.dot(dq)
        dq_least = dq - Z.dot(z_b)
        rest = dx - J.dot(dq_least)
        # A lower bound of the largest singular value of J, at most sqrt(m) times too small
        largest = float(np.linalg.norm(J)) / math.sqrt(len(J))
        z, _ = resolve_one(J.dot(Z), rest, z_b, _within(W, Z), largest, _FASTEST)
        dq = dq_least + Z.dot(z)
    return dq, damped


def _resolve_carefully(
    J: Jacobian, dx: TaskVelocity, b: JointVelocities, W: Weight, size: float, fastest: float
) -> tuple[JointVelocities, bool]:
    """b + J_W^# (dx - J b) by orthogonal transformations, damped near a singularity; whether it is.

    In the coordinates y = F (dq - b), W = F'F, each formula is the plain one, and what is left to
    do is r = dx - J b. The directions u_i of the task are those of J = U diag(s) V'; its rows in y
    are s_i c_i with c_i = v_i' F^-1. For the regular ones c_i y = u_i' r / s_i holds exactly. In
    what they leave, with C the rest of the lost c_i and S their s_i, the least y for S C y = rho
    gets a regularisation,

        y = C' S (S C C' S + diag(d))^-1 rho,   d_i = |c_i|^2 (e_i^2 - s_i^2),

    by which a lost direction is executed to the fraction s^2/e^2 and drops out for s = 0. With
    |u_i' dx| / fastest for e_i, if that is larger, none takes more than `fastest`.
    """
    if not np.isfinite(J).all():  # LAPACK may never come back from it
        return np.full_like(b, np.nan), False
    r = dx - J.dot(b)
    U, s, Vt = np.linalg.svd(J, full_matrices=False)
    rho = U.T.dot(r)
    e = np.maximum(SINGULAR_RATIO * max(s[0], size), np.abs(U.T.dot(dx)) / fastest)  # (k,)
    if not e.any():
        return b.copy(), True
    kept = s >= e
    is_damped = int(np.count_nonzero(kept)) < len(U)
    if W is None:  # all c_i are orthonormal
        return b + (s / np.maximum(s, e) ** 2 * rho).dot(Vt), is_damped
    factor = W if isinstance(W, Factor) else Factor(_cholesky(W))
    C = factor.solved(Vt, transposed=True)  # (k, n) rows c_i
    lost = ~kept
    Q, R = np.linalg.qr(C[kept].T)
    y = Q.dot(np.linalg.solve(R.T, rho[kept] / s[kept]))
    if lost.any():
        C_lost = C[lost] - C[lost].dot(Q).dot(Q.T)
        s_lost = s[lost]
        freedom = np.maximum((C_lost**2).sum(axis=1), _NO_FREEDOM)  # |c_i|^2
        d = freedom * (e[lost] ** 2 - s_lost**2)
        A = s_lost[:, None] * C_lost
        rest = rho[lost] - s_lost * C[lost].dot(y)
        y = y + A.T.dot(np.linalg.solve(A.dot(A.T) + np.diag(d), rest))
    return b + factor.solved(y[None], transposed=False)[0], is_damped


def _cholesky(W: np.ndarray) -> np.ndarray:
    """The upper triangular F (n, n) of W = F'F. Raises ArrayError where there is none."""
    F = np.zeros(W.shape)
    if not fill_factor(np.asarray(W, np.float64), F):
        raise _indefinite(W)
    return F


def _within(W: Weight, Z: np.ndarray) -> Weight:
    """The weight of z in dq = Z z, Z' W Z, for orthonormal Z (n, k)."""
    if W is None:
        return None
    if isinstance(W, Factor):
        _, R = np.linalg.qr(W.F.dot(Z))
        return Factor(R)
    restricted: np.ndarray = Z.T.dot(W).dot(Z)
    return restricted


def _null_space(J: np.ndarray, size: float) -> np.ndarray:
    """Orthonormal columns (n, n - rank) that J (m, n) takes to zero.

    J is projected into the null space of the tasks above, and size the largest singular value of
    the same rows before. Beside J's, a task without freedom would be judged against rounding.
    """
    _, s, Vt = np.linalg.svd(J)
    rank = int(np.count_nonzero(s > _DEPENDENT_RATIO * max(size, np.finfo(float).tiny)))
    return Vt[rank:].T


def check_shapes(J: Jacobian, dx: TaskVelocity, b: JointVelocities, W: Weight) -> None:
    """Raise ArrayError unless they are of m task directions and n joints."""
    if J.ndim != 2:
        raise ArrayError(f'J has shape {J.shape}; expected (m, n)')
    m, n = J.shape
    for name, array, shape in (('dx', dx, (m,)), ('b', b, (n,)), ('W', W, (n, n))):
        if array is not None and array.shape != shape:
            raise ArrayError(
                f'{name} has shape {array.shape}; expected {shape} beside J of shape {J.shape}'
            )


def _indefinite(W: np.ndarray) -> ArrayError:
    why = 'is not positive definite' if np.isfinite(W).all() else 'holds NaN or infinity'
    return ArrayError(f'the weight W {why}; expected finite values and a positive definite W')


def _complaint(
    J: Jacobian, dx: TaskVelocity, b: JointVelocities, W: Weight, dq: JointVelocities
) -> str:
    bad = [
        name
        for name, array in (('J', J), ('dx', dx), ('b', b), ('W', W))
        if array is not None and not np.isfinite(np.asarray(array)).all()
    ]
    if bad:
        return f'{" and ".join(bad)} hold NaN or infinity; every value must be finite'
    return f'J, dx, b or W hold numbers too large: the result would be {dq.tolist()}'
