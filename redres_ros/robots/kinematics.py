"""Where a chain's joints and tip are: enough to choose defaults with, and not for any loop."""

from dataclasses import dataclass

import numpy as np

from redres_ros.robots.chain import axis_of, limits_of
from redres_ros.robots.urdf import Urdf, UrdfJoint, motion_of


@dataclass(frozen=True)
class MovingJoint:
    """A joint that moves, and the link that it moves.

    before: (4, 4), from the frame of the link that the last moving joint moves to this joint's.
    axis: Unit vector (3,) in the joint's frame. lower, upper: [rad], or [m] of a prismatic one.
    velocity: [rad/s] or [m/s].
    """

    name: str
    link: str
    before: np.ndarray
    axis: np.ndarray
    is_prismatic: bool
    lower: float
    upper: float
    velocity: float


@dataclass(frozen=True)
class Kinematics:
    """The moving joints from the base to the tip, and the pose (4, 4) of the tip after the last."""

    joints: tuple[MovingJoint, ...]
    tip: np.ndarray

    @classmethod
    def of(cls, urdf: Urdf, chain: tuple[UrdfJoint, ...]) -> 'Kinematics':
        """That of a chain.

        Args:
            urdf: The file.
            chain: Its joints from base to tip, as `settle_chain` leaves them.
        """
        joints: list[MovingJoint] = []
        H = np.eye(4)
        for joint in chain:
            owner = f'joint {joint.name}'
            H = H @ urdf.placement(joint.element, owner)
            if joint.type == 'fixed':
                continue
            axis = axis_of(urdf, joint)
            lower, upper = limits_of(urdf, joint)
            velocity = urdf.number(joint.element.find('limit'), 'velocity', '0', owner)
            is_prismatic = joint.type == 'prismatic'
            joints.append(
                MovingJoint(joint.name, joint.child, H, axis, is_prismatic, lower, upper, velocity)
            )
            H = np.eye(4)
        return cls(tuple(joints), H)

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
    def ways(self) -> np.ndarray:
        """From each joint to the next one, the last to the tip, in the moved link, (n, 3) [m]."""
        to_the_next = [joint.before[:3, 3] for joint in self.joints[1:]]
        return np.array([*to_the_next, self.tip[:3, 3]])

    def poses(self, q: np.ndarray) -> np.ndarray:
        """Poses in the base frame of each joint, and of the tip as the last, (..., n + 1, 4, 4).

        Args:
            q: One posture (n,), or many (..., n) [rad], or [m] of a prismatic joint.
        """
        poses = []
        H = np.eye(4)
        for index, joint in enumerate(self.joints):
            H = H @ joint.before
            poses.append(np.broadcast_to(H, (*q.shape[:-1], 4, 4)))
            H = H @ motion_of(joint.axis, q[..., index], is_prismatic=joint.is_prismatic)
        return np.stack((*poses, H @ self.tip), axis=-3)

    def position(self, q: np.ndarray) -> np.ndarray:
        """The tip's position in the base frame, (..., 3) [m], for q (..., n)."""
        x: np.ndarray = self.poses(q)[..., -1, :3, 3]
        return x

    def jacobian(self, q: np.ndarray) -> np.ndarray:
        """The Jacobian of the tip in the base frame, (..., 6, n), linear rows first."""
        poses = self.poses(q)
        tip = poses[..., -1, :3, 3]
        columns = []
        for index, joint in enumerate(self.joints):
            axis = poses[..., index, :3, :3] @ joint.axis
            linear = np.cross(axis, tip - poses[..., index, :3, 3])
            angular = axis
            if joint.is_prismatic:
                linear = axis
                angular = np.zeros_like(axis)
            columns.append(np.concatenate((linear, angular), axis=-1))
        return np.stack(columns, axis=-1)
