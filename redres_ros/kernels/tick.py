"""What every tick computes beside the closed form and the limits, in a third of numpy's time."""

import numpy as np
from numba import boolean, float64, void

from redres_ros.kernels.compiled import compiled, direct, matrix, vector

# [rad] this near to half a turn, the axis is read from the symmetric part of the matrix
_NEAR_HALF_A_TURN = 0.1
_SLACK = 0.1  # of the fastest joint's speed, with which the error of a servo may change

_VECTOR = float64[::1]
_RANGES = float64[:, ::1]


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
@compiled((float64, _VECTOR))
def multiply(factor: float, x: np.ndarray) -> None:
    """Multiply x, (n,), by a factor: to the bit as numpy."""
    for i in range(len(x)):
        x[i] *= factor


@direct
@compiled(float64(vector(), float64, _VECTOR, _VECTOR, _VECTOR))
def integrate(dq: np.ndarray, T: float, q: np.ndarray, ddq: np.ndarray, q_ref: np.ndarray) -> float:
    """Add T dq to q (footnote 1), and make ddq = dq_prev (dq - dq_prev) / T; the speed |dq|.

    The last q_ref, if it is not empty, becomes the velocity from there to q.
    """
    square = 0.0
    for i in range(len(q)):
        q[i] += T * dq[i]
        ddq[i] = (dq[i] - ddq[i]) / T
        square += dq[i] * dq[i]
    for i in range(len(q_ref)):
        q_ref[i] = (q[i] - q_ref[i]) / T
    return np.sqrt(square)


@direct
@compiled(void(vector(), vector(), float64, float64, _RANGES, _RANGES))
def add_excess(
    dq: np.ndarray, d: np.ndarray, seconds: float, lag: float, V: np.ndarray, e: np.ndarray
) -> None:
    """Add to e (2, n) [rad], by direction, how far an arm that has moved by d went beyond V t, with
    the peaks V (2, n) of dq and -dq; then let these fall towards them, within `lag` [s].
    """
    fraction = max(1.0 - seconds / lag, 0.0)
    slack = _SLACK * np.abs(V).max()
    for i in range(len(dq)):
        for k, v, moved in ((0, dq[i], d[i]), (1, -dq[i], -d[i])):
            fastest = max(V[k, i], v)
            beyond = moved - (fastest + slack) * seconds
            e[k, i] = max(e[k, i] + beyond, 0.0)
            V[k, i] = v + fraction * (fastest - v)


@direct
@compiled(void(_RANGES, _RANGES, vector(), vector(), vector()))
def widen(
    lower: np.ndarray, upper: np.ndarray, a: np.ndarray, b: np.ndarray, c: np.ndarray
) -> None:
    """Widen three ranges, lower and upper (3, n), so that they hold a, b and c, (n,) each."""
    for i in range(len(a)):
        for k, value in enumerate((a[i], b[i], c[i])):
            lower[k, i] = min(lower[k, i], value)
            upper[k, i] = max(upper[k, i], value)


def rotation_error(A: np.ndarray, B: np.ndarray) -> np.ndarray:
    """The turn from A to B, (3, 3): the rotation vector of R = B A', (3,) [rad]; 0 for A = B."""
    w = np.empty(3)
    _fill_rotation_error(A, B, w)
    return w


@direct
@compiled(void(matrix(), matrix(), _VECTOR))
def _fill_rotation_error(A: np.ndarray, B: np.ndarray, w: np.ndarray) -> None:
    """Write it into w (3,). The axis is what is antisymmetric in R, and near half a turn, where
    that vanishes, the largest column of the symmetric part less cos(angle) I.
    """
    w[:] = 0.0  # becomes sin(angle) axis, half of what is antisymmetric
    trace = 0.0
    for j in range(3):
        w[0] += (A[1, j] * B[2, j] - A[2, j] * B[1, j]) / 2.0
        w[1] += (A[2, j] * B[0, j] - A[0, j] * B[2, j]) / 2.0
        w[2] += (A[0, j] * B[1, j] - A[1, j] * B[0, j]) / 2.0
        trace += A[0, j] * B[0, j] + A[1, j] * B[1, j] + A[2, j] * B[2, j]
    sine = np.sqrt(w[0] * w[0] + w[1] * w[1] + w[2] * w[2])
    cosine = (trace - 1.0) / 2.0
    angle = np.arctan2(sine, cosine)
    if angle <= np.pi - _NEAR_HALF_A_TURN:
        for i in range(3):
            w[i] *= angle / sine if sine > 0.0 else 1.0
        return
    S = np.zeros((3, 3))  # becomes (R + R') / 2 - cos(angle) I = (1 - cos(angle)) axis axis'
    for i in range(3):
        S[i, i] -= cosine
        for k in range(3):
            for j in range(3):
                S[i, k] += (B[i, j] * A[k, j] + B[k, j] * A[i, j]) / 2.0
    k = 0
    for i in range(1, 3):
        if S[i, i] > S[k, k]:
            k = i
    along = S[k, 0] * w[0] + S[k, 1] * w[1] + S[k, 2] * w[2]
    length = np.copysign(np.sqrt(S[k, 0] ** 2 + S[k, 1] ** 2 + S[k, 2] ** 2), along)
    for i in range(3):
        w[i] = angle * S[k, i] / length
