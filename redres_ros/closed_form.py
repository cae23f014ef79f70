"""The closed form, Eq. (A.13), as one compiled call: the ground of resolution.py.

A call of numpy or LAPACK takes longer than the arithmetic of so few joints. The whole formula
compiled takes as long as three of them.
"""

import numpy as np
from numba import boolean, float64, int64

from redres_ros.compiled import compiled, matrix, vector

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
def dot(a: np.ndarray, b: np.ndarray) -> float:
    """a' b."""
    total = 0.0
    for i in range(len(a)):
        total += a[i] * b[i]
    return total


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


@compiled((matrix(), vector(), float64[::1]))
def solve_definite(A: np.ndarray, b: np.ndarray, x: np.ndarray) -> None:
    """Write A^-1 b into x, for a symmetric positive definite A (n, n); NaN for another one."""
    U = np.zeros(A.shape)
    x[:] = b
    if not cholesky(A, U):
        x[:] = np.nan
    solve_lower(U, x)
    solve_upper(U, x)


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
    """Whether no direction of J = R Q needs damping; False also where it is a close call.

    Q has orthonormal rows. With G = J J' = R R', the eigenvalues other than the smallest one have a
    mean of at most trace / (m - 1). Hence the smallest one is at least
    det / (trace / (m - 1))^(m - 1). Where this is too little, as for eigenvalues of different
    sizes, it is at least 1 / trace(G^-1).
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


@compiled(boolean(vector()))
def is_finite(x: np.ndarray) -> bool:
    """Whether no element is NaN or infinite."""
    for i in range(len(x)):  # noqa: SIM110 (numba knows no generators)
        if not np.isfinite(x[i]):
            return False
    return True


@compiled(float64(vector(), float64, vector(), float64[::1]))
def integrate(q: np.ndarray, T: float, dq: np.ndarray, q_ref: np.ndarray) -> float:
    """Write q + T dq (footnote 1) into q_ref; the speed |dq|."""
    for i in range(len(q)):
        q_ref[i] = q[i] + T * dq[i]
    return np.sqrt(dot(dq, dq))


@compiled(int64(matrix(), vector(), vector(), matrix(), int64, float64, float64[::1]))
def closed_form(
    J: np.ndarray,
    dx: np.ndarray,
    b: np.ndarray,
    W: np.ndarray,
    form: int,
    size: float,
    dq: np.ndarray,
) -> int:
    """Write b + J_W^# (dx - J b), Eq. (A.13), into dq.

    With W = F'F and y = F (dq - b) it is the least y with J F^-1 y = dx - J b. The rows of J F^-1
    are made orthonormal, J F^-1 = R Q: then y = Q' R^-1 (dx - J b). That is Eq. (A.5),
    J_W^# = W^-1 J' (J W^-1 J')^-1, without squaring its condition.

    Args:
        J: (m, n) task Jacobian.
        dx: (m,) task velocity.
        b: (n,) bias.
        W: The weight as `form` says; (0, 0) for the identity.
        form: IDENTITY, WEIGHT, FACTOR or SQUARE.
        size: Singular values are judged against this, or against the largest one of J.
        dq: (n,) receives the result.

    Returns:
        SOLVED, SINGULAR, INDEFINITE or NOT_FINITE.
    """
    m, n = J.shape
    Q = J.copy()
    R = np.zeros((m, m))
    make_orthonormal(Q, R)
    if m > n or not is_regular(R, size):
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
