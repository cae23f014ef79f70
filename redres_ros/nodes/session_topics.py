"""What the sim tells of its session: latched words on topics, and a line in the log for a stop."""

from rclpy.node import Node
from std_msgs.msg import String

from redres_ros.fake_robot.session import Session
from redres_ros.nodes.qos import LATCHED

REASON = 'sim/stop_reason'
SESSION = 'sim/session_state'
QUALITY = 'sim/connection_quality'


class SessionTopics:
    """Publishes `sim/session_state`, `sim/connection_quality` and `sim/stop_reason` as they change.

    Args:
        node: the sim.
        session: what is told.
    """

    def __init__(self, node: Node, session: Session) -> None:
        self._session = session
        self._logger = node.get_logger()
        # The reason comes first: who hears that a session has ended can say why.
        self._publishers = {
            topic: node.create_publisher(String, topic, LATCHED)
            for topic in (REASON, SESSION, QUALITY)
        }
        self._told: dict[str, str] = {}  # the newest word on each topic
        self.tell()

    def tell(self) -> None:
        """Publish what has changed since the last call."""
        reason = self._session.reason
        if reason and reason != self._told.get(REASON):
            self._logger.error(reason)
        self._tell(REASON, reason)
        self._tell(SESSION, self._session.state.value)
        self._tell(QUALITY, self._session.quality.name)

    def tell_again(self) -> None:
        """Have the next call of tell() publish everything: a word may have got lost."""
        self._told.clear()

    def _tell(self, topic: str, word: str) -> None:
        if word != self._told.get(topic):
            self._told[topic] = word
            self._publishers[topic].publish(String(data=word))
