"""The command topics of a robot."""

from collections.abc import Sequence

from rclpy.node import Node
from sensor_msgs.msg import JointState

from redres_ros.command import Command
from redres_ros.nodes.forwarding import Forwarding
from redres_ros.nodes.qos import PUBLISH
from redres_ros.nodes.wire import JointStateWriter


class CommandPublisher:
    """Publishes joint references, each with the stamp of its state.

    Args:
        node: Publishes.
        names: Of the joints.
        forward: Whether ros2_control's forward_position_controller gets the positions, too.
    """

    def __init__(self, node: Node, names: Sequence[str], forward: bool) -> None:
        self._writer = JointStateWriter(names)
        self._publisher = node.create_publisher(JointState, 'joint_command', PUBLISH)
        self.forwarding = Forwarding(node, names) if forward else None

    def publish(self, stamp: int, command: Command) -> None:
        """Publish a tick's reference.

        Args:
            stamp: Of the state [ns].
            command: Its answer.
        """
        self._publisher.publish(self._writer.written(stamp, command.q_ref, command.dq))
        if self.forwarding:
            self.forwarding.publish(command.q_ref.tolist())
