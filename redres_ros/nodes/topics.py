"""Names of topics, the four qualities of service that a topic may have, and the clock of timers."""

from rclpy.clock import Clock, ClockType
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy

# Publishers in the loop are reliable, so that any subscriber can match them. Our own subscriptions
# take the newest sample and nothing else, because a reliable one replays stale samples after a gap.
# The controller puts task velocities in the order of their stamps, so here the last few are taken,
# and the planner responds to the last few states.
PUBLISH = QoSProfile(depth=1, reliability=ReliabilityPolicy.RELIABLE)
NEWEST = QoSProfile(depth=1, reliability=ReliabilityPolicy.BEST_EFFORT)
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
# Telemetry.
ACTIVE_LIMITS = 'controller/active_limits'
PROGRESS = 'planner/progress'
