"""The nodes, with a recording of what they publish and of the commands that they receive.

`python -m redres_ros.demo.recorded NODE FILE.mcap TOPICS --ros-args ...` runs the executable NODE;
TOPICS are names with commas between them, none for all. A listener in another process would be a
load itself, and does not know when a command reached the robot.

Only the node that is run is loaded: the others would take a second of each process.
"""

import sys
import time
from collections.abc import Callable, Collection
from importlib import import_module
from pathlib import Path
from typing import Any

from rclpy.node import Node
from rclpy.serialization import serialize_message

from redres_ros.graph.mcap_file import McapFile
from redres_ros.nodes.runtime import run_nodes

_NODES = {
    'sim': ('nodes.sim', 'SimNode'),
    'controller': ('nodes.controller', 'ControllerNode'),
    'planner': ('nodes.planner', 'WaitingPlannerNode'),
    'operator': ('demo.operator', 'OperatorNode'),
}  # module and class of each
_RECEIVED = 'joint_command'  # the one topic of which arrivals are recorded
# Time of day by the monotonic clock: no cycle gets longer when somebody sets the clock.
_SINCE = time.time_ns() - time.monotonic_ns()


class _Recorded(Node):
    """Mixed in between a node's class and rclpy's: records what passes."""

    file: McapFile
    wanted: Collection[str]

    def create_publisher(self, *arguments: Any, **options: Any) -> Any:
        publisher = super().create_publisher(*arguments, **options)
        kind, topic, *_ = arguments
        if not self._is_wanted(topic):
            return publisher
        channel = self.file.add_topic(self.resolve_topic_name(topic), kind)
        return _RecordedPublisher(publisher, self.file, channel)

    def create_subscription(self, *arguments: Any, **options: Any) -> Any:
        kind, topic, callback, *rest = arguments
        if topic != _RECEIVED or not self._is_wanted(topic):
            return super().create_subscription(*arguments, **options)
        channel = self.file.add_topic(self.resolve_topic_name(topic), kind, is_received=True)

        def record_and_call(message: Any) -> None:
            _write(self.file, channel, message)
            callback(message)

        return super().create_subscription(kind, topic, record_and_call, *rest, **options)

    def _is_wanted(self, topic: str) -> bool:
        return not self.wanted or topic in self.wanted


class _RecordedPublisher:
    """Writes a message to the file, then publishes it."""

    def __init__(self, publisher: Any, file: McapFile, channel: int) -> None:
        self._publisher = publisher
        self._file = file
        self._channel = channel
        self._has_listeners = True

    def publish(self, message: Any) -> None:
        """Write the message; publish it if it has a subscriber, too."""
        _write(self._file, self._channel, message)
        if self._has_listeners:
            self._publisher.publish(message)

    def get_subscription_count(self) -> int:
        """The number of subscribers, the file included.

        Telemetry publishes only while there is a subscriber. If that is only the file, nothing is
        sent over DDS.
        """
        listeners: int = self._publisher.get_subscription_count()
        self._has_listeners = listeners > 0
        return listeners + 1


def _write(file: McapFile, channel: int, message: Any) -> None:
    """Append a message that is published or received now."""
    at = _SINCE + time.monotonic_ns()
    data = message if isinstance(message, bytes) else serialize_message(message)
    file.write(channel, data, at, at)


def main() -> int:
    """The exit status of the node."""
    name, path, wanted, *rest = sys.argv[1:]
    sys.argv = [name, *rest]  # what a node takes for its own command line
    with McapFile(Path(path), in_chunks=False) as file:
        attributes = {'file': file, 'wanted': wanted.split(',') if wanted else ()}
        return _run(name, lambda cls: type(cls.__name__, (cls, _Recorded), attributes))


def _run(name: str, adapt: Callable[[type[Node]], type[Node]]) -> int:
    if name == 'composed':
        from redres_ros.nodes.composed import run_composed

        return run_composed(adapt)
    module, node = _NODES[name]
    cls = getattr(import_module(f'redres_ros.{module}'), node)
    return run_nodes(adapt(cls))


if __name__ == '__main__':
    sys.exit(main())
