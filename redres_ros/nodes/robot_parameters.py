"""The arm of a node: by name, from a file, or from robot_description."""

import signal
import time
from dataclasses import dataclass, replace
from typing import NamedTuple

from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from std_msgs.msg import String

from redres_ros.errors import UnknownNameError
from redres_ros.files.signals import handled
from redres_ros.nodes.parameters import ParameterError, declare
from redres_ros.nodes.topics import LATCHED
from redres_ros.parameter import param
from redres_ros.robot_model import RobotModel
from redres_ros.robots import ARMS, Arm, arm_from_urdf, choose_arm
from redres_ros.robots.arm import DYNAMICS
from redres_ros.robots.table import ALLOWED, names_an_arm

TOPIC = 'topic'  # in place of an arm's name: the URDF that another node publishes
DESCRIPTION = 'robot_description'

_PAPER = ARMS['lwr4_paper']
_OF_THE_URDF = (0.0,)  # ROS has no empty arrays
_PATIENCE = 3.0  # [s] of waiting for the description between one line in the log and the next
_WAIT = 0.1  # [s] after which Python's signal handlers have their turn


@dataclass(frozen=True)
class _RobotParameters:
    """The arm, and its tip and elbow links."""

    robot: str = param(
        'lwr4_paper',
        'arm: a name that `redres laws` prints, a path ending in .urdf or .xacro, '
        'or topic: the URDF on robot_description',
    )
    tip_frame: str = param(
        '', "link that carries out the task; empty: the arm's own, of a URDF the last one"
    )
    elbow_frame: str = param(
        '', "link that counts as the elbow; empty: the arm's own, of a URDF its middle joint"
    )


@dataclass(frozen=True)
class MountingParameters:
    """Where the arm stands, with which tool, and which rows its task has."""

    dynamics: str = param(
        _PAPER.dynamics, 'inertias: identified arm or uniform cylinders', choices=DYNAMICS
    )
    base_offset: float = param(
        _PAPER.base_offset, "height of the arm's base above the base frame [m]", -2.0, 2.0
    )
    tool_offset: float = param(
        _PAPER.tool_offset, 'from the flange to the tip along z [m]', -2.0, 2.0
    )
    acceleration_limit: tuple[float, ...] = param(
        _PAPER.acceleration_limit, 'of each joint from base to tip [rad/s^2]', 1e-3, 1e6
    )
    effort_limit: tuple[float, ...] = param(
        _OF_THE_URDF, "the same for efforts [Nm]; [0.0]: the URDF's own", 0.0, 1e9
    )
    task_space: str = param(
        'position', 'rows of the task: position 3, pose 6', choices=('position', 'pose')
    )

    def mount(self, arm: Arm) -> Arm:
        """The arm with this mounting."""
        return replace(
            arm,
            dynamics=self.dynamics,
            base_offset=self.base_offset,
            tool_offset=self.tool_offset,
            acceleration_limit=self.acceleration_limit,
            effort_limit=() if self.effort_limit == _OF_THE_URDF else self.effort_limit,
        )


class _ChosenRobot(NamedTuple):
    """The arm of a node.

    Args:
        name: What the parameter `robot` says.
        arm: Arm with the node's offsets and dynamics.
        task_space: What a task velocity is of, position or pose.
    """

    name: str
    arm: Arm
    task_space: str

    @property
    def model(self) -> RobotModel:
        """A new model of that arm."""
        return RobotModel(self.arm)


def declare_robot(node: Node, *, is_the_robot: bool = False) -> _ChosenRobot:
    """Declare the parameters of the arm; those of its mounting follow from `robot`.

    Args:
        node: Has the parameters. With `topic`, this waits until the description has come.
        is_the_robot: Whether the node publishes the description itself.

    Raises:
        ParameterError: A value of another type, or `topic` for the node that publishes it.
        RedresError: An arm that cannot be used.
    """
    wanted = declare(node, _RobotParameters())
    if wanted.robot != TOPIC and not names_an_arm(wanted.robot):
        raise UnknownNameError('robot', wanted.robot, [*ALLOWED, TOPIC])
    if wanted.robot == TOPIC and is_the_robot:
        raise ParameterError(
            f'robot is {TOPIC}, but this node publishes {DESCRIPTION} itself; '
            f'allowed: {", ".join(ALLOWED)}'
        )
    if wanted.robot == TOPIC:
        arm = arm_from_urdf(_await_description(node), wanted.tip_frame, wanted.elbow_frame)
    else:
        arm = choose_arm(wanted.robot, wanted.tip_frame, wanted.elbow_frame)
    own = MountingParameters(arm.dynamics, arm.base_offset, arm.tool_offset, arm.acceleration_limit)
    mounting = declare(node, own)
    for remark in arm.remarks():
        node.get_logger().info(remark)
    arm = mounting.mount(arm)
    arm.kinematics()  # refuses limits of another number of joints
    return _ChosenRobot(wanted.robot, arm, mounting.task_space)


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
    text: str = received[-1].data
    return text
