"""Paths in space: the quintic of Eq. (36), and rotations as matrices, vectors and quaternions."""

import math
from collections.abc import Callable

import numpy as np
import pinocchio as pin

from redres_ros.types import Quaternion, Rotation, RotationVector

PEAK_SPEED = 15.0 / 8.0  # largest ds/dxi of the quintic
PEAK_ACCELERATION = 10.0 / math.sqrt(3.0)  # largest d2s/dxi2

rotation_matrix: Callable[[RotationVector], Rotation] = pin.exp3  # about a vector by its length
rate_matrix: Callable[[RotationVector], np.ndarray] = pin.Jexp3  # G of w = G' dv/dt
# Rz(yaw) Ry(pitch) Rx(roll) of three angles: turns about the axes of the base
from_roll_pitch_yaw: Callable[[RotationVector], Rotation] = pin.rpy.rpyToMatrix


def quintic(xi: float) -> tuple[float, float]:
    """s(xi), ds/dxi of Eq. (36): 0 to 1, velocity and acceleration 0 at the ends; xi is clipped."""
    xi = min(max(xi, 0.0), 1.0)
    return xi**3 * (10.0 + xi * (6.0 * xi - 15.0)), 30.0 * xi**2 * (1.0 - xi) ** 2


def quintics(xi: np.ndarray) -> np.ndarray:
    """s(xi) of Eq. (36) for each of several, (N,)."""
    xi = np.clip(xi, 0.0, 1.0)
    return xi**3 * (10.0 + xi * (6.0 * xi - 15.0))


def from_quaternion(quaternion: Quaternion) -> Rotation:
    """The rotation of a quaternion of any length but zero."""
    return pin.Quaternion(quaternion / math.hypot(*quaternion)).toRotationMatrix()  # of 1e200 too


def to_quaternion(R: Rotation) -> Quaternion:
    """The unit quaternion of R, w >= 0."""
    quaternion: Quaternion = pin.Quaternion(R).coeffs()
    return quaternion * math.copysign(1.0, quaternion[3])
