"""The topics on which a robot reports its session: latched words."""

REASON = 'sim/stop_reason'
SESSION = 'sim/session_state'
QUALITY = 'sim/connection_quality'
