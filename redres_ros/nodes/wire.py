"""Messages of the loop as they go over the wire, read and written in place; and stamps.

Between the wire and a callback, rclpy makes a Python object of every field, and reads every field
when it publishes one. For a JointState and a TwistStamped that takes 10 to 20 us, as long as the
whole tick; here it takes one or two. The encoding is CDR: numbers are aligned to their size,
counted from the end of a header of 4 bytes.
"""

import struct
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from builtin_interfaces.msg import Time
from geometry_msgs.msg import TwistStamped
from rclpy.serialization import deserialize_message, serialize_message
from sensor_msgs.msg import JointState

from redres_ros.errors import RedresError
from redres_ros.loop.cycle_counter import NANOSECONDS
from redres_ros.types import (
    JointPositions,
    JointTorques,
    JointVelocities,
    Nanoseconds,
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
_REMEMBERED = 16  # layouts: of as many devices as share a topic


class EncodingError(RedresError):
    """Bytes that are no message of the type that they came as."""


class JointSample(NamedTuple):
    """Content of a JointState: the names, and a position for each."""

    stamp: Nanoseconds
    name: Sequence[str]
    position: Sequence[float] | np.ndarray


class _TwistSample(NamedTuple):
    """Content of a TwistStamped."""

    stamp: Nanoseconds
    frame: str
    dx: Twist


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
            del self._layouts[_REMEMBERED:]
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


def stamp_of(data: bytes) -> Nanoseconds:
    """Stamp of a serialised message that has a header. Raises EncodingError."""
    return _joined(*_STAMP.unpack_from(data))


def read_twist(message: Any) -> _TwistSample:
    """What the loop needs of a TwistStamped, serialised or not. Raises EncodingError."""
    if isinstance(message, bytes) and not message.startswith(_LITTLE_ENDIAN):
        message = deserialised(message, TwistStamped)
    if not isinstance(message, bytes):
        linear = message.twist.linear
        angular = message.twist.angular
        dx = np.array((linear.x, linear.y, linear.z, angular.x, angular.y, angular.z))
        return _TwistSample(to_nanoseconds(message.header.stamp), message.header.frame_id, dx)
    try:
        stamp = stamp_of(message)
        (length,) = _LENGTH.unpack_from(message, _STAMP_END)
        begin = _STAMP_END + _LENGTH.size
        end = begin + length
        frame = message[begin : end - 1].decode()
        dx = np.frombuffer(message, np.float64, 6, end + _gap(end, _NUMBER)).copy()
    except (struct.error, ValueError):
        raise EncodingError(f'a TwistStamped of {len(message)} bytes; expected others') from None
    return _TwistSample(stamp, frame, dx)


def _joined(seconds: int, nanoseconds: int) -> Nanoseconds:
    if nanoseconds >= NANOSECONDS:
        raise EncodingError(f'a stamp with {nanoseconds} ns in nanosec; allowed: below 1e9')
    return seconds * NANOSECONDS + nanoseconds


class JointStateWriter:
    """One serialised JointState of the named joints that is filled again for every message."""

    def __init__(self, names: Sequence[str], *, with_effort: bool = False) -> None:
        n = len(names)
        zeros = [0.0] * n
        efforts = zeros if with_effort else []
        message = JointState(name=list(names), position=zeros, velocity=zeros, effort=efforts)
        self._data = bytearray(serialize_message(message))
        self._values = struct.Struct(f'<{n}d')
        self._q_begin = _layout(message, self._data).begin
        self._dq_begin = self._after(self._q_begin)
        self._effort_begin = self._after(self._dq_begin)

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
        self._values.pack_into(data, self._q_begin, *q.tolist())
        self._values.pack_into(data, self._dq_begin, *dq.tolist())
        if effort is not None:
            self._values.pack_into(data, self._effort_begin, *effort.tolist())
        return bytes(data)

    def _after(self, begin: int) -> int:
        """Where the next array begins."""
        end = begin + self._values.size + _LENGTH.size
        return end + _gap(end, _NUMBER)


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


def _gap(place: int, size: int) -> int:
    """Bytes between a place and the next one for a number of that size."""
    return (_HEADER - place) % size


def deserialised(data: bytes, kind: Any) -> Any:
    """A message of that type from its bytes. Raises EncodingError if they are none."""
    try:
        return deserialize_message(data, kind)
    except Exception as error:  # noqa: BLE001 (rclpy raises what its middleware does)
        raise EncodingError(f'{len(data)} bytes that are not a {kind.__name__}: {error}') from None


def to_time(stamp: Nanoseconds) -> Time:
    """A stamp as a message."""
    return Time(sec=stamp // NANOSECONDS, nanosec=stamp % NANOSECONDS)


def to_nanoseconds(stamp: Time) -> Nanoseconds:
    """A stamp from a message. Raises EncodingError."""
    return _joined(stamp.sec, stamp.nanosec)
