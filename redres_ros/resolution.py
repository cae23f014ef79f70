"""Redundancy resolution: of all joint velocities that execute a task, the one nearest to a bias in
a chosen norm.

For so few joints numpy's overhead is most of the time. Hence `dot` instead of `@` (half of it),
LAPACK's dposv called directly (a quarter of `np.linalg.solve`), and looking closely at arguments
only when the result is not finite.
"""

import math

import numpy as np
from scipy.linalg.lapack import dposv, dpotri

from redres_ros.errors import ArrayError

# task directions whose singular value is below this share of the largest one are damped
SINGULAR_RATIO = 1e-3


def resolve(
    J: np.ndarray, dx: np.ndarray, b: np.ndarray, W: np.ndarray | None = None
) -> np.ndarray:
    """The minimum of 1/2 (dq - b)' W (dq - b) subject to J dq = dx, (n,) [rad/s]: Eq. (A.13), y =
    dq, A = J, y_N = b.

    J: (m, n) task Jacobian, m <= n; dx: (m,) task velocity; b: (n,) bias [rad/s]; W: (n, n)
    symmetric positive definite weight, None for the identity. Near a singularity, where the least
    squares solution would be unbounded, the lost direction is executed only in part (damped) and
    drops out of the projector (end of Appendix A). Raises ArrayError for shapes that do not fit and
    for NaN or infinity.
    """
    _check_shapes(J, dx, b, W)
    WJ = J.T if W is None else solve_spd(W, J.T)  # (n, m) W^-1 J'
    dq = b + WJ.dot(damped_solve(J.dot(WJ), dx - J.dot(b)))  # b + J_W^# (dx - J b) with Eq. (A.5)
    if not math.isfinite(sum(dq.tolist())):
        raise ArrayError(_complaint(J, dx, b, W, dq))
    return dq


def project(J: np.ndarray, b: np.ndarray, W: np.ndarray | None = None) -> np.ndarray:
    """The part of b in the null space of J, (n,): P b of Eq. (2), what the bias adds to J_W^# dx.
    As for `resolve`.
    """
    return resolve(J, np.zeros(len(J)), b, W)


def solve_spd(A: np.ndarray, B: np.ndarray) -> np.ndarray:
    """A^-1 B for a symmetric positive definite A (n, n) and B (n,) or (n, k). Raises ArrayError for
    another A.
    """
    factor, X, failed = dposv(A, B)
    if failed or not math.isfinite(sum(factor.diagonal().tolist())):
        why = 'is not positive definite' if np.isfinite(A).all() else 'holds NaN or infinity'
        raise ArrayError(f'the weight W {why}; expected finite values and a positive definite W')
    return X


def damped_solve(G: np.ndarray, r: np.ndarray) -> np.ndarray:
    """G^-1 r, (m,), for a symmetric positive semidefinite G = A A' (m, m), damped where A is near a
    singularity.

    With s the singular values of A and e = SINGULAR_RATIO max(s): 1/s^2 for s >= e, below it 1/(s^2
    + e^2 - s^2) = 1/e^2, so that the pseudoinverse's gain s/e^2 is continuous, at most 1/e, and 0
    for a lost direction (numerical filtering after Maciejewski and Klein, 1988). A zero matrix
    gives zero. Raises ArrayError for an indefinite G.
    """
    factor, y, failed = dposv(G, r)
    return y if not failed and _well_conditioned(G, factor) else _damped_inverse(G).dot(r)


def _well_conditioned(G: np.ndarray, factor: np.ndarray) -> bool:
    """Whether no direction of G = U' U, with U its Cholesky factor, needs damping; False also where
    it is a close call.

    The eigenvalues other than the smallest one have a mean of at most trace / (m - 1), so their
    product is at most that to the power of m - 1, and the smallest one is at least det / (trace /
    (m - 1))^(m - 1). Where this is too little, as for eigenvalues of different units, it is at
    least 1 / trace(G^-1), which takes longer.
    """
    others = len(G) - 1
    trace = sum(G.diagonal().tolist())
    needed = SINGULAR_RATIO**2 * trace  # as the largest one is at most the trace
    if math.prod(factor.diagonal().tolist()) ** 2 * (others / trace) ** others > needed:
        return True
    inverse, failed = dpotri(factor)
    return not failed and 1.0 / sum(inverse.diagonal().tolist()) > needed


def _damped_inverse(G: np.ndarray) -> np.ndarray:
    try:
        squares, V = np.linalg.eigh(G)  # (m,) ascending, (m, m)
    except np.linalg.LinAlgError:  # NaN or infinity
        return np.full_like(G, np.nan)
    floor = SINGULAR_RATIO**2 * abs(squares).max()
    if squares[0] < -floor:
        raise ArrayError(
            f"the weight is not positive definite: J W^-1 J' has the eigenvalue {squares[0]:.3g}"
        )
    if floor <= 0.0:
        return np.zeros_like(G)
    return (V / np.maximum(squares, floor)) @ V.T


def _check_shapes(J: np.ndarray, dx: np.ndarray, b: np.ndarray, W: np.ndarray | None) -> None:
    if (
        J.shape == dx.shape + b.shape
        and 1 <= len(dx) <= len(b)
        and (W is None or W.shape == b.shape + b.shape)
    ):
        return
    if J.ndim != 2 or not 1 <= J.shape[0] <= J.shape[1]:
        raise ArrayError(f'J has shape {J.shape}; expected (m, n) with 1 <= m <= n')
    m, n = J.shape
    for name, array, shape in (('dx', dx, (m,)), ('b', b, (n,)), ('W', W, (n, n))):
        if array is not None and array.shape != shape:
            raise ArrayError(
                f'{name} has shape {array.shape}; expected {shape} beside J of shape {J.shape}'
            )


def _complaint(
    J: np.ndarray, dx: np.ndarray, b: np.ndarray, W: np.ndarray | None, dq: np.ndarray
) -> str:
    """Why the result is not finite."""
    bad = [
        name
        for name, array in (('J', J), ('dx', dx), ('b', b), ('W', W))
        if array is not None and not np.isfinite(array).all()
    ]
    if bad:
        return f'{" and ".join(bad)} hold NaN or infinity; every value must be finite'
    return f'J, dx, b or W hold numbers too large: the result would be {dq.tolist()}'
