"""The fake robot's topics of its session: latched words, as they change."""

from rclpy.node import Node
from std_msgs.msg import String

from redres_ros.nodes.topics import LATCHED, QUALITY, REASON, SESSION


class SessionTopics:
    """Publishes the state of a robot's session.

    Args:
        node: Publishes.
    """

    def __init__(self, node: Node) -> None:
        self._logger = node.get_logger()
        # The reason comes first: a subscriber that receives the end of a session knows why.
        self._publishers = {
            topic: node.create_publisher(String, topic, LATCHED)
            for topic in (REASON, SESSION, QUALITY)
        }
        self._published: dict[str, str] = {}  # the newest value of each

    def publish(self, reason: str, state: str, quality: str) -> None:
        """Publish what has changed since the last call; a stop gets a line in the log, too.

        Args:
            reason: Why the robot stopped; empty if it has not.
            state: Name of the session's state.
            quality: Name of the connection's quality.
        """
        values = {REASON: reason, SESSION: state, QUALITY: quality}
        if reason and reason != self._published.get(REASON):
            self._logger.error(reason)
        for topic, publisher in self._publishers.items():
            if values[topic] != self._published.get(topic):
                self._published[topic] = values[topic]
                publisher.publish(String(data=values[topic]))

    def repeat(self) -> None:
        """Have all published again: a message may have been lost."""
        self._published.clear()
