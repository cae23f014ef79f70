"""Paths in space: the quintic of Eq. (36), and rotations as matrices, rotation vectors, quaternions
and angles.
"""

import math

import numpy as np

from redres_ros.types import Quaternion, Rotation, RotationVector

PEAK_SPEED = 15.0 / 8.0  # largest ds/dxi of the quintic
PEAK_ACCELERATION = 10.0 / math.sqrt(3.0)  # largest d2s/dxi2

_NO_TURN = np.eye(3)


def quintic(xi: float) -> tuple[float, float]:
    """s(xi) and ds/dxi of Eq. (36): from 0 to 1, velocity and acceleration 0 at both ends; xi is
    clipped to [0, 1].
    """
    xi = min(max(xi, 0.0), 1.0)
    return xi**3 * (10.0 + xi * (6.0 * xi - 15.0)), 30.0 * xi**2 * (1.0 - xi) ** 2


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
