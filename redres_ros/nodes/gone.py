"""Parameters of earlier versions, and what to write instead."""

_GONE = {
    # of every node
    'start it by chrt or taskset, or the launch argument launch-prefix': (
        'realtime_priority lock_memory processors keep_awake'
    ),
    'it belongs to the arm: give its name or URDF to robot': (
        'base_offset tool_offset effort_limit elbow_frame'
    ),
    'rate decides it': 'state_timeout',
    # of the controller
    'robot_interface (fri, fci, ros2_control, sim) decides it': (
        'bridging restart_after twist_patience following_tolerance jerk.lost'
    ),
    'set robot_interface to ros2_control': 'forward_commands',
    'limit_scale scales the accelerations of the joints': (
        'max_linear_acceleration max_angular_acceleration'
    ),
    'the topic external_torques counts, or without it the efforts of joint_states': (
        'external_torques_from'
    ),
    "set scene.obstacles, as 'floor -0.1; sphere 0.5 0 0.4 0.1'": (
        'collision.floor collision.spheres'
    ),
    'set scene.clearance, one for both': 'collision.clearance workspace.clearance',
    'set scene.points': 'workspace.points',
    "set scene.walls, as 'half_space 0 0 1 0.9; inside_box -1 -1 0 1 1 1'": (
        'workspace.half_spaces workspace.inside_boxes workspace.outside_boxes '
        'workspace.inside_spheres workspace.outside_spheres'
    ),
    'the weight W of the law decides it': 'compliance.inertia_power',
    'set gravity, one for all laws': (
        'minimum_torque.gravity minimum_weighted_torque.gravity dynamically_consistent.gravity'
    ),
    'set task_gain, one for all tasks': (
        'position.gain orientation.gain pose.gain axis.gain elbow.gain joint.gain '
        'configuration.gain'
    ),
    'write it behind the name, as in secondary_tasks: [orientation@link_4]': (
        'position.frame orientation.frame pose.frame axis.frame joint.joint'
    ),
    'write it behind the name, as in preferences: [manipulability@pose]': 'manipulability.rows',
    # of the planner
    'target_speed decides it': 'feedback_limit',
    # of the sim
    'profile decides it': (
        'bridged_misses entry_tolerance acceleration_window position_margin velocity_stops '
        'acceleration_tolerance jerk_limit'
    ),
    'set state_delay or command_delay': 'state_delay_spread command_delay_spread',
    'set state_loss or command_loss': 'state_loss_burst command_loss_burst',
    'set disorder': ('state_duplication state_reordering command_duplication command_reordering'),
    'set push_force, an array of x, y, z; zeros end a push': (
        'push_force_x push_force_y push_force_z push_time'
    ),
    'set wrench_fault': (
        'wrench_delay wrench_loss wrench_noise wrench_bias wrench_range wrench_not_finite'
    ),
    'set encoder_noise': 'encoder_step',
    'set acceleration_limit': 'acceleration_scale',
    'a wall faces the base; its stiffness is 1e4 N/m, its friction 0.3': (
        'contact_normal contact_radius contact_friction'
    ),
    # of any of them
    'it is a constant': (
        'give_up_after greedy headstart home_speed home_tolerance stuck_after target_acceleration '
        'target_timeout joint_limit_avoidance.margin joint_limit_avoidance.horizon fault_seed '
        'plant_step servo_bandwidth joint_friction contact_stiffness collision.influence '
        'collision.time workspace.influence workspace.time admittance.sensor_range '
        'admittance.filter_time admittance.payload_mass admittance.payload_center '
        'admittance.search_speed admittance.search_distance admittance.retreat_speed '
        'admittance.retreat_distance admittance.contact_stiffness admittance.contact_delay '
        'admittance.servo_bandwidth'
    ),
}
_INSTEAD = {name: instead for instead, names in _GONE.items() for name in names.split()}


def instead_of(name: str) -> str:
    """The error for a parameter that is gone; empty for any other name."""
    return f'{name} is no parameter any more: {_INSTEAD[name]}' if name in _INSTEAD else ''
