"""A tape: the messages that a node publishes or hears, in order, in a file."""

import math
import struct
import time
from collections.abc import Collection, Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from builtin_interfaces.msg import Time
from diagnostic_msgs.msg import DiagnosticArray
from geometry_msgs.msg import PoseStamped, TwistStamped, WrenchStamped
from rcl_interfaces.msg import ParameterEvent
from rclpy.serialization import deserialize_message, serialize_message
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64, Float64MultiArray, Int32, String
from visualization_msgs.msg import MarkerArray

from redres_ros.nodes.wire import stamp_of

# What a run is judged by.
JUDGED: dict[str, type] = {
    'joint_states': JointState,
    'joint_command': JointState,
    'cartesian_velocity': TwistStamped,
    'sim/session_state': String,
    'sim/stop_reason': String,
    'controller/law': String,
    'controller/task_scaling': Float64,
    'planner/state': String,
    'planner/desired_pose': PoseStamped,
    'planner/segment': Int32,
}
# All that a tape can hold.
TOPICS: dict[str, type] = {
    **JUDGED,
    'controller/tip_pose': PoseStamped,
    'controller/joint_velocity_norm': Float64,
    'controller/joint_acceleration_norm': Float64,
    'controller/null_velocity_norm': Float64,
    'controller/joint_torque_norm': Float64,
    'controller/min_singular_value': Float64,
    'controller/lost_velocity': Float64,
    'controller/limiting': String,
    'controller/glance': Float64MultiArray,
    'forward_position_controller/commands': Float64MultiArray,
    'markers': MarkerArray,
    'wrench': WrenchStamped,
    'planner/task_error': Float64,
    'planner/begun': Time,
    'sim/connection_quality': String,
    'robot_description': String,
    '/diagnostics': DiagnosticArray,
    '/parameter_events': ParameterEvent,
}

_NAMES = tuple(TOPICS)
_WITH_STAMP = {topic for topic, kind in JUDGED.items() if hasattr(kind, 'header')}
_HEAD = struct.Struct('<qB?I')  # time [ns], number of the topic, heard, length [bytes]
_DISORDER = 1e9  # [ns] by which a stamp may come before a smaller one, where faults are injected
_BUFFER = 16384  # [bytes] it is written in small pieces, so that no cycle has much to write


@dataclass(frozen=True)
class Entry:
    """One message.

    Attributes:
        time: By the monotonic clock, which all processes share [ns].
        topic: Its name.
        heard: Whether the node received it; otherwise it published it.
        data: As it goes over the wire.
    """

    time: int
    topic: str
    heard: bool
    data: bytes

    @property
    def message(self) -> Any:
        """The message itself."""
        return deserialize_message(self.data, TOPICS[self.topic])


class Tape:
    """Writes messages to a file.

    Args:
        path: of the file, which is made anew.
        topics: those that are kept, of TOPICS; by default those that a run is judged by.
    """

    def __init__(self, path: Path, topics: Collection[str] = tuple(JUDGED)) -> None:
        self.topics = topics
        self._file = path.open('wb', buffering=_BUFFER)

    def write(self, topic: str, message: Any, heard: bool) -> None:
        """Append a message that is published or heard now.

        Args:
            topic: Its name.
            message: What was said.
            heard: Whether the node heard it; otherwise it published it.
        """
        now = time.monotonic_ns()
        data = message if isinstance(message, bytes) else serialize_message(message)
        if not heard:
            now = time.monotonic_ns()  # it goes out when this is done
        self._file.write(_HEAD.pack(now, _NAMES.index(topic), heard, len(data)) + data)

    def close(self) -> None:
        """Write what is left."""
        self._file.close()


def read_tape(path: Path) -> Iterator[Entry]:
    """The messages in their order; up to the last whole one, if the writer was killed.

    Memory is taken for one message only: who lets a demo run for an hour has a long tape.
    """
    with path.open('rb') as file:
        while len(head := file.read(_HEAD.size)) == _HEAD.size:
            at, number, heard, length = _HEAD.unpack(head)
            data = file.read(length)
            if len(data) == length:
                yield Entry(at, _NAMES[number], heard, data)


def stamped(entries: Iterable[Entry], until: float = math.inf) -> Iterator[tuple[int, Entry]]:
    """Messages with their stamps [ns]. One that has none belongs to the newest stamp before it: a
    node publishes it in the same callback. 0 before the first.

    Args:
        entries: Of one tape.
        until: The last stamp that counts. A demo with a page goes on long after it.
    """
    newest = 0
    for entry in entries:
        if entry.topic in _WITH_STAMP:
            newest = stamp_of(entry.data)
        if newest > until + _DISORDER:
            return
        if newest <= until:
            yield newest, entry
