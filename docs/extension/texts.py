"""What cannot be asked of the nodes: in words, what travels on a topic and what a service does.

Building the site fails if a topic or service has no words here, or words are of none.
"""

TOPICS = {
    'joint_states': 'the measured arm, at the rate of the robot; joints are matched by name',
    'joint_command': 'next reference q and velocity, with the stamp of the state that it answers',
    'joint_velocity': 'joint velocities in place of a task velocity: towards the start of a task',
    'cartesian_velocity': 'wanted task velocity, in the frame of any link; a zero stamp means now',
    'forward_position_controller/commands': 'the same reference for ros2_control, '
    'with `forward_commands`',
    'target_pose': 'go there on a smooth way, in place of the task',
    'wrench': 'force and moment from outside on the tip, along the axes of the tip',
    'markers': 'for RViz: the ways of tip and elbow, the points of the task, obstacles',
    'robot_description': 'the URDF of the arm',
    'controller/tip_pose': 'where the tip is',
    'controller/joint_velocity_norm': '‖q̇‖ of the command [rad/s]',
    'controller/joint_acceleration_norm': '‖q̈‖ of the command [rad/s²]',
    'controller/null_velocity_norm': 'the part of q̇ that does not move the tip [rad/s]',
    'controller/joint_torque_norm': '‖τ‖ that the command needs [Nm]',
    'controller/min_singular_value': 'of the Jacobian: 0 at a singularity',
    'controller/task_scaling': 's, the share of the task velocity that the limits leave',
    'controller/active_limits': 'the joint, or the pair of bodies, and the limit that acts most',
    'controller/lost_velocity': 'what a singularity takes from the task [m/s]',
    'controller/snapshot': 'for pages: q, q̇ and the figures above, at most 20 times a second, with '
    'the largest ‖q̇‖ and ‖q̈‖ since the last one',
    'controller/law': 'name of the law in force',
    'planner/desired_pose': 'where the tip should be',
    'planner/task_error': 'distance from there [m]',
    'planner/segment': 'which way between two points of the task, from 0',
    'planner/state': '`idle`, `waiting` for the controller to follow, `homing` in joint space, '
    '`moving` along the path of the tip, `finished`, or `stuck`: given up',
    'planner/progress': 'share of the task that is over, 0 to 1',
    'planner/begun': 'stamp of the state at which the task began',
    'sim/session_state': 'whether the robot takes commands (`CMD`) or only reports (`MON`)',
    'sim/connection_quality': 'how well commands arrive in time',
    'sim/stop_reason': 'why the arm was stopped; empty: it was not',
    '/diagnostics': 'health of every node, once a second',
}

SERVICES = {
    'sim/reset': 'clear a stop; command mode begins anew after half a second of good timing',
    'controller/hold': 'stand still softly, or go on',
    'planner/start': 'begin the task; joints that are elsewhere go to its start first. The answer '
    'says what will happen',
    'planner/home': 'go to the joint positions at which the task starts',
    'planner/stop': 'end it softly',
}

# Published only while somebody listens.
ON_DEMAND = (
    'wrench',
    'markers',
    'controller/',
    'planner/task_error',
    'planner/segment',
    'planner/progress',
    'planner/desired_pose',
)
