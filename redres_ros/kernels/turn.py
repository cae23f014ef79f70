"""The turn between two rotations."""

import numpy as np
from numba import float64

from redres_ros.kernels.arithmetic import dot
from redres_ros.kernels.compiled import compiled, direct, matrix

# [rad] this near to half a turn, the axis is read from the symmetric part of the matrix
NEAR_HALF_A_TURN = 0.1


@direct
@compiled(float64[::1](matrix(), matrix()))
def turn_between(A: np.ndarray, B: np.ndarray) -> np.ndarray:
    """The turn from A to B: the rotation vector of B A', (3,) [rad], in the base of both.

    Args:
        A: (3, 3).
        B: (3, 3).
    """
    R = np.empty((3, 3))
    for i in range(3):
        for j in range(3):
            R[i, j] = A[j, 0] * B[i, 0] + A[j, 1] * B[i, 1] + A[j, 2] * B[i, 2]
    w = np.empty(3)  # sin(angle) axis
    w[0] = (R[2, 1] - R[1, 2]) / 2.0
    w[1] = (R[0, 2] - R[2, 0]) / 2.0
    w[2] = (R[1, 0] - R[0, 1]) / 2.0
    sine = np.sqrt(dot(w, w))
    cosine = (R[0, 0] + R[1, 1] + R[2, 2] - 1.0) / 2.0
    angle = np.arctan2(sine, cosine)
    if angle <= np.pi - NEAR_HALF_A_TURN:
        if sine > 0.0:
            for i in range(3):
                w[i] *= angle / sine
        return w
    # The unit axis a, from (R + R')/2 = cos I + (1 - cos) a a'; w gives its sign.
    k = 0  # its largest element
    for i in range(1, 3):
        if R[i, i] > R[k, k]:
            k = i
    a_k = np.sqrt((R[k, k] - cosine) / (1.0 - cosine))
    axis = np.empty(3)
    for i in range(3):
        axis[i] = (R[i, k] + R[k, i]) / 2.0 / (1.0 - cosine) / a_k
    axis[k] = a_k
    if dot(axis, w) < 0.0:
        angle = -angle
    for i in range(3):
        axis[i] *= angle
    return axis
