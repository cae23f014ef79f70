"""The moving joints of a URDF, and where they bring the tip; RobotModel is for use in a loop."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
import pinocchio as pin

from redres_ros.robots.chain import axis_of, limits_of
from redres_ros.robots.urdf import Urdf, UrdfJoint

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
        tip_frame: The link that is the tip.
        description: The URDF's text.
        base_frame: The root link.
    """

    joints: tuple[MovingJoint, ...]
    tip: np.ndarray
    tip_parent: int
    tip_frame: str
    description: str
    base_frame: str

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
        base_frame = tree[0].parent
        return cls(tuple(joints), tip, tip_parent, tip_frame, urdf.text(), base_frame)

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
    def offsets(self) -> np.ndarray:
        """From each joint that leads to the tip to the next, the last to the tip, (k, 3) [m]."""
        to_the_next = [self.joints[index].before[:3, 3] for index in self.leading[1:]]
        return np.array([*to_the_next, self.tip[:3, 3]])

    @cached_property
    def _pinocchio(self) -> tuple[pin.Model, pin.Data, int]:
        """Pinocchio's model and data, and the tip's frame in them."""
        model = pin.buildModelFromXML(self.description)
        return model, model.createData(), model.getFrameId(self.tip_frame, pin.BODY)

    def position(self, q: np.ndarray) -> np.ndarray:
        """The tip's position in the base frame, (3,) [m], at q (n,) [rad] or [m]."""
        model, data, tip = self._pinocchio
        pin.forwardKinematics(model, data, q)
        x: np.ndarray = pin.updateFramePlacement(model, data, tip).translation.copy()
        return x

    def jacobian(self, q: np.ndarray) -> np.ndarray:
        """The Jacobian of the tip in the base frame, (6, n), linear rows first, at q (n,)."""
        model, data, tip = self._pinocchio
        J: np.ndarray = pin.computeFrameJacobian(model, data, q, tip, pin.LOCAL_WORLD_ALIGNED)
        return J
