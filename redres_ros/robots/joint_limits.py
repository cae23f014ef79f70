"""Limits of an arm's joints: from its URDF, and accelerations from the table of arms."""

from dataclasses import dataclass

import numpy as np

from redres_ros.robots.arm import Arm, EndSpeed
from redres_ros.types import JointAccelerations, JointPositions, JointVelocities


@dataclass(frozen=True, eq=False)
class JointLimits:
    """Limits of each joint, from base to tip, either way."""

    joint_names: tuple[str, ...]
    lower: JointPositions
    upper: JointPositions
    velocity: JointVelocities
    acceleration: JointAccelerations  # infinite where there is no limit
    end_speeds: tuple[EndSpeed, ...] = ()  # empty: the velocity everywhere

    @classmethod
    def of(cls, arm: Arm) -> 'JointLimits':
        """Raises as `Arm.description`."""
        kinematics = arm.kinematics()
        acceleration = np.array(arm.acceleration_limit or (np.inf,) * kinematics.n)
        return cls(
            tuple(joint.name for joint in kinematics.joints),
            kinematics.lower,
            kinematics.upper,
            kinematics.velocity,
            acceleration,
            arm.end_speeds,
        )

    def velocities_at(self, q: JointPositions) -> tuple[JointVelocities, JointVelocities]:
        """The least and the largest velocity at q."""
        V = self.velocity
        if not self.end_speeds:
            return -V, V
        lower, upper, deceleration, offset = np.array(self.end_speeds).T
        down = np.sqrt(2.0 * deceleration * np.maximum(q - lower, 0.0)) - offset
        up = np.sqrt(2.0 * deceleration * np.maximum(upper - q, 0.0)) - offset
        return -np.clip(down, 0.0, V), np.clip(up, 0.0, V)
