"""Messages to arrays and back. Those of the loop are read and written as they go over the wire.

Between the wire and a callback, rclpy makes a Python object of every field, and reads every field
when it publishes one. For a JointState and a TwistStamped that takes 10 to 20 us, as long as the
whole tick; here it takes one or two. The encoding is CDR: numbers are aligned to their size,
counted from the end of a header of 4 bytes.
"""

import math
import struct
from collections.abc import Callable, Collection, Sequence
from typing import Any, NamedTuple

import numpy as np
from builtin_interfaces.msg import Time
from geometry_msgs.msg import PoseStamped, TwistStamped
from rclpy.serialization import deserialize_message, serialize_message
from sensor_msgs.msg import JointState

from redres_ros.errors import ArrayError, JointNamesError, RedresError, UnknownNameError, one_line
from redres_ros.geometry import from_quaternion, to_quaternion
from redres_ros.loop.cycle_counter import NANOSECONDS
from redres_ros.robot_model import RobotModel
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

_LITTLE_ENDIAN = b'\x00\x01'  # plain CDR, what every DDS of ROS 2 sends on today's processors
_STAMP = struct.Struct('<4xiI')  # header of the encoding; seconds, nanoseconds
_STAMP_END = _STAMP.size  # [bytes]
_TIME = struct.Struct('<iI')  # the same without the header
_HEADER = 4  # bytes, which do not count for the alignment
_LENGTH = struct.Struct('<I')  # of a text with its 0 at the end, or of a sequence
_NUMBER = 8  # bytes
_LAYOUTS = 16  # that are kept: of as many devices as share a topic
_NAMES = 100  # sets of joint names that are kept


class EncodingError(RedresError):
    """Bytes that are no message of the type that they came as."""


class _FrameError(RedresError):
    """A message in an unknown frame."""


class _LengthError(ArrayError):
    """The number of values is not the number of joints."""


class JointSample(NamedTuple):
    """Content of a JointState: the names, and a position for each."""

    stamp: Nanoseconds
    name: Sequence[str]
    position: Sequence[float] | np.ndarray


class _Layout(NamedTuple):
    """All between the stamp and the positions; it is the same in every message of one device."""

    content: bytes
    name: tuple[str, ...]
    begin: int  # of the positions
    end: int


class JointStateReader:
    """Reads JointStates, serialised or not.

    The first one of a device is read by rclpy. Of the next ones only stamp and positions are read,
    as long as the names are the same.
    """

    def __init__(self) -> None:
        self._layouts: list[_Layout] = []

    def read(self, message: Any) -> JointSample:
        """What the loop needs of a message. Raises EncodingError for bytes that are none."""
        if not isinstance(message, bytes):
            return _to_sample(message)
        for layout in self._layouts:
            if message.startswith(layout.content, _STAMP_END):
                own = message[layout.begin : layout.end]  # in the message they are not aligned
                if layout.end > len(message):
                    raise EncodingError(f'a JointState of {len(message)} bytes; expected more')
                return JointSample(stamp_of(message), layout.name, np.frombuffer(own))
        return self._learn(message)

    def _learn(self, data: bytes) -> JointSample:
        message = deserialised(data, JointState)
        layout = _layout(message, data)
        is_as_expected = (
            data.startswith(_LITTLE_ENDIAN)
            and len(message.position) == len(message.name) > 0
            and data.startswith(message.position.tobytes(), layout.begin)
        )
        if is_as_expected:
            self._layouts.insert(0, layout)
            del self._layouts[_LAYOUTS:]
        return _to_sample(message)


def _to_sample(message: JointState) -> JointSample:
    return JointSample(to_nanoseconds(message.header.stamp), message.name, message.position)


def _layout(message: JointState, data: bytes | bytearray) -> _Layout:
    """How a message begins after its stamp, in the bytes that go over the wire."""
    sizes = [len(text.encode()) + 1 for text in (message.header.frame_id, *message.name)]
    sizes.insert(1, 0)  # the number of names has no content, and neither has that of positions
    sizes.append(0)
    end = _STAMP_END
    for size in sizes:
        end += _gap(end, _LENGTH.size) + _LENGTH.size + size
    begin = end + _gap(end, _NUMBER)
    names = tuple(message.name)
    return _Layout(bytes(data[_STAMP_END:end]), names, begin, begin + len(names) * _NUMBER)


def _gap(place: int, size: int) -> int:
    """Bytes between a place and the next one for a number of that size."""
    return (_HEADER - place) % size


