"""The topics on which robot and controller report their state: latched words."""

REASON = 'sim/stop_reason'
SESSION = 'sim/session_state'
QUALITY = 'sim/connection_quality'
MODE = 'controller/mode'
ACTIVE_LIMITS = 'controller/active_limits'
