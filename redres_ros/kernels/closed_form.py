"""The closed form, Eq. (A.13), as one compiled call: the ground of resolution.py.

A call of numpy or LAPACK takes longer than the arithmetic of so few joints. The whole formula
compiled takes as long as three of them.
"""

import numpy as np
from numba import boolean, float64, int64

from redres_ros.kernels.arithmetic import dot
from redres_ros.kernels.compiled import compiled, direct, matrix, vector

# What the argument W of `closed_form` is.
IDENTITY = 0  # nothing: the weight is I
WEIGHT = 1  # the weight
FACTOR = 2  # the upper triangular F of the weight F'F
SQUARE = 3  # the symmetric positive definite M of the weight M M

# What came of it.
SOLVED = 0
SINGULAR = 1  # a direction is to be damped, or that cannot be excluded: dq is not the answer
INDEFINITE = 2  # W is no such matrix, or holds NaN
NOT_FINITE = 3

# Task directions whose singular value is below this share of the largest one are damped.
SINGULAR_RATIO = 1e-3


@compiled()
def cholesky(A: np.ndarray, U: np.ndarray) -> bool:
    """Fill in the upper triangle of U, A = U'U; whether A (n, n) is positive definite."""
    for i in range(len(A)):
        for j in range(i, len(A)):
            rest = A[i, j]
            for k in range(i):
                rest -= U[k, i] * U[k, j]
            if j > i:
                U[i, j] = rest / U[i, i]
                continue
            if not 0.0 < rest < np.inf:
                return False
            U[i, i] = np.sqrt(rest)
    return True


@compiled()
def solve_lower(U: np.ndarray, x: np.ndarray) -> None:
    """x becomes U'^-1 x, for an upper triangular U (n, n)."""
    for i in range(len(x)):
        for k in range(i):
            x[i] -= U[k, i] * x[k]
        x[i] /= U[i, i]


@compiled()
def solve_upper(U: np.ndarray, x: np.ndarray) -> None:
    """x becomes U^-1 x, for an upper triangular U (n, n)."""
    for i in range(len(x) - 1, -1, -1):
        for k in range(i + 1, len(x)):
            x[i] -= U[i, k] * x[k]
        x[i] /= U[i, i]


@compiled()
def make_orthonormal(Q: np.ndarray, R: np.ndarray) -> None:
    """The rows of Q (m, n) become orthonormal, and R (m, m) lower triangular: before = R after."""
    for k in range(len(Q)):
        for _ in range(2):  # Gram-Schmidt, and once more for what rounding left
            for j in range(k):
                along = dot(Q[j], Q[k])
                R[k, j] += along
                for i in range(Q.shape[1]):
                    Q[k, i] -= along * Q[j, i]
        R[k, k] = np.sqrt(dot(Q[k], Q[k]))
        for i in range(Q.shape[1]):
            Q[k, i] /= R[k, k]


@compiled()
def is_regular(R: np.ndarray, size: float) -> bool:
    """Whether no direction of R (m, m) needs damping; False also where it is a close call.

    R is lower triangular. The eigenvalues of R R' other than the smallest one have a mean of at
    most trace / (m - 1). Hence the smallest one is at least det / (trace / (m - 1))^(m - 1). Where
    this is too little, as for eigenvalues of different sizes, it is at least 1 / trace of the
    inverse.

    Args:
        R: (m, m) with the singular values of the task.
        size: They are judged against this, or against the largest one if that is larger.
    """
    m = len(R)
    trace = 0.0
    root_of_det = 1.0
    for k in range(m):
        trace += dot(R[k, : k + 1], R[k, : k + 1])
        root_of_det *= R[k, k]
    needed = SINGULAR_RATIO**2 * max(trace, size * size)  # the largest one is at most the trace
    if root_of_det**2 * ((m - 1) / trace) ** (m - 1) > needed:
        return True
    trace_of_inverse = 0.0
    column = np.zeros(m)
    for k in range(m):  # R^-1, column by column
        column[:] = 0.0
        column[k] = 1.0
        for i in range(k, m):
            for j in range(k, i):
                column[i] -= R[i, j] * column[j]
            column[i] /= R[i, i]
        trace_of_inverse += dot(column, column)
    return 1.0 / trace_of_inverse > needed


@compiled()
def are_regular(J: np.ndarray, R: np.ndarray, tasks: np.ndarray, size: float) -> bool:
    """Whether no task needs damping in what those before it leave; `closed_form` has the arguments.

    With J = R Q, the diagonal block of R that belongs to a task is its Jacobian in the null space
    of those before it. Its singular values are judged against those of the whole Jacobian.
    """
    if J.shape[0] > J.shape[1]:
        return False
    if len(tasks) == 0:
        return is_regular(R, size)
    first = 0
    for m in tasks:
        square = 0.0
        for k in range(first, first + m):
            square += dot(J[k], J[k])
        block = R[first : first + m, first : first + m]
        if not is_regular(block, max(size, np.sqrt(square / m))):  # the root is below the largest
            return False
        first += m
    return True


