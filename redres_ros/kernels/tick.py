"""What every tick computes beside the closed form."""

import numpy as np
from numba import boolean, float64, int64

from redres_ros.kernels.arithmetic import dot
from redres_ros.kernels.boxes import TOUCHING, narrowed, stopping_speed
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


@direct
@compiled(
    int64(
        *(vector(), vector(), vector(), float64, vector(), vector(), vector(), vector()),
        *(float64[::1], float64[::1]),
    )
)
def admit(
    q_ref: np.ndarray,
    p: np.ndarray,
    v: np.ndarray,
    T: float,
    V: np.ndarray,
    A: np.ndarray,
    q_min: np.ndarray,
    q_max: np.ndarray,
    admitted: np.ndarray,
    dq: np.ndarray,
) -> int:
    """Write the reference that the robot may get, and its velocity.

    A joint that is faster than V may not get faster; one outside its range may only come back.

    Args:
        q_ref: The reference that is proposed, (n,) [rad].
        p: Where the robot is, (n,) [rad].
        v: Its velocity, (n,) [rad/s].
        T: Sampling time [s].
        V: (n,) [rad/s].
        A: (n,) [rad/s^2].
        q_min: (n,) [rad].
        q_max: (n,) [rad].
        admitted: Receives the reference, (n,) [rad].
        dq: Receives its velocity, (n,) [rad/s].

    Returns:
        The number of the first joint that is changed; -1 if none is.
    """
    changed = -1
    for i in range(len(q_ref)):
        lower = v[i] - T * A[i]
        upper = v[i] + T * A[i]
        lower, upper = narrowed(lower, upper, min(-V[i], v[i]), max(V[i], v[i]))
        least = -stopping_speed(max(p[i] - q_min[i], 0.0), A[i], T)
        most = stopping_speed(max(q_max[i] - p[i], 0.0), A[i], T)
        lower, upper = narrowed(lower, upper, least, most)
        admitted[i] = q_ref[i]
        dq[i] = (q_ref[i] - p[i]) / T
        if not lower - TOUCHING <= dq[i] <= upper + TOUCHING:
            proposed = dq[i] if np.isfinite(dq[i]) else 0.0
            dq[i] = min(max(proposed, lower), upper)
            admitted[i] = p[i] + T * dq[i]
            if changed < 0:
                changed = i
    return changed
