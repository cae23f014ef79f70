"""The moving joints of a URDF, where they bring the tip, and the capsules around the links.

RobotModel is for use in a loop.
"""

from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np
import pinocchio as pin

from redres_ros.errors import ArrayError, FileError, reason_of
from redres_ros.types import Jacobian, JointPositions, Meters, Position

BASE = -1  # in place of a joint's index
_DEFAULT_RADIUS = 0.06  # [m] of a body
_SHORTEST = 0.02  # [m] between joints that gets a body


@dataclass(frozen=True)
class _MovingJoint:
    """A joint that moves, and the link that it moves."""

    name: str
    link: str
    before: np.ndarray  # transform from the frame that the parent moves to this joint's, (4, 4)
    parent: int  # index of the moving joint before it; BASE: there is none
    axis: np.ndarray  # unit vector in the joint's frame, (3,)
    is_prismatic: bool  # it moves along its axis instead of turning about it


class Kinematics:
    """The moving joints, and the tip: a serial arm, or a tree that has several tips.

    Attributes:
        joints: Moving joints, in the order of every array.
        links: Of each link the joint that moves it, or BASE, and its pose in that frame, (4, 4).
        tip: Transform from the frame that the last joint before the tip moves, (4, 4).
        base_frame: The root link.
    """

    def __init__(self, description: str, tip_frame: str, source: str) -> None:
        """That of a URDF's text from `Arm.description`. Raises FileError, which names `source`."""
        try:
            model = pin.buildModelFromXML(description)
        except ValueError as error:
            raise FileError(f'Pinocchio cannot use {source}: {reason_of(error)}') from None
        self.model = model
        self._data = model.createData()
        self._tip = model.getFrameId(tip_frame, pin.BODY)
        links = [frame for frame in model.frames if frame.type == pin.BODY]
        self.links = {
            link.name: (link.parentJoint - 1, link.placement.homogeneous) for link in links
        }
        self.joints = tuple(map(self._joint, range(model.nv)))
        self.n = model.nv
        self.lower = model.lowerPositionLimit.copy()  # (n,) [rad], like the next
        self.upper = model.upperPositionLimit.copy()
        self.velocity = model.velocityLimit.copy()  # (n,) [rad/s]
        self._tip_parent, self.tip = self.links[tip_frame]
        self.base_frame = links[0].name

    def _joint(self, index: int) -> _MovingJoint:
        """The joint of that index, which is one less than in Pinocchio's model."""
        model = self.model
        J = pin.computeJointJacobian(model, self._data, pin.neutral(model), index + 1)
        linear, angular = np.split(J[:, index], 2)  # in the joint's own frame
        is_prismatic = bool(linear.any())
        return _MovingJoint(
            model.names[index + 1],
            next(link for link, (joint, _) in self.links.items() if joint == index),
            model.jointPlacements[index + 1].homogeneous,
            model.parents[index + 1] - 1,
            linear if is_prismatic else angular,
            is_prismatic,
        )

    @property
    def leading(self) -> list[int]:
        """Indices of the joints that lead to the tip, from the base on."""
        _, *joints = self.model.supports[self._tip_parent + 1]  # the first one is the base
        return [joint - 1 for joint in joints]

    @property
    def offsets(self) -> np.ndarray:
        """From each joint that leads to the tip to the next, the last to the tip, (k, 3) [m]."""
        to_the_next = [self.joints[index].before[:3, 3] for index in self.leading[1:]]
        return np.array([*to_the_next, self.tip[:3, 3]])

    @cached_property
    def chain(self) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
        """From the base to the tip, as kernels/look_ahead.py takes it."""
        joints = [self.joints[index] for index in self.leading]
        z = np.array((0.0, 0.0, 1.0))
        places = [(joint.before, joint.axis) for joint in joints]
        turns = []
        offsets = []
        from_z = np.eye(3)  # to the axis of the joint before
        for before, axis in (*places, (self.tip, z)):
            offsets.append(from_z.T.dot(before[:3, 3]))
            turn = from_z.T.dot(before[:3, :3])
            from_z = pin.Quaternion.FromTwoVectors(z, axis).toRotationMatrix()
            turns.append(turn.dot(from_z))
        slides = np.array([joint.is_prismatic for joint in joints])
        return np.array(turns), np.array(offsets), np.array(self.leading, np.int64), slides

    @cached_property
    def max_point_jacobian(self) -> np.ndarray:
        """How far a radian, or a metre, of each joint moves any link's origin at most, (n,) [m]."""
        farthest = np.zeros(self.n)  # from the joint
        for index, pose in self.links.values():
            if index != BASE:
                farthest[index] = max(farthest[index], np.linalg.norm(pose[:3, 3]))
        for index in range(self.n - 1, -1, -1):
            joint = self.joints[index]
            if joint.is_prismatic:
                farthest[index] += max(abs(self.lower[index]), abs(self.upper[index]))
            if joint.parent != BASE:
                beyond = np.linalg.norm(joint.before[:3, 3]) + farthest[index]
                farthest[joint.parent] = max(farthest[joint.parent], beyond)
        return np.where([joint.is_prismatic for joint in self.joints], 1.0, farthest)

    def tip_at(self, q: JointPositions) -> tuple[Position, Jacobian]:
        """The tip's position and Jacobian (6, n) in the base frame, linear rows first."""
        J = pin.computeFrameJacobian(self.model, self._data, q, self._tip, pin.LOCAL_WORLD_ALIGNED)
        return self._data.oMf[self._tip].translation.copy(), J


class Bodies(NamedTuple):
    """B capsules around the lines from joint to joint, whose distances are cheap to compute."""

    links: tuple[str, ...]  # the name of the link of each; that of the base is 'base'
    moved_by: np.ndarray  # how many joints move each, (B,) of int64
    ends: np.ndarray  # of each axis, in the frame that its last joint moves, (B, 2, 3) [m]
    radius: np.ndarray  # (B,) [m]

    @classmethod
    def along(cls, kinematics: Kinematics, radius: tuple[float, ...]) -> 'Bodies':
        """The bodies of an arm, by its `body_radius`. Raises ArrayError for that of other links."""
        number = kinematics.n + 1
        radius = radius or (_DEFAULT_RADIUS,) * number
        if len(radius) != number:
            raise ArrayError(
                f'body_radius has {len(radius)} values; expected {number}, '
                'one for the base and one for each link'
            )
        offsets = np.vstack((kinematics.joints[0].before[:3, 3], kinematics.offsets))  # (n + 1, 3)
        length = np.linalg.norm(offsets, axis=1)
        thickness = np.array(radius)
        # the last cap ends at the tip, which may be in contact
        offsets[-1] *= max(1.0 - radius[-1] / max(length[-1], _SHORTEST), 0.0)
        chosen = np.flatnonzero((thickness > 0.0) & (length > _SHORTEST))
        links = ('base', *(joint.link for joint in kinematics.joints))
        ends = np.zeros((len(chosen), 2, 3))
        ends[:, 1] = offsets[chosen]
        return cls(tuple(links[index] for index in chosen), chosen, ends, thickness[chosen])

    def pairs(self, apart: Meters) -> np.ndarray:
        """Pairs that may collide, (P, 2) of int64: on the straight arm more than `apart` apart."""
        length = np.linalg.norm(self.ends[:, 1] - self.ends[:, 0], axis=1)
        pairs = [
            (i, j)
            for j in range(len(length))
            for i in range(j)
            if length[i + 1 : j].sum() - self.radius[i] - self.radius[j] > apart
        ]
        return np.array(pairs, np.int64).reshape(-1, 2)
