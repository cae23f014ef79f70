"""Rotations as matrices (3, 3), rotation vectors (3,), quaternions and angles."""

import math

import numpy as np
from numba import float64

from redres_ros.compiled import compiled, matrix

# [rad] this near to half a turn, the axis is read from the symmetric part of the matrix
_NEAR_HALF_A_TURN = 0.1
_NO_TURN = np.eye(3)


def rotation_vector(R: np.ndarray) -> np.ndarray:
    """The logarithm of R (3, 3): its axis times its angle, (3,) [rad], the angle at most pi."""
    return turn_between(_NO_TURN, R)


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
    sine = np.sqrt(w[0] ** 2 + w[1] ** 2 + w[2] ** 2)
    cosine = (R[0, 0] + R[1, 1] + R[2, 2] - 1.0) / 2.0
    angle = np.arctan2(sine, cosine)
    if angle <= np.pi - _NEAR_HALF_A_TURN:
        return w * (angle / sine) if sine > 0.0 else w
    # The unit axis a, from (R + R')/2 = cos I + (1 - cos) a a'; w gives its sign.
    outer = ((R + R.T) / 2.0 - cosine * np.eye(3)) / (1.0 - cosine)
    column = np.argmax(np.diag(outer))
    axis = outer[column] / np.sqrt(outer[column, column])
    along = axis[0] * w[0] + axis[1] * w[1] + axis[2] * w[2]
    return axis * (-angle if along < 0.0 else angle)


def rotation_matrix(vector: np.ndarray) -> np.ndarray:
    """The rotation (3, 3) about a vector (3,) by its length [rad], by Rodrigues' formula."""
    angle = math.sqrt(vector.dot(vector))
    if angle == 0.0:
        return np.eye(3)
    x, y, z = (vector / angle).tolist()
    K = np.array(((0.0, -z, y), (z, 0.0, -x), (-y, x, 0.0)))  # K v = axis x v
    R: np.ndarray = np.eye(3) + math.sin(angle) * K + (1.0 - math.cos(angle)) * K.dot(K)
    return R


def from_quaternion(quaternion: np.ndarray) -> np.ndarray:
    """The rotation (3, 3) of a quaternion x, y, z, w of any length but zero."""
    x, y, z, w = (quaternion / np.linalg.norm(quaternion)).tolist()
    return np.array(
        (
            (1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y - z * w), 2.0 * (x * z + y * w)),
            (2.0 * (x * y + z * w), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z - x * w)),
            (2.0 * (x * z - y * w), 2.0 * (y * z + x * w), 1.0 - 2.0 * (x * x + y * y)),
        )
    )


def from_roll_pitch_yaw(angles: np.ndarray) -> np.ndarray:
    """Rz(yaw) Ry(pitch) Rx(roll), (3, 3), of (3,) [rad]: turns about the axes of the base."""
    roll, pitch, yaw = (rotation_matrix(turn) for turn in np.diag(angles))
    R: np.ndarray = yaw.dot(pitch).dot(roll)
    return R


def to_quaternion(R: np.ndarray) -> np.ndarray:
    """The unit quaternion x, y, z, w (4,) of R (3, 3), w >= 0."""
    vector = rotation_vector(R)
    half = math.sqrt(vector.dot(vector)) / 2.0
    return np.append(vector * (np.sinc(half / math.pi) / 2.0), math.cos(half))
