"""Triangular factors of small matrices, and what is solved with them."""

import numpy as np

from redres_ros.kernels.arithmetic import dot
from redres_ros.kernels.compiled import compiled, inlined

# What a weight is given as.
IDENTITY = 0  # nothing: the weight is I
WEIGHT = 1  # the weight
FACTOR = 2  # the upper triangular F of the weight F'F
SQUARE = 3  # the symmetric positive definite M of the weight M M

# A row that keeps this share of its square, a tenth of its length, is orthogonal to the others
# after one pass, but for ten roundings.
MUCH = 0.01


@inlined
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


@inlined
def solve_lower(U: np.ndarray, x: np.ndarray) -> None:
    """x becomes U'^-1 x, for an upper triangular U (n, n)."""
    for i in range(len(x)):
        for k in range(i):
            x[i] -= U[k, i] * x[k]
        x[i] /= U[i, i]


@inlined
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
        before = dot(Q[k], Q[k])
        for _ in range(2):  # Gram-Schmidt, and once more where rounding may have left something
            for j in range(k):
                along = dot(Q[j], Q[k])
                R[k, j] += along
                for i in range(Q.shape[1]):
                    Q[k, i] -= along * Q[j, i]
            after = dot(Q[k], Q[k])
            if after > MUCH * before:
                break
        R[k, k] = np.sqrt(after)
        for i in range(Q.shape[1]):
            Q[k, i] /= R[k, k]


@inlined
def solve_factor(F: np.ndarray, form: int, x: np.ndarray) -> None:
    """x becomes F^-1 x."""
    if form == SQUARE:
        solve_lower(F, x)
    if form != IDENTITY:
        solve_upper(F, x)


@inlined
def solve_transposed_factor(F: np.ndarray, form: int, x: np.ndarray) -> None:
    """x becomes F'^-1 x."""
    if form != IDENTITY:
        solve_lower(F, x)
    if form == SQUARE:
        solve_upper(F, x)
