"""Topics: their names, their qualities of service, and publishers for displays."""

from collections.abc import Callable, Mapping
from typing import Any

from rclpy.clock import Clock, ClockType
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from std_msgs.msg import Float64, Int32, String

# Publishers in the loop are reliable, so that any subscriber can match them. Our own subscriptions
# take the newest sample and nothing else, because a reliable one replays stale samples after a gap.
# The controller puts task velocities in the order of their stamps, so here the last few are taken,
# and the planner responds to the last few states.
PUBLISH = QoSProfile(depth=1, reliability=ReliabilityPolicy.RELIABLE)
NEWEST = QoSProfile(depth=1, reliability=ReliabilityPolicy.BEST_EFFORT)
SHARED = QoSProfile(depth=4, reliability=ReliabilityPolicy.BEST_EFFORT)  # by publishers
RECENT = QoSProfile(depth=16, reliability=ReliabilityPolicy.BEST_EFFORT)
LATCHED = QoSProfile(
    depth=1, reliability=ReliabilityPolicy.RELIABLE, durability=DurabilityPolicy.TRANSIENT_LOCAL
)

# For all timers. With `use_sim_time` a node's own clock stands still until /clock is published:
# diagnostics and watchdogs would be silent when they are needed.
STEADY = Clock(clock_type=ClockType.STEADY_TIME)

# Latched words of robot, controller and planner.
REASON = 'sim/stop_reason'
SESSION = 'sim/session_state'
QUALITY = 'sim/connection_quality'
MODE = 'controller/mode'
TASK_STATE = 'planner/state'
TASK_BEGUN = 'planner/begun'
# Others.
PREVIEW = 'planner/preview'
ACTIVE_LIMITS = 'controller/active_limits'
PROGRESS = 'planner/progress'

# [s] between counts of subscribers; counting in every cycle would cost more than the rest
_LOOK_PERIOD = 0.2

_PLAIN: dict[type, Any] = {float: Float64, int: Int32, str: String}  # by the type of their value


class Telemetry:
    """Publishers for displays, of types by topic: nothing is computed without a subscriber."""

    def __init__(self, node: Node, types: Mapping[str, type]) -> None:
        self.subscribed: set[str] = set()  # last parts of the names of topics with a subscriber
        self._publishers = {
            topic.rpartition('/')[2]: node.create_publisher(kind, topic, PUBLISH)
            for topic, kind in types.items()
        }
        self._look()  # a recording listens from the first message on
        node.create_timer(_LOOK_PERIOD, self._look, clock=STEADY)

    def publish(self, name: str, make: Callable[[], Any]) -> None:
        """Publish the message, number or text that `make` returns, unless it is None; it is called
        only if the topic whose name ends so has a subscriber.
        """
        if name not in self.subscribed:
            return
        value = make()
        kind = _PLAIN.get(type(value))
        if value is not None:
            self._publishers[name].publish(kind(data=value) if kind else value)

    def _look(self) -> None:
        self.subscribed = {
            name
            for name, publisher in self._publishers.items()
            if publisher.get_subscription_count()
        }


class LatchedWords:
    """Publishes words on latched topics, each when it changes, in the order of the topics."""

    def __init__(self, node: Node, *topics: str) -> None:
        self._publishers = {
            topic: node.create_publisher(String, topic, LATCHED) for topic in topics
        }
        self.published: dict[str, str] = {}  # the last ones, by topic

    def publish(self, words: Mapping[str, str]) -> None:
        """Publish the words that have changed, by their topics."""
        for topic, publisher in self._publishers.items():
            if self.published.get(topic) != words[topic]:
                self.published[topic] = words[topic]
                publisher.publish(String(data=words[topic]))
