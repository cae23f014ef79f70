"""Executable `composed`: the nodes sim, controller and planner in one process and one thread.

States, commands and task velocities are handed over directly, not through DDS. Other processes can
still listen, and send task velocities.
"""

import sys
from collections.abc import Callable, Collection
from typing import Any

from rclpy.node import Node
from rclpy.publisher import Publisher
from rclpy.qos import QoSProfile

from redres_ros.nodes.controller import ControllerNode
from redres_ros.nodes.planner import PlannerNode
from redres_ros.nodes.runtime import run_nodes
from redres_ros.nodes.sim import SimNode


class IntraProcess:
    """Makes nodes that pass their messages on some topics directly within publish().

    Receivers are called in the thread of the publisher and in the order of their creation, before
    the message goes out to other processes.

    Args:
        topics: other processes may subscribe to these; their publications are ignored.
        open_topics: these take publications of other processes too. A message from within then
            comes a second time, by DDS.
    """

    def __init__(self, topics: Collection[str], open_topics: Collection[str] = ()) -> None:
        self._topics = topics
        self._open = open_topics
        self._receivers: dict[str, list[Callable[[Any], None]]] = {}  # by the topic's full name

    def node(self, cls: type[Node]) -> type[Node]:
        """The same node, handing over."""
        return type(cls.__name__, (cls, _Handing), {'intra_process': self})

    def receivers(self, node: Node, topic: str) -> list[Callable[[Any], None]] | None:
        """Who gets the messages on a topic of a node; None for one that goes through DDS alone.

        Args:
            node: the publisher or subscriber.
            topic: as the node names it.
        """
        if topic not in self._topics and topic not in self._open:
            return None
        return self._receivers.setdefault(node.resolve_topic_name(topic), [])

    def is_open(self, topic: str) -> bool:
        """Whether messages of other processes are received."""
        return topic in self._open


class _Handing(Node):
    """Mixed in between a node's class and rclpy's."""

    intra_process: IntraProcess

    def create_publisher(
        self, msg_type: Any, topic: str, qos_profile: QoSProfile | int, **options: Any
    ) -> Any:
        publisher = super().create_publisher(msg_type, topic, qos_profile, **options)
        receivers = self.intra_process.receivers(self, topic)
        return publisher if receivers is None else _Publisher(publisher, receivers)

    def create_subscription(
        self,
        msg_type: Any,
        topic: str,
        callback: Callable[[Any], None],
        qos_profile: QoSProfile | int,
        **options: Any,
    ) -> Any:
        receivers = self.intra_process.receivers(self, topic)
        if receivers is not None:
            receivers.append(callback)
            if not self.intra_process.is_open(topic):
                return None
        return super().create_subscription(msg_type, topic, callback, qos_profile, **options)


class _Publisher:
    """Hands over before it publishes."""

    def __init__(self, publisher: Publisher, receivers: list[Callable[[Any], None]]) -> None:
        self._publisher = publisher
        self._receivers = receivers

    def get_subscription_count(self) -> int:
        """Receivers in this process and subscriptions in others."""
        return len(self._receivers) + self._publisher.get_subscription_count()

    def publish(self, message: Any) -> None:
        """Hand it to the receivers of this process, then publish it."""
        for receive in self._receivers:
            receive(message)
        self._publisher.publish(message)


def run_composed(
    adapt: Callable[[type[Node]], type[Node]] = lambda cls: cls,
    arguments: list[str] | None = None,
) -> int:
    """Run the three until they are asked to end; the controller gets a state before the
    planner gets it.

    Args:
        adapt: what is made of each node's class before a node is made of it.
        arguments: the command line; None for that of the process.

    Returns:
        The exit status.
    """
    intra_process = IntraProcess(
        ('joint_states', 'joint_command', 'controller/task_scaling'),
        open_topics=('cartesian_velocity',),
    )
    classes = [adapt(cls) for cls in (SimNode, ControllerNode, PlannerNode)]
    return run_nodes(*map(intra_process.node, classes), arguments=arguments, one_thread=True)


def main(arguments: list[str] | None = None) -> int:
    """Console entry point."""
    return run_composed(arguments=arguments)


if __name__ == '__main__':
    sys.exit(main())
