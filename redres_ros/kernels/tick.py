"""What every tick computes beside the closed form."""

import numpy as np
from numba import boolean, float64

from redres_ros.kernels.compiled import compiled, direct, vector


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
@compiled(float64(vector()))
def largest(x: np.ndarray) -> float:
    """The largest magnitude of an element of x, (n,)."""
    most = 0.0
    for i in range(len(x)):
        most = max(most, abs(x[i]))
    return most


@direct
@compiled(float64(vector(), vector(), float64))
def agitation(dq: np.ndarray, dq_prev: np.ndarray, T: float) -> float:
    """A + 2 V^2 [rad/s^2]: V is the sum of all |dq_prev|, A that of all |dq - dq_prev| / T."""
    A = 0.0
    V = 0.0
    for i in range(len(dq)):
        A += abs(dq[i] - dq_prev[i]) / T
        V += abs(dq_prev[i])
    return A + 2.0 * V * V


@direct
@compiled((vector(), vector(), float64, float64[::1]))
def differentiate(x: np.ndarray, x_prev: np.ndarray, T: float, dx: np.ndarray) -> None:
    """Write (x - x_prev) / T, as of Eq. (13), into dx: in a third of the time that numpy takes."""
    for i in range(len(x)):
        dx[i] = (x[i] - x_prev[i]) / T


@direct
@compiled(float64(vector(), float64, vector(), vector(), float64[::1], float64[::1]))
def integrate(
    q: np.ndarray,
    T: float,
    dq: np.ndarray,
    dq_prev: np.ndarray,
    q_ref: np.ndarray,
    ddq: np.ndarray,
) -> float:
    """Write q + T dq (footnote 1) into q_ref, and (dq - dq_prev) / T into ddq; the speed |dq|."""
    square = 0.0
    for i in range(len(q)):
        q_ref[i] = q[i] + T * dq[i]
        ddq[i] = (dq[i] - dq_prev[i]) / T
        square += dq[i] * dq[i]
    return np.sqrt(square)