@compiled()
def solve_factor(F: np.ndarray, form: int, x: np.ndarray) -> None:
    """x becomes F^-1 x."""
    if form == SQUARE:
        solve_lower(F, x)
    if form != IDENTITY:
        solve_upper(F, x)


@compiled()
def solve_transposed_factor(F: np.ndarray, form: int, x: np.ndarray) -> None:
    """x becomes F'^-1 x."""
    if form != IDENTITY:
        solve_lower(F, x)
    if form == SQUARE:
        solve_upper(F, x)


@direct
@compiled(boolean(vector(), vector(), float64))
def are_usable(x: np.ndarray, y: np.ndarray, most: float) -> bool:
    """Whether every element of x is finite, and none of y larger than `most`."""
    for i in range(len(x)):
        if not np.isfinite(x[i]):
            return False
    for i in range(len(y)):  # noqa: SIM110 (numba knows no generators)
        if not abs(y[i]) <= most:
            return False
    return True


@direct
@compiled((matrix(), vector(), float64[::1]))
def free_acceleration(M: np.ndarray, n: np.ndarray, ddq: np.ndarray) -> None:
    """Write -M^-1 n, Eq. (6) with tau = 0, into ddq; NaN where M is not positive definite."""
    U = np.zeros(M.shape)
    for i in range(len(n)):
        ddq[i] = -n[i]
    if not cholesky(M, U):
        ddq[:] = np.nan
    solve_lower(U, ddq)
    solve_upper(U, ddq)


@direct
@compiled((float64, vector(), float64, vector(), float64[::1]))
def go_on(share: float, dq: np.ndarray, T: float, ddq: np.ndarray, b: np.ndarray) -> None:
    """Write lambda dq + T ddq, Eq. (19) and (23), into b."""
    for i in range(len(dq)):
        b[i] = share * dq[i] + T * ddq[i]


@direct
@compiled(float64(vector(), float64, vector(), float64[::1]))
def integrate(q: np.ndarray, T: float, dq: np.ndarray, q_ref: np.ndarray) -> float:
    """Write q + T dq (footnote 1) into q_ref; the speed |dq|."""
    for i in range(len(q)):
        q_ref[i] = q[i] + T * dq[i]
    return np.sqrt(dot(dq, dq))


@compiled(
    int64(matrix(), vector(), vector(), matrix(), int64, vector(int64), float64, float64[::1])
)
def closed_form(
    J: np.ndarray,
    dx: np.ndarray,
    b: np.ndarray,
    W: np.ndarray,
    form: int,
    tasks: np.ndarray,
    size: float,
    dq: np.ndarray,
) -> int:
    """Write b + J_W^# (dx - J b), Eq. (A.13), into dq.

    With W = F'F and y = F (dq - b) it is the least y with J F^-1 y = dx - J b. The rows of J F^-1
    are made orthonormal, J F^-1 = R Q: then y = Q' R^-1 (dx - J b). That is Eq. (A.5),
    J_W^# = W^-1 J' (J W^-1 J')^-1, without squaring its condition.

    Of several tasks each is executed exactly. That is what Eq. (20) asks for wherever each can be
    executed in what those before it leave.

    Args:
        J: (m, n) Jacobian of all tasks.
        dx: (m,) what they want.
        b: (n,) bias.
        W: The weight as `form` says; (0, 0) for the identity.
        form: IDENTITY, WEIGHT, FACTOR or SQUARE.
        tasks: (k,) number of rows of each task, in order of priority; (0,) for a single one.
        size: Singular values are judged against this, or against the largest one of J.
        dq: (n,) receives the result.

    Returns:
        SOLVED, SINGULAR, INDEFINITE or NOT_FINITE.
    """
    m, n = J.shape
    Q = J.copy()
    R = np.zeros((m, m))
    make_orthonormal(Q, R)
    if not are_regular(J, R, tasks, size):
        return SINGULAR

    F = np.zeros(W.shape)  # W = F'F
    if form == FACTOR:
        F[:] = W
    elif form != IDENTITY and not cholesky(W, F):
        return INDEFINITE
    if form != IDENTITY:
        Q[:] = J
        for k in range(m):
            solve_transposed_factor(F, form, Q[k])
        R[:] = 0.0
        make_orthonormal(Q, R)  # J F^-1 = R Q

    r = np.empty(m)  # R^-1 (dx - J b)
    for k in range(m):
        r[k] = dx[k] - dot(J[k], b)
        for j in range(k):
            r[k] -= R[k, j] * r[j]
        r[k] /= R[k, k]
    dq[:] = 0.0
    for k in range(m):
        for i in range(n):
            dq[i] += Q[k, i] * r[k]  # y = Q' R^-1 (dx - J b)
    solve_factor(F, form, dq)
    total = 0.0
    for i in range(n):
        dq[i] += b[i]
        total += dq[i]
    return SOLVED if np.isfinite(total) else NOT_FINITE
