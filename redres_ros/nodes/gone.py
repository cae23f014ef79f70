"""Parameters of earlier versions, and what to write instead."""

_GONE = {
    'start it by chrt or taskset, or the launch argument launch-prefix': (
        'realtime_priority lock_memory processors keep_awake'
    ),
    'it belongs to the arm: give its name or URDF to robot': (
        'base_offset tool_offset effort_limit elbow_frame'
    ),
    'robot_interface (fri, fci, ros2_control, sim) decides it': (
        'bridging restart_after twist_patience following_tolerance'
    ),
    'set robot_interface to ros2_control': 'forward_commands',
    'rate decides it': 'state_timeout',
    'the topic external_torques counts, or without it the efforts of joint_states': (
        'external_torques_from'
    ),
    'target_speed decides it': 'feedback_limit',
    'it is a constant': (
        'give_up_after greedy headstart home_speed home_tolerance stuck_after target_acceleration '
        'target_timeout'
    ),
}
_INSTEAD = {name: instead for instead, names in _GONE.items() for name in names.split()}


def instead_of(name: str) -> str:
    """The error for a parameter that is gone; empty for any other name."""
    return f'{name} is no parameter any more: {_INSTEAD[name]}' if name in _INSTEAD else ''
