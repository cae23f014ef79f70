"""Messages to arrays and back."""

import math
from collections.abc import Callable, Collection, Sequence
from typing import Any

import numpy as np
from builtin_interfaces.msg import Time
from geometry_msgs.msg import PoseStamped, TwistStamped, Vector3
from nav_msgs.msg import Path
from rclpy.serialization import deserialize_message
from sensor_msgs.msg import JointState
from std_msgs.msg import Header

from redres_ros.errors import ArrayError, JointNamesError, RedresError, one_line
from redres_ros.geometry import from_quaternion, to_quaternion
from redres_ros.loop.cycle_counter import NANOSECONDS
from redres_ros.preview import Preview
from redres_ros.types import (
    JointPositions,
    JointTorques,
    JointVelocities,
    Nanoseconds,
    Position,
    Rotation,
    TaskVelocity,
    Twist,
)

_UNTURNED = np.eye(3)
_MOST_POSES = 1000  # of a path


class EncodingError(RedresError):
    """Bytes that are no message of the type that they came as, or a stamp that is no time."""


def to_joint_state(
    stamp: Nanoseconds,
    names: Sequence[str],
    q: JointPositions | None = None,
    dq: JointVelocities | None = None,
    effort: JointTorques | None = None,
) -> JointState:
    """A state of the named joints, or a command for them; what is not given stays empty."""
    values = {'position': q, 'velocity': dq, 'effort': effort}
    given = {name: array.tolist() for name, array in values.items() if array is not None}
    message = JointState(name=names, **given)
    message.header.stamp = to_time(stamp)
    return message


def to_twist(stamp: Nanoseconds, frame: str, dx: TaskVelocity) -> TwistStamped:
    """A task velocity of 3 or 6 rows in the axes of a frame, as a message."""
    message = TwistStamped(header=Header(stamp=to_time(stamp), frame_id=frame))
    linear = message.twist.linear
    angular = message.twist.angular
    linear.x, linear.y, linear.z = dx[:3].tolist()
    if len(dx) > 3:
        angular.x, angular.y, angular.z = dx[3:].tolist()
    return message


def stacked(linear: Vector3, angular: Vector3) -> Twist:
    """Both vectors of a twist, or force and torque of a wrench, (6,)."""
    return np.array((linear.x, linear.y, linear.z, angular.x, angular.y, angular.z))


def deserialised(data: bytes, kind: Any) -> Any:
    """A message of that type from its bytes. Raises EncodingError if they are none."""
    try:
        return deserialize_message(data, kind)
    except Exception as error:  # noqa: BLE001 (rclpy raises what its middleware does)
        raise EncodingError(f'{len(data)} bytes that are not a {kind.__name__}: {error}') from None


def to_nanoseconds(stamp: Time) -> Nanoseconds:
    """A stamp from a message. Raises EncodingError."""
    if stamp.nanosec >= NANOSECONDS:
        raise EncodingError(f'a stamp with {stamp.nanosec} ns in nanosec; allowed: below 1e9')
    return int(stamp.sec * NANOSECONDS + stamp.nanosec)


def to_time(stamp: Nanoseconds) -> Time:
    return Time(sec=stamp // NANOSECONDS, nanosec=stamp % NANOSECONDS)


class JointMapper:
    """Finds an arm's joints by name, in any order and among others: of a gripper, of another robot.

    `report` is called once, for the first foreign joints; all of them are ignored.
    """

    def __init__(self, names: Sequence[str], report: Callable[[str], object] | None = None) -> None:
        self.names = tuple(names)
        self._report = report

    def concerns(self, message: JointState) -> bool:
        """Whether a message names any of the arm's joints; one of another device need not."""
        names = tuple(message.name)
        if names == self.names:
            return True
        foreign = [name for name in names if name not in self.names]
        if foreign and self._report:
            self._report(f'joint_states: ignoring {one_line(", ".join(foreign))}, not of this arm')
            self._report = None
        return not names or len(foreign) < len(names)

    def in_order(self, message: JointState, field: str) -> np.ndarray:
        """The position, velocity or effort of each of our joints, (n,), which need not be finite.

        Raises JointNamesError for a joint that is missing or named twice, and ArrayError unless
        there is one value for each name.
        """
        names = message.name
        given = getattr(message, field)
        is_ours = tuple(names) == self.names
        if not is_ours and any(names.count(name) != 1 for name in self.names):
            raise JointNamesError(names, self.names)
        if len(given) != len(names):
            raise ArrayError(
                f'{len(given)} values of {field} for {len(names)} joints; expected one for each'
            )
        values = np.array(given)
        return values if is_ours else values[[names.index(name) for name in self.names]]


def from_pose(message: PoseStamped, frames: Collection[str]) -> tuple[Position, Rotation]:
    """Position and orientation of a pose in one of the frames.

    A quaternion of any length but 0 counts by its direction. Raises RedresError for another frame,
    NaN or infinity.
    """
    _check_frame(message.header.frame_id, frames)
    position = message.pose.position
    turn = message.pose.orientation
    x = np.array((position.x, position.y, position.z))
    direction = np.array((turn.x, turn.y, turn.z, turn.w))
    size = math.hypot(*direction)
    if not (np.isfinite(x).all() and 0.0 < size < np.inf):
        raise ArrayError(f'its values are {x.tolist()}, {direction.tolist()}; expected a pose')
    return x, from_quaternion(direction)


def to_pose(stamp: Nanoseconds, frame: str, x: Position, R: Rotation) -> PoseStamped:
    """A pose as a message, with a unit quaternion."""
    message = PoseStamped(header=Header(stamp=to_time(stamp), frame_id=frame))
    message.pose.position.x, message.pose.position.y, message.pose.position.z = x.tolist()
    orientation = message.pose.orientation
    orientation.x, orientation.y, orientation.z, orientation.w = to_quaternion(R).tolist()
    return message


def to_path(stamp: Nanoseconds, frame: str, preview: Preview) -> Path:
    """The path to come after a state, a stamp on the robot's clock for each pose."""
    message = Path(header=Header(stamp=to_time(stamp), frame_id=frame))
    rotations = preview.rotations.reshape(-1, 3, 3)
    for k, (seconds, x) in enumerate(zip(preview.times, preview.positions, strict=True)):
        R = rotations[k] if len(rotations) else _UNTURNED
        message.poses.append(to_pose(stamp + round(NANOSECONDS * seconds), frame, x, R))
    return message


def from_path(message: Path, frames: Collection[str], turns: bool) -> Preview:
    """The path to come as seen from the stamp of its header, with orientations if they count.

    Raises RedresError as from_pose(), and for no poses, too many, or stamps that do not increase.
    """
    count = len(message.poses)
    if not 0 < count <= _MOST_POSES:
        raise ArrayError(f'{count} poses; allowed: 1 to {_MOST_POSES}')
    for frame in {message.header.frame_id, *(each.header.frame_id for each in message.poses)}:
        _check_frame(frame, frames)
    begin = to_nanoseconds(message.header.stamp)
    times = [(to_nanoseconds(each.header.stamp) - begin) / NANOSECONDS for each in message.poses]
    points = [each.pose.position for each in message.poses]
    positions = np.array([(point.x, point.y, point.z) for point in points])
    rotations = None
    if turns:
        rotations = np.array([from_pose(each, frames)[1] for each in message.poses])
    return Preview(np.array(times), positions, rotations)


def _check_frame(frame: str, frames: Collection[str]) -> None:
    if frame not in frames:
        allowed = ', '.join(map(repr, frames))
        raise RedresError(f'it is in {frame!r}; allowed: {allowed}')
