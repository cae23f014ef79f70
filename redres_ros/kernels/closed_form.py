"""The closed form, Eq. (A.13) and (20), as one compiled call: the ground of resolution.py.

A call of numpy or LAPACK takes longer than the arithmetic of so few joints. The whole formula
compiled takes as long as three of them.
"""

import numpy as np
from numba import float64, int64

from redres_ros.kernels.arithmetic import dot
from redres_ros.kernels.compiled import compiled, inlined, matrix, vector
from redres_ros.kernels.factors import (
    IDENTITY,
    SQUARE,
    WEIGHT,
    cholesky,
    make_orthonormal,
    solve_factor,
    solve_transposed_factor,
)

# What came of it.
SOLVED = 0
SINGULAR = 1  # a direction may have to be damped, or dq is too fast: it is not the answer
INDEFINITE = 2  # W is no such matrix, or holds NaN
NOT_FINITE = 3

# Task directions whose singular value is below this share of the largest one are damped.
SINGULAR_RATIO = 1e-3


@inlined
def is_regular(R: np.ndarray, first: int, m: int, size: float) -> bool:
    """Whether no direction of a task needs damping; False also where it is a close call.

    Its block of R (m, m) begins at `first` and is lower triangular. The eigenvalues of R R' other
    than the smallest one have a mean of at most trace / (m - 1). Hence the smallest one is at least
    det / (trace / (m - 1))^(m - 1). Where this is too little, as for eigenvalues of different
    sizes, it is at least 1 / trace of the inverse.

    Args:
        R: Its block has the singular values of the task.
        first: Row and column of R in which the block begins.
        m: Number of rows of the task.
        size: They are judged against this, or against the largest one if that is larger.
    """
    end = first + m
    trace = 0.0
    root_of_det = 1.0
    for k in range(first, end):
        for j in range(first, k + 1):
            trace += R[k, j] ** 2
        root_of_det *= R[k, k]
    needed = SINGULAR_RATIO**2 * max(trace, size * size)  # the largest one is at most the trace
    if root_of_det**2 * ((m - 1) / trace) ** (m - 1) > needed:
        return True
    trace_of_inverse = 0.0
    column = np.empty(end)
    for k in range(first, end):  # of the inverse
        for i in range(k, end):
            column[i] = 1.0 if i == k else 0.0
            for j in range(k, i):
                column[i] -= R[i, j] * column[j]
            column[i] /= R[i, i]
            trace_of_inverse += column[i] ** 2
    return 1.0 / trace_of_inverse > needed


@inlined
def are_regular(R: np.ndarray, first: int) -> bool:
    """Whether no task needs damping in what those before it leave; False also for close calls.

    With J = R Q, the diagonal block of R that belongs to a task is its Jacobian in the null space
    of those before it. Its singular values are judged against those of the whole Jacobian, whose
    rows are as long as those of R. All lower tasks are judged as one: the smallest singular value
    of their common block is at most that of each, and what it is judged against at least as large.

    Args:
        R: (m, m) lower triangular.
        first: Number of rows of the first task.
    """
    if not is_regular(R, 0, first, 0.0):
        return False
    square = 0.0  # of all elements: at least that of the largest singular value
    for k in range(first, len(R)):
        for j in range(k + 1):
            square += R[k, j] ** 2
    return first == len(R) or is_regular(R, first, len(R) - first, np.sqrt(square))


@inlined
def solution(
    Q: np.ndarray,
    R: np.ndarray,
    dx: np.ndarray,
    b: np.ndarray,
    W: np.ndarray,
    form: int,
    fastest: float,
    dq: np.ndarray,
) -> int:
    """Write b + J_W^# (dx - J b), Eq. (A.13), into dq.

    The task J dq = dx with J = R Q is the same as Q dq = R^-1 dx. Hence the result is also
    b + Q_W^# r with r = R^-1 dx - Q b. The rows of Q are orthonormal, so without a weight
    Q^# = Q'.

    Args:
        Q: (m, n), orthonormal rows; used up.
        R: (m, m), lower triangular; used up.
        dx: (m,); becomes r.
        b: (n,).
        W: The weight as `form` says.
        form: IDENTITY, WEIGHT, FACTOR or SQUARE.
        fastest: Where dq is longer than this, it is not the answer.
        dq: (n,) receives the result.

    Returns:
        SOLVED, SINGULAR, INDEFINITE or NOT_FINITE.
    """
    substitute(R, dx)
    for k in range(len(dx)):
        dx[k] -= dot(Q[k], b)
    if form == IDENTITY:
        add_up(Q, dx, dq)
    elif not weighted(Q, R, dx, W, form, dq):
        return INDEFINITE
    total = 0.0
    for i in range(len(b)):
        dq[i] += b[i]
        total += dq[i]
    if not np.isfinite(total):
        return NOT_FINITE
    return SOLVED if dot(dq, dq) <= fastest**2 else SINGULAR


