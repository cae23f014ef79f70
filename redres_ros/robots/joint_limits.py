"""Limits of an arm's joints: from its URDF, and accelerations from the table of arms."""

from dataclasses import dataclass

import numpy as np

from redres_ros.errors import ArrayError
from redres_ros.robots import Arm


@dataclass(frozen=True, eq=False)
class JointLimits:
    """Limits of each joint; those of a prismatic one are in [m], [m/s] and [m/s^2].

    Attributes:
        joint_names: From base to tip, the order of the arrays.
        lower: Positions, (n,) [rad].
        upper: Positions, (n,) [rad].
        velocity: Either way, (n,) [rad/s].
        acceleration: Either way, (n,) [rad/s^2]; infinite where there is no limit.
    """

    joint_names: tuple[str, ...]
    lower: np.ndarray
    upper: np.ndarray
    velocity: np.ndarray
    acceleration: np.ndarray

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
        return cls(names, kinematics.lower, kinematics.upper, kinematics.velocity, acceleration)
