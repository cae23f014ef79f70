"""Samples of fast topics, taken on request."""

from typing import Any, NamedTuple

from rclpy.node import Node
from rclpy.qos import QoSProfile

from redres_ros.nodes.wire import EncodingError, deserialised


class Sample(NamedTuple):
    """A serialised message, and when it was sent and received, time of day [ns]."""

    data: bytes
    sent: int
    received: int


class Sampler:
    """Takes what has come in since the last look.

    A callback for each message of a robot would wake this process a thousand times a second. Here
    messages wait in DDS, whose thread does not need Python, until somebody takes them.

    Args:
        beside: A node that is spun; the subscriptions belong to another one, which nobody spins.
    """

    def __init__(self, beside: Node) -> None:
        self._node = Node(
            f'{beside.get_name()}_sampler',
            context=beside.context,
            namespace=beside.get_namespace(),
            start_parameter_services=False,
            enable_rosout=False,
        )
        self._subscriptions: dict[str, Any] = {}

    def add(self, topic: str, kind: type, quality: QoSProfile) -> None:
        """Start to collect the messages of a topic.

        Args:
            topic: Its name.
            kind: Type of its messages.
            quality: Its depth is how many may wait.
        """
        self._subscriptions[topic] = self._node.create_subscription(
            kind, topic, _never, quality, raw=True
        )

    def remove(self, topic: str) -> None:
        """Stop collecting a topic."""
        self._node.destroy_subscription(self._subscriptions.pop(topic))

    def take(self, topic: str) -> list[Sample]:
        """The messages of a topic since the last call, oldest first."""
        subscription = self._subscriptions[topic]
        taken = []
        handle = subscription.handle
        with handle:
            while (found := handle.take_message(subscription.msg_type, True)) is not None:
                data, times = found
                taken.append(Sample(data, times['source_timestamp'], times['received_timestamp']))
        return taken

    def newest(self, topic: str) -> Any:
        """The newest message of a topic since the last call; None if there is none."""
        taken = self.take(topic)
        if not taken:
            return None
        try:
            return deserialised(taken[-1].data, self._subscriptions[topic].msg_type)
        except EncodingError:
            return None

    def close(self) -> None:
        """Release the subscriptions."""
        self._node.destroy_node()


def _never(message: Any) -> None:
    """Never called, because nobody spins the node."""
