"""The speed from which a joint still stops in time, in discrete time, and boxes from it."""

import numpy as np
from numba import boolean, float64

from redres_ros.compiled import compiled, several, vector

TOUCHING = 1e-9  # [rad/s] apart, boxes still touch: q has 16 digits, which leaves d / T with 13


@compiled(float64(float64, float64, float64))
def stopping_speed(d: float, A: float, T: float) -> float:
    """beta(d), the largest speed from which a joint stops within the distance d.

    It goes on at this speed for one tick, and is then slower by A T in every further one. The usual
    sqrt(2 A d) is its limit for T -> 0. For d < 0 it is -beta(-d): the joint comes back at the
    speed from which it stops at the limit.

    Args:
        d: distance to the limit [rad]; it may be infinite.
        A: acceleration [rad/s^2]; infinite for a joint that stops at once.
        T: sampling time [s].

    Returns:
        The speed [rad/s].
    """
    if d < 0.0:
        return -stopping_speed(-d, A, T)
    if not np.isfinite(d):
        return d
    if not np.isfinite(A):
        return d / T
    step = A * T
    N = np.floor(
        (np.sqrt(1.0 + 8.0 * d / (step * T)) - 1.0) / 2.0
    )  # ticks it takes beside the first
    return (d / T + step * N * (N + 1.0) / 2.0) / (N + 1.0)


@compiled(several(float64[::1], float64[::1])(*(vector(),) * 4, float64))
def stopping_box(
    q: np.ndarray, q_min: np.ndarray, q_max: np.ndarray, A: np.ndarray, T: float
) -> tuple[np.ndarray, np.ndarray]:
    """-beta(q - q_min) <= dq <= beta(q_max - q), both (n,) [rad/s]."""
    lower = np.empty(len(q))
    upper = np.empty(len(q))
    for i in range(len(q)):
        lower[i] = -stopping_speed(q[i] - q_min[i], A[i], T)
        upper[i] = stopping_speed(q_max[i] - q[i], A[i], T)
    return lower, upper


@compiled(boolean(float64[::1], float64[::1], vector(), vector()))
def narrow(
    lower: np.ndarray, upper: np.ndarray, other_lower: np.ndarray, other_upper: np.ndarray
) -> bool:
    """Narrow a box, in place, to its part in another; where they are apart, to the nearest point.

    Returns:
        Whether the boxes meet in every joint.
    """
    meet = True
    for i in range(len(lower)):
        if other_lower[i] > upper[i] + TOUCHING or other_upper[i] < lower[i] - TOUCHING:
            meet = False
        most = upper[i]
        upper[i] = max(min(other_upper[i], most), lower[i])
        lower[i] = min(max(other_lower[i], lower[i]), most)
    return meet
