"""Descriptions of topics and services, which the nodes do not have.

Building the site fails if a topic or service has no description here, or a description no topic.
"""

TOPICS = {
    'joint_states': 'measured positions, at the rate of the robot; joints are matched by name',
    'joint_command': 'next reference q and velocity, with the stamp of its state',
    'joint_velocity': 'joint velocities in place of a task velocity: towards the start of a task',
    'cartesian_velocity': 'desired task velocity, in the frame of any link; a zero stamp means now',
    'forward_position_controller/commands': 'the same reference for ros2_control, '
    'with `robot_interface: ros2_control`',
    'target_pose': 'target of a smooth path, in place of the task',
    'target_path': 'poses, each with its stamp; replaces the rest of the last one',
    'wrench': 'force and moment that the environment exerts on the tip, along the axes of the tip',
    'external_torques': 'torques that the environment exerts on the joints (`effort`)',
    'markers': 'for RViz: the paths of tip and elbow, the points of the task, obstacles',
    'robot_description': 'the URDF of the arm',
    'controller/mode': '`inactive`, `mirroring` the measured position, `holding`, `moving` or '
    '`stopping`',
    'controller/tip_pose': 'pose of the tip',
    'controller/joint_velocity_norm': '‖q̇‖ of the command [rad/s]',
    'controller/joint_acceleration_norm': '‖q̈‖ of the command [rad/s²]',
    'controller/null_velocity_norm': 'the part of q̇ that does not move the tip [rad/s]',
    'controller/joint_torque_norm': '‖τ‖ that the command needs [Nm]',
    'controller/min_singular_value': 'of the Jacobian: 0 at a singularity',
    'controller/task_scaling': 's: the fraction of the task velocity that the limits leave',
    'controller/active_limits': 'the joint or pair of bodies, its most active limit, the axis '
    'along which the tip moves away from that, s, and the fraction of translation and rotation '
    'that is executed; then the other active limits',
    'controller/lost_velocity': 'unachieved task velocity, at a singularity [m/s]',
    'controller/snapshot': 'for pages: q and the figures above, at most 20 times a second, with '
    'the largest ‖q̇‖ and ‖q̈‖ since the last one',
    'controller/law': 'name of the law in force',
    'planner/desired_pose': 'desired pose of the tip',
    'planner/task_error': 'distance from there [m]',
    'planner/segment': 'number of the segment between two points of the task, from 0',
    'planner/state': '`idle`, `waiting` for the controller to follow, `homing` in joint space, '
    '`moving` along the path of the tip, `finished`, or `stuck`: given up',
    'planner/progress': 'fraction of the task that is done, 0 to 1',
    'planner/preview': 'the path to come, a stamp for each pose, for laws that look ahead',
    'planner/begun': 'stamp of the state at which the task began',
    'sim/session_state': 'whether the robot takes commands (`CMD`) or only reports (`MON`)',
    'sim/connection_quality': 'quality of the timing of commands',
    'sim/stop_reason': 'why the arm was stopped; empty: it was not',
    '/diagnostics': 'health of every node, once a second',
}

SERVICES = {
    'sim/reset': 'clear a stop; command mode begins again after half a second of good timing',
    'controller/hold': 'decelerate to rest and hold, or resume',
    'controller/tare': 'take the measured wrench for zero',
    'planner/start': 'begin the task, after a motion to its start if needed. The response says '
    'what will happen',
    'planner/home': 'go to the joint positions at which the task starts',
    'planner/stop': 'end the task; the arm decelerates to rest',
}

# Published only while somebody listens.
ON_DEMAND = (
    'wrench',
    'external_torques',
    'markers',
    'controller/',
    'planner/task_error',
    'planner/segment',
    'planner/progress',
    'planner/desired_pose',
)
