"""Parameters of the arm."""

import signal
from collections.abc import Callable
from dataclasses import replace

import rclpy
from rclpy.node import Node
from std_msgs.msg import String

from redres_ros.files.processes import handled
from redres_ros.nodes.parameters import declare_one
from redres_ros.nodes.topics import LATCHED
from redres_ros.parameter import Parameter
from redres_ros.robots import Arm, arm_from_urdf, choose_arm
from redres_ros.robots.arm import ACCELERATIONS, DYNAMICS
from redres_ros.robots.joint_limits import with_accelerations

TOPIC = 'topic'  # in place of an arm's name: the URDF that another node publishes
DESCRIPTION = 'robot_description'

_PATIENCE = 3.0  # [s] of waiting for the description between one line in the log and the next
_WAIT = 0.1  # [s] after which Python's signal handlers have their turn
_ROBOT = Parameter(
    'arm: a name that `redres laws` prints, a path ending in .urdf, '
    'or topic: the URDF on robot_description'
)
_TIP_FRAME = Parameter("link that carries out the task; empty: the arm's own, of a URDF its last")
_ACCELERATION = Parameter('of each joint from base to tip [rad/s^2], or a file', *ACCELERATIONS)
_DYNAMICS = Parameter('inertias: identified arm or uniform cylinders', choices=DYNAMICS)


def declare_robot(
    node: Node, *, is_the_robot: bool = False, has_dynamics: bool = True
) -> tuple[str, Arm]:
    """Declare the parameters of the arm; returns what `robot` says, and the arm. With `topic`, wait
    until the description has come, unless the node is the robot and publishes it.

    Raises RedresError for an arm that cannot be used.
    """
    robot = declare_one(node, 'robot', 'lwr4_paper', _ROBOT)
    tip_frame = declare_one(node, 'tip_frame', '', _TIP_FRAME)
    if is_the_robot:
        arm = choose_arm(robot, tip_frame)
    else:
        arm = make_arm(robot, tip_frame, lambda: _await_description(node))
    given = node._parameter_overrides.get('acceleration_limit')
    if given is not None and isinstance(given.value, str):
        arm = with_accelerations(arm, given.value)
        del node._parameter_overrides['acceleration_limit']  # a parameter has one type
    acceleration = declare_one(node, 'acceleration_limit', arm.acceleration_limit, _ACCELERATION)
    arm = with_accelerations(arm, acceleration)
    for remark in arm.remarks():
        node.get_logger().info(remark)
    if has_dynamics:
        arm = replace(arm, dynamics=declare_one(node, 'dynamics', arm.dynamics, _DYNAMICS))
    arm.kinematics()  # refuses limits of another number of joints
    return robot, arm


def make_arm(robot: str, tip_frame: str, await_description: Callable[[], str]) -> Arm:
    """The arm of the parameters of those names; `topic` stands for the URDF that is waited for.
    Raises RedresError for one that cannot be used.
    """
    if robot == TOPIC:
        return arm_from_urdf(await_description(), tip_frame)
    return choose_arm(robot, tip_frame, others=(TOPIC,))


def _await_description(node: Node) -> str:
    """The URDF on robot_description, waited for as long as it takes; a signal ends the wait."""
    received: list[String] = []
    subscription = node.create_subscription(String, DESCRIPTION, received.append, LATCHED)
    waiting = f'waiting for a URDF on {subscription.topic_name}'
    # before the loop of the node looks at them
    with handled(signal.default_int_handler, signal.SIGINT, signal.SIGTERM):
        while not received:
            rclpy.spin_once(node, timeout_sec=_WAIT)
            node.get_logger().warning(waiting, throttle_duration_sec=_PATIENCE, skip_first=True)
    node.destroy_subscription(subscription)
    return str(received[-1].data)
