"""Messages to arrays and back."""

import math
from collections.abc import Callable, Collection, Sequence

import numpy as np
from geometry_msgs.msg import PoseStamped
from sensor_msgs.msg import JointState

from redres_ros.errors import ArrayError, JointNamesError, RedresError, UnknownNameError, one_line
from redres_ros.geometry import from_quaternion, to_quaternion
from redres_ros.nodes.wire import JointSample, to_time
from redres_ros.robot_model import RobotModel
from redres_ros.types import (
    JointPositions,
    JointVelocities,
    Nanoseconds,
    Position,
    Rotation,
    Twist,
)

_REMEMBERED = 100  # sets of joint names: of as many devices as may share a topic


class _FrameError(RedresError):
    """A message in an unknown frame."""


class _LengthError(ArrayError):
    """The number of values is not the number of joints."""


class JointMapper:
    """Finds an arm's joints by name, in any order and among others: of a gripper, of another robot.

    Args:
        names: Names of the arm's joints, in our order.
        report: Called once for each set of foreign joints, which are ignored.
    """

    def __init__(self, names: Sequence[str], report: Callable[[str], object] | None = None) -> None:
        self.names = tuple(names)
        self._report = report
        # Places of our joints among the names that came; None: as ours.
        self._orders: dict[tuple[str, ...], np.ndarray | None] = {self.names: None}
        self._foreign: set[tuple[str, ...]] = set()  # sets of names without any of ours

    def concerns(self, message: JointState | JointSample) -> bool:
        """Whether a message names any of the arm's joints; one of another device need not."""
        names = tuple(message.name)
        if names in self._foreign:
            return False
        if names in self._orders or not names or set(names) & set(self.names):
            return True
        if len(self._foreign) < _REMEMBERED:
            self._foreign.add(names)
            self._report_foreign(names)
        return False

    def positions(self, message: JointState | JointSample) -> JointPositions:
        """q in our order; raises as in_order() does."""
        return self.in_order(message.name, message.position, 'positions')

    def velocities(self, message: JointState) -> JointVelocities:
        """dq in our order; raises as in_order() does."""
        return self.in_order(message.name, message.velocity, 'velocities')

    def in_order(
        self, names: Sequence[str], given: Sequence[float] | np.ndarray, what: str
    ) -> np.ndarray:
        """A value of each of our joints, (n,), which need not be finite.

        Args:
            names: Names of joints.
            given: A value for each.
            what: The word for them in an error.

        Raises:
            JointNamesError: A joint of the arm is missing, or named twice.
            _LengthError: There is not one value for each name.
        """
        key = tuple(names)
        order = self._orders[key] if key in self._orders else self._learn(key)
        if len(given) != len(names):
            raise _LengthError(
                f'{len(given)} {what} for {len(names)} joints; expected one value per joint'
            )
        values = given if isinstance(given, np.ndarray) else np.array(given)
        return values if order is None else values[order]

    def _learn(self, names: tuple[str, ...]) -> np.ndarray:
        """The places of our joints among the names, (n,)."""
        if any(names.count(name) != 1 for name in self.names):
            raise JointNamesError(names, self.names)
        self._report_foreign([name for name in names if name not in self.names])
        order = np.array([names.index(name) for name in self.names])
        if len(self._orders) < _REMEMBERED:
            self._orders[names] = order
        return order

    def _report_foreign(self, others: Sequence[str]) -> None:
        if others and self._report:
            self._report(f'joint_states: ignoring {one_line(", ".join(others))}, not of this arm')


class TwistTransformer:
    """Turns velocities of the tip from the axes of any link into those of the base, which may have
    a further name.
    """

    def __init__(self, model: RobotModel, base_frame: str) -> None:
        self._model = model
        self._base_frames = ('', base_frame, model.base_frame)

    def to_base(self, dx: Twist, frame: str, q: JointPositions) -> Twist:
        """The same velocity in the axes of the base. Raises RedresError for an unknown frame."""
        if frame in self._base_frames:
            return dx
        try:
            _, R = self._model.pose(q, frame)
        except UnknownNameError as error:
            raise _FrameError(f'cartesian_velocity: {error}') from None
        return np.concatenate((R.dot(dx[:3]), R.dot(dx[3:])))


def from_pose(message: PoseStamped, frames: Collection[str]) -> tuple[Position, Rotation]:
    """Position and orientation of a target_pose in one of the frames.

    A quaternion of any length but 0 counts by its direction. Raises RedresError for another frame,
    NaN or infinity.
    """
    if message.header.frame_id not in frames:
        allowed = ', '.join(map(repr, frames))
        raise _FrameError(f'target_pose is in {message.header.frame_id!r}; allowed: {allowed}')
    position = message.pose.position
    turn = message.pose.orientation
    x = np.array((position.x, position.y, position.z))
    direction = np.array((turn.x, turn.y, turn.z, turn.w))
    size = math.hypot(*direction)
    if not (np.isfinite(x).all() and 0.0 < size < np.inf):
        raise ArrayError(f'target_pose is {x.tolist()}, {direction.tolist()}; expected a pose')
    return x, from_quaternion(direction)


def to_pose(stamp: Nanoseconds, frame: str, x: Position, R: Rotation) -> PoseStamped:
    """A pose as a message, with a unit quaternion."""
    message = PoseStamped()
    message.header.stamp = to_time(stamp)
    message.header.frame_id = frame
    message.pose.position.x, message.pose.position.y, message.pose.position.z = x.tolist()
    orientation = message.pose.orientation
    orientation.x, orientation.y, orientation.z, orientation.w = to_quaternion(R).tolist()
    return message