@inlined
def weighted(
    Q: np.ndarray, R: np.ndarray, r: np.ndarray, W: np.ndarray, form: int, dq: np.ndarray
) -> bool:
    """Write J_W^# r of the Jacobian J = Q into dq; whether W is positive definite.

    With W = F'F and y = F dq it is the least y with J F^-1 y = r. The rows of J F^-1 are made
    orthonormal, J F^-1 = R Q: then y = Q' R^-1 r. That is Eq. (A.5),
    J_W^# = W^-1 J' (J W^-1 J')^-1, without squaring its condition.

    Args:
        Q: (m, n), the Jacobian; used up.
        R: (m, m), overwritten.
        r: (m,); used up.
        W: The weight as `form` says.
        form: WEIGHT, FACTOR or SQUARE.
        dq: (n,) receives the result.
    """
    F = W.copy()
    if form in (WEIGHT, SQUARE) and not cholesky(W, F):
        return False
    for k in range(len(r)):
        solve_transposed_factor(F, form, Q[k])
    R[:] = 0.0
    make_orthonormal(Q, R)
    substitute(R, r)
    add_up(Q, r, dq)
    solve_factor(F, form, dq)
    return True


@inlined
def substitute(R: np.ndarray, x: np.ndarray) -> None:
    """x becomes R^-1 x, for a lower triangular R (m, m), from its first row to its last."""
    for k in range(len(x)):
        for j in range(k):
            x[k] -= R[k, j] * x[j]
        x[k] /= R[k, k]


@inlined
def add_up(Q: np.ndarray, r: np.ndarray, y: np.ndarray) -> None:
    """Write Q' r into y, for Q (m, n)."""
    y[:] = 0.0
    for k in range(len(r)):
        for i in range(len(y)):
            y[i] += Q[k, i] * r[k]


@compiled(
    int64(
        *(matrix(), vector(), vector(), matrix(), int64),
        *(float64, float64, float64[::1]),
    )
)
def closed_form(
    J: np.ndarray,
    dx: np.ndarray,
    b: np.ndarray,
    W: np.ndarray,
    form: int,
    size: float,
    fastest: float,
    dq: np.ndarray,
) -> int:
    """Write b + J_W^# (dx - J b), Eq. (A.13), into dq.

    Args:
        J: (m, n) Jacobian.
        dx: (m,) task velocity.
        b: (n,) bias.
        W: The weight as `form` says; (0, 0) for the identity.
        form: IDENTITY, WEIGHT, FACTOR or SQUARE.
        size: Singular values are judged against this, or against the largest one of J.
        fastest: Where dq is longer than this, it is not the answer.
        dq: (n,) receives the result.

    Returns:
        SOLVED, SINGULAR, INDEFINITE or NOT_FINITE.
    """
    m, n = J.shape
    Q = J.copy()
    R = np.zeros((m, m))
    make_orthonormal(Q, R)  # J = R Q
    if m > n or not is_regular(R, 0, m, size):
        return SINGULAR
    return solution(Q, R, dx.copy(), b, W, form, fastest, dq)


@compiled(
    int64(
        *(matrix(), vector(), matrix(), vector()),
        *(vector(), matrix(), int64, float64, float64[::1]),
    )
)
def closed_form_in_order(
    J_first: np.ndarray,
    dx_first: np.ndarray,
    J_lower: np.ndarray,
    dx_lower: np.ndarray,
    b: np.ndarray,
    W: np.ndarray,
    form: int,
    fastest: float,
    dq: np.ndarray,
) -> int:
    """Write into dq what executes several tasks, and is otherwise nearest to b.

    That is what Eq. (20) asks for wherever each task can be executed exactly in what those before
    it leave.

    Args:
        J_first: Jacobian of the first task.
        dx_first: Its velocity.
        J_lower: Jacobians of the lower tasks, one below the other.
        dx_lower: Their velocities.
        b: As for `closed_form`, and so are the others.
        W: The weight.
        form: What W is.
        fastest: [rad/s]
        dq: (n,) receives the result.

    Returns:
        SOLVED, SINGULAR, INDEFINITE or NOT_FINITE.
    """
    first = len(dx_first)
    m = first + len(dx_lower)
    n = len(b)
    Q = np.empty((m, n))
    dx = np.empty(m)
    for k in range(m):
        for i in range(n):
            Q[k, i] = J_first[k, i] if k < first else J_lower[k - first, i]
        dx[k] = dx_first[k] if k < first else dx_lower[k - first]
    R = np.zeros((m, m))
    make_orthonormal(Q, R)  # J = R Q
    if m > n or not are_regular(R, first):
        return SINGULAR
    return solution(Q, R, dx, b, W, form, fastest, dq)
