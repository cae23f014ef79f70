"""The turn between two rotations, which are (3, 3)."""

import numpy as np
from numba import float64

from redres_ros.kernels.compiled import compiled, direct, inlined, matrix, part

# [rad] this near to half a turn, the axis is read from the symmetric part of the matrix
_NEAR_HALF_A_TURN = 0.1


@inlined
def dot(a: np.ndarray, b: np.ndarray) -> float:
    """a' b, for vectors (3,)."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@part
def turn(share: float, A: np.ndarray, B: np.ndarray, w: np.ndarray) -> None:
    """Write a share of the turn from A to B, as of `rotation_error`, into w (3,)."""
    for i in range(3):
        w[i] = 0.0  # becomes sin(angle) axis, half of what is antisymmetric in R = B A'
    trace = 0.0  # of R
    for j in range(3):
        w[0] += (A[1, j] * B[2, j] - A[2, j] * B[1, j]) / 2.0
        w[1] += (A[2, j] * B[0, j] - A[0, j] * B[2, j]) / 2.0
        w[2] += (A[0, j] * B[1, j] - A[1, j] * B[0, j]) / 2.0
        trace += A[0, j] * B[0, j] + A[1, j] * B[1, j] + A[2, j] * B[2, j]
    sine = np.sqrt(dot(w, w))
    cosine = (trace - 1.0) / 2.0
    angle = np.arctan2(sine, cosine)
    if angle > np.pi - _NEAR_HALF_A_TURN:
        axis = _axis_of(A, B, cosine)
        if dot(axis, w) < 0.0:
            angle = -angle
        for i in range(3):
            w[i] = share * angle * axis[i]
    elif sine > 0.0:
        for i in range(3):
            w[i] *= share * angle / sine


@part
def _axis_of(A: np.ndarray, B: np.ndarray, cosine: float) -> np.ndarray:
    """The axis a of R = B A', up to its sign, from (R + R')/2 = cos I + (1 - cos) a a'."""
    R = np.empty((3, 3))
    for i in range(3):
        for j in range(3):
            R[i, j] = A[j, 0] * B[i, 0] + A[j, 1] * B[i, 1] + A[j, 2] * B[i, 2]
    k = 0  # the largest element of a
    for i in range(1, 3):
        if R[i, i] > R[k, k]:
            k = i
    axis = np.empty(3)
    axis[k] = np.sqrt((R[k, k] - cosine) / (1.0 - cosine))
    for i in range(3):
        if i != k:
            axis[i] = (R[i, k] + R[k, i]) / 2.0 / (1.0 - cosine) / axis[k]
    return axis


@direct
@compiled(float64[::1](matrix(), matrix()))
def rotation_error(A: np.ndarray, B: np.ndarray) -> np.ndarray:
    """The turn from A to B: the rotation vector of B A', (3,) [rad], in the base of both.

    Args:
        A: (3, 3).
        B: (3, 3).
    """
    w = np.empty(3)
    turn(1.0, A, B, w)
    return w


@direct
@compiled((float64, matrix(), matrix(), float64[::1]))
def part_of_turn(share: float, A: np.ndarray, B: np.ndarray, e: np.ndarray) -> None:
    """Write a share of the turn from A to B into e: with k for the share, k e.

    To write takes half the time of returning an array.

    Args:
        share: What the turn is multiplied by.
        A: (3, 3).
        B: (3, 3).
        e: (3,) receives the result [rad].
    """
    turn(share, A, B, e)
