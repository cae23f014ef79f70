"""What every tick computes beside the closed form."""

import numpy as np
from numba import boolean, float64

from redres_ros.kernels.arithmetic import dot
from redres_ros.kernels.compiled import compiled, direct, matrix, vector
from redres_ros.kernels.factors import cholesky, solve_lower, solve_upper


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
@compiled((float64, vector(), float64, matrix(), vector(), float64[::1]))
def free_motion(
    share: float, dq: np.ndarray, T: float, M: np.ndarray, n: np.ndarray, b: np.ndarray
) -> None:
    """Write lambda dq - T M^-1 n, Eq. (27) and (32), into b; NaN for an M that is not definite.

    It is the velocity after one tick without any torque, Eq. (6), and with null-space damping.

    Args:
        share: lambda.
        dq: (n,) [rad/s].
        T: Sampling time [s].
        M: (n, n) [kg m^2].
        n: (n,) [Nm].
        b: (n,) receives the result [rad/s].
    """
    U = np.empty(M.shape)
    for i in range(len(n)):
        b[i] = -n[i]
    if not cholesky(M, U):
        b[:] = np.nan
    solve_lower(U, b)
    solve_upper(U, b)  # -M^-1 n
    for i in range(len(n)):
        b[i] = share * dq[i] + T * b[i]


@direct
@compiled(float64(vector(), float64, vector(), float64[::1]))
def integrate(q: np.ndarray, T: float, dq: np.ndarray, q_ref: np.ndarray) -> float:
    """Write q + T dq (footnote 1) into q_ref; the speed |dq|."""
    for i in range(len(q)):
        q_ref[i] = q[i] + T * dq[i]
    return np.sqrt(dot(dq, dq))
