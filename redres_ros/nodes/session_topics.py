"""The fake robot's topics of its session: latched words, as they change."""

from typing import TYPE_CHECKING

from rclpy.node import Node
from std_msgs.msg import String

from redres_ros.nodes.topics import LATCHED, QUALITY, REASON, SESSION

if TYPE_CHECKING:  # who watches the topics needs no robot
    from redres_ros.fake_robot.session import Session


class SessionTopics:
    """Publishes the state of the fake robot's session.

    Args:
        node: Publishes.
        session: Whose state it is.
    """

    def __init__(self, node: Node, session: 'Session') -> None:
        self._session = session
        self._logger = node.get_logger()
        # The reason comes first: a subscriber that receives the end of a session knows why.
        self._publishers = {
            topic: node.create_publisher(String, topic, LATCHED)
            for topic in (REASON, SESSION, QUALITY)
        }
        self._published: dict[str, str] = {}  # the newest value of each
        self.publish()

    def publish(self) -> None:
        """Publish what has changed since the last call; a stop gets a line in the log, too."""
        session = self._session
        values = {
            REASON: session.reason,
            SESSION: session.state.value,
            QUALITY: session.quality.name,
        }
        if session.reason and session.reason != self._published.get(REASON):
            self._logger.error(session.reason)
        for topic, publisher in self._publishers.items():
            if values[topic] != self._published.get(topic):
                self._published[topic] = values[topic]
                publisher.publish(String(data=values[topic]))

    def repeat(self) -> None:
        """Have all published again: a message may have been lost."""
        self._published.clear()
