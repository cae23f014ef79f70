"""Rotations as matrices (3, 3), rotation vectors (3,), quaternions and angles."""

import math

import numpy as np

from redres_ros.types import Quaternion, Rotation, RotationVector

_NO_TURN = np.eye(3)


def rotation_vector(R: Rotation) -> RotationVector:
    """The logarithm of R: its axis times its angle, the angle at most pi."""
    from redres_ros.kernels.tick import rotation_error  # for which many need not wait

    return rotation_error(_NO_TURN, R)


def rotation_matrix(vector: RotationVector) -> Rotation:
    """The rotation about a vector by its length, by Rodrigues' formula."""
    angle = math.sqrt(vector.dot(vector))
    if angle == 0.0:
        return np.eye(3)
    x, y, z = (vector / angle).tolist()
    K = np.array(((0.0, -z, y), (z, 0.0, -x), (-y, x, 0.0)))  # K v = axis x v
    return np.eye(3) + math.sin(angle) * K + (1.0 - math.cos(angle)) * K.dot(K)


def from_quaternion(quaternion: Quaternion) -> Rotation:
    """The rotation of a quaternion of any length but zero."""
    x, y, z, w = (quaternion / math.hypot(*quaternion)).tolist()  # of 1e200 too
    return np.array(
        (
            (1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y - z * w), 2.0 * (x * z + y * w)),
            (2.0 * (x * y + z * w), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z - x * w)),
            (2.0 * (x * z - y * w), 2.0 * (y * z + x * w), 1.0 - 2.0 * (x * x + y * y)),
        )
    )


def from_roll_pitch_yaw(angles: RotationVector) -> Rotation:
    """Rz(yaw) Ry(pitch) Rx(roll) of the three angles: turns about the axes of the base."""
    roll, pitch, yaw = (rotation_matrix(turn) for turn in np.diag(angles))
    return yaw.dot(pitch).dot(roll)


def to_quaternion(R: Rotation) -> Quaternion:
    """The unit quaternion of R, w >= 0."""
    vector = rotation_vector(R)
    angle = math.sqrt(vector.dot(vector))
    ratio = math.sin(angle / 2.0) / angle if angle > 0.0 else 0.5
    x, y, z = (ratio * vector).tolist()
    return np.array((x, y, z, math.cos(angle / 2.0)))
