"""Kinematics from a URDF, to choose defaults; not for use in a loop."""

from dataclasses import dataclass

import numpy as np

from redres_ros.robots.chain import axis_of, limits_of
from redres_ros.robots.urdf import Urdf, UrdfJoint, motion_of

BASE = -1  # in place of a joint's index


@dataclass(frozen=True)
class MovingJoint:
    """A joint that moves, and the link that it moves.

    Attributes:
        name: Of the joint.
        link: That it moves.
        before: From the frame that the parent moves to this joint's, (4, 4).
        parent: Index of the moving joint before it; BASE: there is none.
        axis: Unit vector in the joint's frame, (3,).
        is_prismatic: Whether it moves along its axis instead of turning about it.
        lower: Position limit [rad] or [m].
        upper: Position limit [rad] or [m].
        velocity: Limit [rad/s] or [m/s].
    """

    name: str
    link: str
    before: np.ndarray
    parent: int
    axis: np.ndarray
    is_prismatic: bool
    lower: float
    upper: float
    velocity: float


@dataclass(frozen=True)
class Kinematics:
    """The moving joints, and the tip: a serial arm, or a tree that has several tips.

    Attributes:
        joints: In the order of every array.
        tip: From the frame that the last joint before the tip moves, (4, 4).
        tip_parent: Index of that joint.
    """

    joints: tuple[MovingJoint, ...]
    tip: np.ndarray
    tip_parent: int

    @classmethod
    def of(cls, urdf: Urdf, tree: tuple[UrdfJoint, ...], tip_frame: str) -> 'Kinematics':
        """Those of a URDF.

        Args:
            urdf: The file.
            tree: Its joints as `settle_chain` leaves them, each after those before it.
            tip_frame: The link that is the tip.
        """
        joints: list[MovingJoint] = []
        carriers: dict[str, tuple[int, np.ndarray]] = {}  # link to moving joint, and pose from it
        for joint in tree:
            owner = f'joint {joint.name}'
            parent, H = carriers.get(joint.parent, (BASE, np.eye(4)))
            before = H @ urdf.placement(joint.element, owner)
            carriers[joint.child] = (parent, before)
            if joint.type == 'fixed':
                continue
            carriers[joint.child] = (len(joints), np.eye(4))
            lower, upper = limits_of(urdf, joint)
            joints.append(
                MovingJoint(
                    joint.name,
                    joint.child,
                    before,
                    parent,
                    axis_of(urdf, joint),
                    joint.type == 'prismatic',
                    lower,
                    upper,
                    urdf.number(joint.element.find('limit'), 'velocity', '0', owner),
                )
            )
        tip_parent, tip = carriers[tip_frame]
        return cls(tuple(joints), tip, tip_parent)

    @property
    def n(self) -> int:
        """Number of moving joints."""
        return len(self.joints)

    @property
    def lower(self) -> np.ndarray:
        """Lower position limits, (n,) [rad] or [m]."""
        return np.array([joint.lower for joint in self.joints])

    @property
    def upper(self) -> np.ndarray:
        """Upper position limits, (n,) [rad] or [m]."""
        return np.array([joint.upper for joint in self.joints])

    @property
    def velocity(self) -> np.ndarray:
        """Velocity limits, (n,) [rad/s] or [m/s]."""
        return np.array([joint.velocity for joint in self.joints])

    @property
    def leading(self) -> list[int]:
        """Indices of the joints that lead to the tip, from the base on."""
        indices = []
        index = self.tip_parent
        while index != BASE:
            indices.append(index)
            index = self.joints[index].parent
        return indices[::-1]

    @property
    def ways(self) -> np.ndarray:
        """From each joint that leads to the tip to the next, the last to the tip, (k, 3) [m]."""
        to_the_next = [self.joints[index].before[:3, 3] for index in self.leading[1:]]
        return np.array([*to_the_next, self.tip[:3, 3]])

    def poses(self, q: np.ndarray) -> np.ndarray:
        """Poses in the base frame of each joint, and of the tip as the last, (..., n + 1, 4, 4).

        Args:
            q: One posture (n,), or many (..., n) [rad], or [m] of a prismatic joint.
        """
        poses = []
        moved: dict[int, np.ndarray] = {BASE: np.eye(4)}
        for index, joint in enumerate(self.joints):
            H = moved[joint.parent] @ joint.before
            poses.append(np.broadcast_to(H, (*q.shape[:-1], 4, 4)))
            moved[index] = H @ motion_of(joint.axis, q[..., index], is_prismatic=joint.is_prismatic)
        return np.stack((*poses, moved[self.tip_parent] @ self.tip), axis=-3)

    def position(self, q: np.ndarray) -> np.ndarray:
        """The tip's position in the base frame, (..., 3) [m], for q (..., n)."""
        x: np.ndarray = self.poses(q)[..., -1, :3, 3]
        return x

    def jacobian(self, q: np.ndarray) -> np.ndarray:
        """The Jacobian of the tip in the base frame, (..., 6, n), linear rows first."""
        poses = self.poses(q)
        tip = poses[..., -1, :3, 3]
        jacobian = np.zeros((*q.shape[:-1], 6, self.n))
        for index in self.leading:
            joint = self.joints[index]
            axis = poses[..., index, :3, :3] @ joint.axis
            linear = np.cross(axis, tip - poses[..., index, :3, 3])
            angular = axis
            if joint.is_prismatic:
                linear = axis
                angular = np.zeros_like(axis)
            jacobian[..., index] = np.concatenate((linear, angular), axis=-1)
        return jacobian
