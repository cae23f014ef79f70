"""A tick on a straight line between two points, Eq. (36) and (37)."""

import numpy as np
from numba import float64, int64

from redres_ros.kernels.compiled import compiled, direct, matrix, part, vector


@part
def _fill_limited(gain: float, limit: float, error: np.ndarray, feedback: np.ndarray) -> None:
    """As limited(), into `feedback` (3,)."""
    square = 0.0
    for i in range(3):
        feedback[i] = gain * error[i]
        square += feedback[i] * feedback[i]
    excess = np.sqrt(square) / limit
    if excess > 1.0:
        for i in range(3):
            feedback[i] /= excess


@direct
@compiled(float64[::1](float64, float64, vector()))
def limited(gain: float, limit: float, error: np.ndarray) -> np.ndarray:
    """The feedback k_P e of Eq. (37), (3,), no longer than the limit.

    Args:
        gain: k_P [1/s].
        limit: Of its norm, in the unit of the feedback; may be infinite.
        error: e, (3,).
    """
    feedback = np.empty(3)
    _fill_limited(gain, limit, error, feedback)
    return feedback


@direct
@compiled(
    (
        *(matrix(), int64, float64, float64, vector(), float64, float64),
        *(float64[::1], float64[::1], float64[::1]),
    )
)
def follow_line(
    points: np.ndarray,
    start: int,
    s: float,
    ds: float,
    x: np.ndarray,
    gain: float,
    limit: float,
    x_d: np.ndarray,
    error: np.ndarray,
    dx: np.ndarray,
) -> None:
    """Write where the tip should be, how far it is from there, and the task velocity.

    Args:
        points: (N, 3) [m].
        start: Number of the point at which the line begins.
        s: Fraction of the line.
        ds: Its rate [1/s].
        x: Where the tip is, (3,) [m].
        gain: k_P [1/s].
        limit: Of the feedback [m/s]; may be infinite.
        x_d: (3,) receives the desired position [m].
        error: (3,) receives x_d - x [m].
        dx: (3,) receives the task velocity [m/s].
    """
    for i in range(3):
        way = points[start + 1, i] - points[start, i]
        x_d[i] = points[start, i] + way * s if s < 1.0 else points[start + 1, i]
        error[i] = x_d[i] - x[i]
    _fill_limited(gain, limit, error, dx)
    for i in range(3):
        dx[i] += (points[start + 1, i] - points[start, i]) * ds
