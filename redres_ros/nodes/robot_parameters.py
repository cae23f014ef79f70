"""The arm of a node: by name, from a file, or from robot_description."""

import signal
import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import NamedTuple

from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from std_msgs.msg import String

from redres_ros.errors import UnknownNameError
from redres_ros.files.processes import handled
from redres_ros.nodes.parameters import ParameterError, declare
from redres_ros.nodes.topics import LATCHED
from redres_ros.parameter import param
from redres_ros.robots import Arm, arm_from_urdf, choose_arm
from redres_ros.robots.arm import DYNAMICS
from redres_ros.robots.table import ALLOWED, names_an_arm

TOPIC = 'topic'  # in place of an arm's name: the URDF that another node publishes
DESCRIPTION = 'robot_description'

_PATIENCE = 3.0  # [s] of waiting for the description between one line in the log and the next
_WAIT = 0.1  # [s] after which Python's signal handlers have their turn


@dataclass(frozen=True)
class _RobotParameters:
    """The arm and its tip."""

    robot: str = param(
        'lwr4_paper',
        'arm: a name that `redres laws` prints, a path ending in .urdf or .xacro, '
        'or topic: the URDF on robot_description',
    )
    tip_frame: str = param(
        '', "link that carries out the task; empty: the arm's own, of a URDF the last one"
    )


@dataclass(frozen=True)
class _LimitParameters:
    """What a URDF does not say."""

    acceleration_limit: tuple[float, ...] = param(
        (), 'of each joint from base to tip [rad/s^2]', 1e-3, 1e6
    )


@dataclass(frozen=True)
class _DynamicsParameters:
    """The inertias of the arm."""

    dynamics: str = param(
        'identified', 'inertias: identified arm or uniform cylinders', choices=DYNAMICS
    )


class _ChosenRobot(NamedTuple):
    """What the parameter `robot` says, and the arm with the node's limits and dynamics."""

    name: str
    arm: Arm


def declare_robot(
    node: Node, *, is_the_robot: bool = False, has_dynamics: bool = True
) -> _ChosenRobot:
    """Declare the parameters of the arm. With `topic`, wait until the description has come.

    Args:
        node: Has the parameters.
        is_the_robot: Whether the node publishes the description itself.
        has_dynamics: Whether the inertias matter to it.

    Raises:
        RedresError: A value of another type, or an arm that cannot be used.
    """
    wanted = declare(node, _RobotParameters())
    if wanted.robot == TOPIC and is_the_robot:
        raise ParameterError(
            f'robot is {TOPIC}, but this node publishes {DESCRIPTION} itself; '
            f'allowed: {", ".join(ALLOWED)}'
        )
    arm = make_arm(wanted.robot, wanted.tip_frame, lambda: _await_description(node))
    for remark in arm.remarks():
        node.get_logger().info(remark)
    limits = declare(node, _LimitParameters(arm.acceleration_limit))
    arm = replace(arm, acceleration_limit=limits.acceleration_limit)
    if has_dynamics:
        dynamics = declare(node, _DynamicsParameters(arm.dynamics))
        arm = replace(arm, dynamics=dynamics.dynamics)
    arm.kinematics()  # refuses limits of another number of joints
    return _ChosenRobot(wanted.robot, arm)


def make_arm(robot: str, tip_frame: str, await_description: Callable[[], str]) -> Arm:
    """The arm of the parameters of those names. Raises RedresError for one that cannot be used.

    Args:
        robot: A name, a file, or `topic`.
        tip_frame: Empty for the arm's own.
        await_description: Returns the URDF on the topic.
    """
    if robot == TOPIC:
        return arm_from_urdf(await_description(), tip_frame)
    if not names_an_arm(robot):
        raise UnknownNameError('robot', robot, [*ALLOWED, TOPIC])
    return choose_arm(robot, tip_frame)


def _await_description(node: Node) -> str:
    """The URDF on robot_description, waited for as long as it takes; a signal ends the wait."""
    received: list[String] = []
    subscription = node.create_subscription(String, DESCRIPTION, received.append, LATCHED)
    topic = node.resolve_topic_name(DESCRIPTION)
    executor = SingleThreadedExecutor(context=node.context)
    executor.add_node(node)
    reported_at = time.monotonic()
    try:
        # before the loop of the node looks at them
        with handled(signal.default_int_handler, signal.SIGINT, signal.SIGTERM):
            while not received:
                executor.spin_once(timeout_sec=_WAIT)
                if time.monotonic() - reported_at > _PATIENCE:
                    reported_at = time.monotonic()
                    node.get_logger().warning(f'waiting for a URDF on {topic}')
    finally:
        executor.remove_node(node)
        executor.shutdown()
        node.destroy_subscription(subscription)
    return str(received[-1].data)
