"""Redundancy resolution: of all joint velocities that execute a task, the one nearest to a bias in a chosen norm."""

from typing import NamedTuple

import numpy as np

from redres_ros.errors import ArrayError

SINGULAR_RATIO = 1e-3  # task directions whose singular value is below this share of the largest one are damped


class Resolution(NamedTuple):
    """Both terms of Eq. (2), (n,) [rad/s]: dq = J_W^# dx + null, where null is the projected bias and J null = 0."""

    dq: np.ndarray
    null: np.ndarray


def resolve(J: np.ndarray, dx: np.ndarray, b: np.ndarray, W: np.ndarray | None = None) -> Resolution:
    """The minimum of 1/2 (dq - b)' W (dq - b) subject to J dq = dx: Eq. (A.13) with y = dq, A = J, y_N = b.

    J: (m, n) task Jacobian, m <= n; dx: (m,) task velocity; b: (n,) bias [rad/s]; W: (n, n) symmetric positive definite
    weight, None for the identity. Near a singularity, where the least squares solution would be unbounded, the lost
    direction is executed only in part (damped) and drops out of the projector (end of Appendix A). Raises ArrayError
    for shapes that do not fit and for NaN or infinity.
    """
    _check(J, dx, b, W)
    try:
        WJ = J.T if W is None else np.linalg.solve(W, J.T)  # (n, m) W^-1 J'
        J_pinv = WJ @ damped_inverse(J @ WJ)  # (n, m) Eq. (A.5)
    except np.linalg.LinAlgError as error:
        raise ArrayError(f'J or W cannot be used: {error}; expected finite values and a positive definite W') from None
    with np.errstate(over='ignore', invalid='ignore'):  # what comes of it is looked at below
        null = b - J_pinv @ (J @ b)
        dq = J_pinv @ dx + null
    if not np.isfinite(dq).all():
        raise ArrayError(f'J, dx, b or W hold NaN, infinity or numbers too large: the result would be {dq.tolist()}')
    return Resolution(dq, null)


def damped_inverse(G: np.ndarray) -> np.ndarray:
    """Inverse of a symmetric positive semidefinite (m, m) matrix G = A A', exact while A is well conditioned.

    With s the singular values of A and e = SINGULAR_RATIO max(s): 1/s^2 for s >= e, below it 1/(s^2 + e^2 - s^2) =
    1/e^2, so that the pseudoinverse's gain s/e^2 is continuous, at most 1/e, and 0 for a lost direction (numerical
    filtering after Maciejewski and Klein, 1988). A zero matrix gives zero.
    """
    squares, V = np.linalg.eigh(G)  # (m,) ascending, (m, m)
    floor = SINGULAR_RATIO**2 * abs(squares).max()
    if squares[0] < -floor:
        raise ArrayError(f'the weight is not positive definite: J W^-1 J\' has the eigenvalue {squares[0]:.3g}')
    if floor <= 0.0:
        return np.zeros_like(G)
    return (V / np.maximum(squares, floor)) @ V.T


def _check(J: np.ndarray, dx: np.ndarray, b: np.ndarray, W: np.ndarray | None) -> None:
    if J.ndim != 2 or not 1 <= J.shape[0] <= J.shape[1]:
        raise ArrayError(f'J has shape {J.shape}; expected (m, n) with 1 <= m <= n')
    m, n = J.shape
    for name, array, shape in (('dx', dx, (m,)), ('b', b, (n,)), ('W', W, (n, n))):
        if array is not None and array.shape != shape:
            raise ArrayError(f'{name} has shape {array.shape}; expected {shape} beside J of shape {J.shape}')
    if not (np.isfinite(J).all() and np.isfinite(b).all() and (W is None or np.isfinite(W).all())):
        raise ArrayError('J, b or W hold NaN or infinity; every value must be finite')
