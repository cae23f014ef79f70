"""Limits of an arm's joints: from its URDF, the table of arms, or a file of MoveIt's."""

from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from redres_ros.errors import FileError, RangeError
from redres_ros.files.text import read_yaml
from redres_ros.robots.arm import ACCELERATIONS, Arm, EndSpeed
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


def with_accelerations(arm: Arm, given: str | tuple[float, ...]) -> Arm:
    """An arm with these acceleration limits, or with those of a MoveIt joint_limits.yaml and its
    velocity limits where they are lower; empty: its own. Raises FileError, RangeError.
    """
    if given in ('', (), arm.acceleration_limit):
        return arm
    if isinstance(given, str):
        content = read_yaml(Path(given))
        kinematics = arm.kinematics()
        names = [joint.name for joint in kinematics.joints]
        accelerations = tuple(_of_moveit(content, name, 'acceleration') for name in names)
        if np.inf in accelerations:
            none = [name for name, A in zip(names, accelerations, strict=True) if A == np.inf]
            expected = 'has_acceleration_limits: true, and max_acceleration'
            raise FileError(f'{given} does not limit {", ".join(none)}; expected {expected}')
        velocities = [_of_moveit(content, name, 'velocity') for name in names]
        velocities = np.minimum(velocities, kinematics.velocity).tolist()
        arm = replace(arm, velocity_limit=tuple(velocities))
        given = accelerations
    others = tuple(each for each in arm.assumptions if 'acceleration limits' not in each)
    return replace(arm, acceleration_limit=given, assumptions=others)


def _of_moveit(content: Any, joint: str, kind: str) -> float:
    """A joint's limit in a joint_limits.yaml; infinite if there is none."""
    try:
        own = content['joint_limits'][joint]
        limit = own[f'max_{kind}'] if own[f'has_{kind}_limits'] else np.inf
    except (KeyError, TypeError):
        return np.inf
    if not (isinstance(limit, float | int) and limit > 0.0):
        raise RangeError(f'max_{kind} of {joint}', limit, *ACCELERATIONS)
    return float(limit)
