"""The nodes as they are, with a tape of what they say and hear.

`python -m redres_ros.demo.taped NODE FILE [TOPIC,...] --ros-args ...` runs the executable NODE and
writes the file. A listener in another process would lose messages when the machine stalls, and
would itself be a load; nothing gets lost here.
"""

import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

from rclpy.node import Node

from redres_ros.demo.tape import JUDGED, Tape
from redres_ros.nodes.composed import run_composed
from redres_ros.nodes.controller import ControllerNode
from redres_ros.nodes.planner import LonePlannerNode
from redres_ros.nodes.runtime import run_nodes
from redres_ros.nodes.sim import SimNode

_HEARD = 'joint_command'  # the one topic of which it matters what has arrived, and when


def taped(cls: type[Node], tape: Tape) -> type[Node]:
    """The same class of nodes, writing what they publish and which commands they hear."""
    return type(cls.__name__, (cls, _Taped), {'tape': tape})


class _Taped(Node):
    """Mixed in between a node's class and rclpy's."""

    tape: Tape

    def create_publisher(self, *arguments: Any, **options: Any) -> Any:
        publisher = super().create_publisher(*arguments, **options)
        topic = arguments[1]
        if topic not in self.tape.topics:
            return publisher
        return _TapedPublisher(publisher, self.tape, topic)

    def create_subscription(self, *arguments: Any, **options: Any) -> Any:
        msg_type, topic, callback, *rest = arguments
        if topic != _HEARD or topic not in self.tape.topics:
            return super().create_subscription(*arguments, **options)

        def tape_and_call(message: Any) -> None:
            self.tape.write(topic, message, heard=True)
            callback(message)

        return super().create_subscription(msg_type, topic, tape_and_call, *rest, **options)


class _TapedPublisher:
    """Writes a message to the tape, then publishes it."""

    def __init__(self, publisher: Any, tape: Tape, topic: str) -> None:
        self._publisher = publisher
        self._tape = tape
        self._topic = topic
        self._has_listeners = True

    def publish(self, message: Any) -> None:
        """Write the message down; send it where somebody listens beside the tape."""
        self._tape.write(self._topic, message, heard=False)
        if self._has_listeners:
            self._publisher.publish(message)

    def get_subscription_count(self) -> int:
        """With the tape as one of the listeners.

        Telemetry asks, and publishes only while somebody listens. If only the tape does, nothing is
        sent.
        """
        listeners: int = self._publisher.get_subscription_count()
        self._has_listeners = listeners > 0
        return listeners + 1


def main() -> int:
    """The exit status of the node."""
    name, path = sys.argv[1:3]
    rest = sys.argv[3:]
    topics = tuple(JUDGED)
    if rest and not rest[0].startswith('-'):
        topics = tuple(rest.pop(0).split(','))
    sys.argv = [name, *rest]  # what a node takes for its own command line
    tape = Tape(Path(path), topics)
    try:
        return _run(name, lambda cls: taped(cls, tape))
    finally:
        tape.close()


def _run(name: str, adapt: Callable[[type[Node]], type[Node]]) -> int:
    if name == 'composed':
        return run_composed(adapt)
    if name == 'sim':
        return run_nodes(adapt(SimNode), one_thread=True)
    return run_nodes(adapt({'controller': ControllerNode, 'planner': LonePlannerNode}[name]))


if __name__ == '__main__':
    sys.exit(main())
