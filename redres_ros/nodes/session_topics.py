"""The sim's session on latched topics, and a line in the log when the robot stops."""

from rclpy.node import Node
from std_msgs.msg import String

from redres_ros.nodes.qos import LATCHED

REASON = 'sim/stop_reason'
SESSION = 'sim/session_state'
QUALITY = 'sim/connection_quality'


class SessionTopics:
    """Publishes `sim/session_state`, `sim/connection_quality` and `sim/stop_reason` as they change.

    Args:
        node: the sim.
    """

    def __init__(self, node: Node) -> None:
        self._logger = node.get_logger()
        # The reason comes first: a subscriber that receives the end of a session knows why.
        self._publishers = {
            topic: node.create_publisher(String, topic, LATCHED)
            for topic in (REASON, SESSION, QUALITY)
        }
        self._published: dict[str, str] = {}  # the newest value of each topic

    def publish(self, state: str, quality: str, reason: str) -> None:
        """Publish what has changed since the last call.

        Args:
            state: Of the session.
            quality: Of the connection.
            reason: Why the robot has stopped; empty if it has not.
        """
        if reason and reason != self._published.get(REASON):
            self._logger.error(reason)
        for topic, value in ((REASON, reason), (SESSION, state), (QUALITY, quality)):
            if value != self._published.get(topic):
                self._published[topic] = value
                self._publishers[topic].publish(String(data=value))

    def publish_again(self) -> None:
        """Have the next call of publish() publish everything: a message may have been lost."""
        self._published.clear()
