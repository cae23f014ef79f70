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
        'target_timeout fault_seed plant_step servo_bandwidth joint_friction contact_radius '
        'contact_stiffness contact_friction'
    ),
    'profile (lwr_fri1, sunrise, fci) decides it': (
        'bridged_misses entry_tolerance acceleration_window acceleration_tolerance position_margin '
        'velocity_stops jerk_limit'
    ),
    'set acceleration_limit': 'acceleration_scale',
    'a wall faces the base of the arm': 'contact_normal',
    'set state_delay and command_delay': 'state_delay_spread command_delay_spread',
    'set state_loss and command_loss': 'state_loss_burst command_loss_burst',
    'set disorder': ('state_duplication command_duplication state_reordering command_reordering'),
    'set encoder_noise': 'encoder_step',
    'set push_force, an array of x, y and z': 'push_force_x push_force_y push_force_z',
    'push_force [0.0, 0.0, 0.0] ends a push': 'push_time',
    'set wrench_fault (noise, bias, saturated, not_finite, lost)': (
        'wrench_delay wrench_loss wrench_noise wrench_bias wrench_range wrench_not_finite'
    ),
}
_INSTEAD = {name: instead for instead, names in _GONE.items() for name in names.split()}


def instead_of(name: str) -> str:
    """The error for a parameter that is gone; empty for any other name."""
    return f'{name} is no parameter any more: {_INSTEAD[name]}' if name in _INSTEAD else ''
