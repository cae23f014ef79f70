"""Limits of an arm's joints: from its URDF and, for acceleration, which has no place there, from
the table of arms.
"""

import math
import xml.etree.ElementTree as ET
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from redres_ros.errors import ArrayError, FileError
from redres_ros.robots import Arm


@dataclass(frozen=True, eq=False)
class JointLimits:
    """Limits of each joint: lower, upper [rad], velocity [rad/s], acceleration [rad/s^2], all (n,).

    All but the velocities can be infinite, which is no limit.
    """

    joint_names: tuple[str, ...]
    lower: np.ndarray
    upper: np.ndarray
    velocity: np.ndarray
    acceleration: np.ndarray

    @classmethod
    def of(cls, arm: Arm) -> 'JointLimits':
        """The limits of an arm, joints in the order from base to tip.

        Raises FileError for a joint without a positive velocity limit, ArrayError for wrong
        acceleration limits.
        """
        joints = _moving_joints(ET.fromstring(arm.description()))
        acceleration = np.array(arm.acceleration_limit or [np.inf] * len(joints))  # (n,)
        if acceleration.shape != (len(joints),) or not (acceleration > 0.0).all():
            raise ArrayError(
                f'acceleration_limit is {arm.acceleration_limit}; '
                f'expected {len(joints)} positive values'
            )
        names = tuple(joint.get('name', '') for joint in joints)
        lower, upper, velocity = (
            np.array([_limit(joint, attribute) for joint in joints])  # each (n,)
            for attribute in ('lower', 'upper', 'velocity')
        )
        for name, allowed in zip(names, velocity, strict=True):
            if not 0.0 < allowed < np.inf:
                raise FileError(
                    f'{arm.urdf}: joint {name} has no velocity limit above zero, '
                    'which the guard needs'
                )
        return cls(names, lower, upper, velocity, acceleration)


def _moving_joints(robot: ET.Element) -> list[ET.Element]:
    """Joints that move, from the root link outwards: a URDF may list them in any order."""
    joints = robot.findall('joint')
    children = {_link(joint, 'child') for joint in joints}
    root = next(
        link.get('name', '') for link in robot.findall('link') if link.get('name') not in children
    )

    def beyond(link: str) -> Iterator[ET.Element]:
        for joint in joints:
            if _link(joint, 'parent') == link:
                yield joint
                yield from beyond(_link(joint, 'child'))

    return [joint for joint in beyond(root) if joint.get('type') != 'fixed']


def _link(joint: ET.Element, end: str) -> str:
    link = joint.find(end)
    return '' if link is None else link.get('link', '')


def _limit(joint: ET.Element, attribute: str) -> float:
    """A limit as the joint gives it; infinite for positions without one, NaN for a missing
    velocity.
    """
    limit = joint.find('limit')
    given = None if limit is None else limit.get(attribute)
    if given is None or (joint.get('type') == 'continuous' and attribute != 'velocity'):
        return {'lower': -math.inf, 'upper': math.inf, 'velocity': math.nan}[attribute]
    return float(given)
