"""Quality of service: which of three a topic of this package has."""

from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy

# Publishers in the loop are reliable, so that any subscriber can match them; our own subscriptions
# take the newest
# sample and nothing else, because a reliable one replays stale samples after a gap.
PUBLISH = QoSProfile(depth=1, reliability=ReliabilityPolicy.RELIABLE)
NEWEST = QoSProfile(depth=1, reliability=ReliabilityPolicy.BEST_EFFORT)
LATCHED = QoSProfile(
    depth=1, reliability=ReliabilityPolicy.RELIABLE, durability=DurabilityPolicy.TRANSIENT_LOCAL
)
