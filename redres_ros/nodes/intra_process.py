"""Intra-process communication: messages between nodes of one process, handed over directly.

rclpy sends even these through DDS, which takes a large part of a cycle in each direction.
"""

from collections.abc import Callable, Collection
from typing import Any

from rclpy.node import Node
from rclpy.publisher import Publisher
from rclpy.qos import QoSProfile


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
