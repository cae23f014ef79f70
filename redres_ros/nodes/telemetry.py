"""Telemetry: nothing is computed or sent for a topic without subscribers. And latched words."""

from collections.abc import Callable, Mapping
from typing import Any

from rclpy.node import Node
from std_msgs.msg import Float64, Int32, String

from redres_ros.nodes.topics import LATCHED, PUBLISH, STEADY

# [s] between counts of subscribers; counting in every cycle would cost more than the rest
LOOK_PERIOD = 0.2


class Telemetry:
    """Publishers by topic, and which of them have subscribers at present.

    Args:
        node: Publishes.
        types: Types by topic.

    Attributes:
        subscribed: The last parts of the names of topics that have a subscriber.
    """

    def __init__(self, node: Node, types: Mapping[str, type]) -> None:
        self._publishers = {
            topic.rpartition('/')[2]: node.create_publisher(kind, topic, PUBLISH)
            for topic, kind in types.items()
        }
        self._look()  # a recording listens from the first message on
        node.create_timer(LOOK_PERIOD, self._look, clock=STEADY)

    def publish(self, name: str, make: Callable[[], Any]) -> None:
        """Publish if the topic has a subscriber.

        Args:
            name: Last part of the topic's name.
            make: Returns a message, a number or a text, or None for nothing; called only if the
                topic has a subscriber.
        """
        if name not in self.subscribed:
            return
        value = make()
        if value is not None:
            self._publishers[name].publish(_to_message(value))

    def _look(self) -> None:
        self.subscribed = {
            name
            for name, publisher in self._publishers.items()
            if publisher.get_subscription_count()
        }


def _to_message(value: Any) -> Any:
    kinds = {float: Float64, int: Int32, str: String}
    return kinds[type(value)](data=value) if type(value) in kinds else value


class LatchedWords:
    """Publishes words on latched topics, each when it changes, in the order of the topics."""

    def __init__(self, node: Node, *topics: str) -> None:
        self._publishers = {
            topic: node.create_publisher(String, topic, LATCHED) for topic in topics
        }
        self._published: dict[str, str] = {}

    def get(self, topic: str) -> str:
        """What was published last on a topic; empty before anything was."""
        return self._published.get(topic, '')

    def publish(self, words: Mapping[str, str]) -> None:
        """Publish the words that have changed, by their topics."""
        for topic, publisher in self._publishers.items():
            if self._published.get(topic) != words[topic]:
                self._published[topic] = words[topic]
                publisher.publish(String(data=words[topic]))

    def repeat(self) -> None:
        """Have all published again: a message may have been lost."""
        self._published.clear()
