"""Limits of an arm's joints: from its URDF, and accelerations from the table of arms."""

from dataclasses import dataclass

import numpy as np

from redres_ros.errors import ArrayError
from redres_ros.robots import Arm
from redres_ros.robots.arm import EndSpeed


@dataclass(frozen=True, eq=False)
class JointLimits:
    """Limits of each joint; those of a prismatic one are in [m], [m/s] and [m/s^2].

    Attributes:
        joint_names: Names from base to tip, the order of the arrays.
        lower: Positions, (n,) [rad].
        upper: Positions, (n,) [rad].
        velocity: Either way, (n,) [rad/s].
        acceleration: Either way, (n,) [rad/s^2]; infinite where there is no limit.
        end_speeds: Of each joint, near the ends of its range; empty: the velocity everywhere.
    """

    joint_names: tuple[str, ...]
    lower: np.ndarray
    upper: np.ndarray
    velocity: np.ndarray
    acceleration: np.ndarray
    end_speeds: tuple[EndSpeed, ...] = ()

    @classmethod
    def of(cls, arm: Arm) -> 'JointLimits':
        """The limits of an arm, joints in the order from base to tip.

        Raises:
            FileError: A joint of the URDF that cannot be used.
            UnknownNameError: No link has the tip's or the elbow's name.
            ArrayError: Acceleration limits of other joints, or not above zero.
        """
        kinematics = arm.kinematics()
        acceleration = np.full(kinematics.n, np.inf)  # (n,) [rad/s^2]
        if arm.acceleration_limit:
            acceleration = np.array(arm.acceleration_limit)
        if not (acceleration > 0.0).all():
            raise ArrayError(
                f'acceleration_limit is {arm.acceleration_limit}; expected values above zero'
            )
        names = tuple(joint.name for joint in kinematics.joints)
        return cls(
            names,
            kinematics.lower,
            kinematics.upper,
            kinematics.velocity,
            acceleration,
            arm.end_speeds,
        )

    def velocities_at(self, q: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """The least and the largest velocity at q (n,) [rad], both (n,) [rad/s]."""
        V = self.velocity
        if not self.end_speeds:
            return -V, V
        lower, upper, deceleration, offset = np.array(self.end_speeds).T
        down = np.sqrt(2.0 * deceleration * np.maximum(q - lower, 0.0)) - offset
        up = np.sqrt(2.0 * deceleration * np.maximum(upper - q, 0.0)) - offset
        return -np.clip(down, 0.0, V), np.clip(up, 0.0, V)