def read_twist(message: Any) -> tuple[Nanoseconds, str, Twist]:
    """Stamp, frame and velocity of a TwistStamped, serialised or not. Raises EncodingError."""
    if isinstance(message, bytes) and not message.startswith(_LITTLE_ENDIAN):
        message = deserialised(message, TwistStamped)
    if not isinstance(message, bytes):
        linear = message.twist.linear
        angular = message.twist.angular
        dx = np.array((linear.x, linear.y, linear.z, angular.x, angular.y, angular.z))
        return to_nanoseconds(message.header.stamp), message.header.frame_id, dx
    try:
        stamp = stamp_of(message)
        (length,) = _LENGTH.unpack_from(message, _STAMP_END)
        begin = _STAMP_END + _LENGTH.size
        end = begin + length
        frame = message[begin : end - 1].decode()
        dx = np.frombuffer(message, np.float64, 6, end + _gap(end, _NUMBER)).copy()
    except (struct.error, ValueError):
        raise EncodingError(f'a TwistStamped of {len(message)} bytes; expected others') from None
    return stamp, frame, dx


class JointStateWriter:
    """One serialised JointState of the named joints that is filled again for every message."""

    def __init__(self, names: Sequence[str], *, with_effort: bool = False) -> None:
        n = len(names)
        zeros = [0.0] * n
        efforts = zeros if with_effort else []
        message = JointState(name=list(names), position=zeros, velocity=zeros, effort=efforts)
        self._data = bytearray(serialize_message(message))
        self._values = struct.Struct(f'<{n}d')
        self._begin = _layout(message, self._data).begin  # of the positions
        # from one array to the next; the length in between is aligned as a number
        self._step = self._values.size + _NUMBER

    def written(
        self,
        stamp: Nanoseconds,
        q: JointPositions,
        dq: JointVelocities,
        effort: JointTorques | None = None,
    ) -> bytes:
        """The message with these values."""
        data = self._data
        _TIME.pack_into(data, _HEADER, *divmod(stamp, NANOSECONDS))
        self._values.pack_into(data, self._begin, *q.tolist())
        self._values.pack_into(data, self._begin + self._step, *dq.tolist())
        if effort is not None:
            self._values.pack_into(data, self._begin + 2 * self._step, *effort.tolist())
        return bytes(data)


class TwistWriter:
    """One serialised TwistStamped, along the axes of a frame, filled again for every message."""

    def __init__(self, frame: str) -> None:
        message = TwistStamped()
        message.header.frame_id = frame
        self._data = bytearray(serialize_message(message))
        self._dx = np.frombuffer(self._data, np.float64, 6, len(self._data) - 6 * _NUMBER)

    def written(self, stamp: Nanoseconds, dx: TaskVelocity) -> bytes:
        """The message with these values."""
        _TIME.pack_into(self._data, _HEADER, *divmod(stamp, NANOSECONDS))
        self._dx[: len(dx)] = dx
        self._dx[len(dx) :] = 0.0
        return bytes(self._data)


def deserialised(data: bytes, kind: Any) -> Any:
    """A message of that type from its bytes. Raises EncodingError if they are none."""
    try:
        return deserialize_message(data, kind)
    except Exception as error:  # noqa: BLE001 (rclpy raises what its middleware does)
        raise EncodingError(f'{len(data)} bytes that are not a {kind.__name__}: {error}') from None


def stamp_of(data: bytes) -> Nanoseconds:
    """Stamp of a serialised message that has a header. Raises EncodingError."""
    return _joined(*_STAMP.unpack_from(data))


def to_nanoseconds(stamp: Time) -> Nanoseconds:
    """A stamp from a message. Raises EncodingError."""
    return _joined(stamp.sec, stamp.nanosec)


def _joined(seconds: int, nanoseconds: int) -> Nanoseconds:
    if nanoseconds >= NANOSECONDS:
        raise EncodingError(f'a stamp with {nanoseconds} ns in nanosec; allowed: below 1e9')
    return seconds * NANOSECONDS + nanoseconds


def to_time(stamp: Nanoseconds) -> Time:
    """A stamp as a message."""
    return Time(sec=stamp // NANOSECONDS, nanosec=stamp % NANOSECONDS)


class JointMapper:
    """Finds an arm's joints by name, in any order and among others: of a gripper, of another robot.

    `report` is called once for each set of foreign joints, which are ignored.
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
        if len(self._foreign) < _NAMES:
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

        Raises JointNamesError for a joint that is missing or named twice, and _LengthError unless
        there is one value for each name.
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
        if len(self._orders) < _NAMES:
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
