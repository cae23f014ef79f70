"""Node `echo`: hears what the controller hears, sends every state back as joint_command, and does
nothing else.
"""

import sys

from geometry_msgs.msg import TwistStamped
from rclpy.node import Node
from sensor_msgs.msg import JointState

from redres_ros.nodes.qos import NEWEST, PUBLISH
from redres_ros.nodes.runtime import run_nodes


class EchoNode(Node):
    """What any controller on this machine would be with nothing to compute."""

    def __init__(self) -> None:
        super().__init__('echo')
        echo(self)


def echo(node: Node, prefix: str = '') -> None:
    """Have the node echo, on topics whose names begin with the prefix."""
    commands = node.create_publisher(JointState, f'{prefix}joint_command', PUBLISH)
    node.create_subscription(JointState, f'{prefix}joint_states', commands.publish, NEWEST)
    node.create_subscription(
        TwistStamped, f'{prefix}cartesian_velocity', lambda message: None, NEWEST
    )


if __name__ == '__main__':
    sys.exit(run_nodes(EchoNode))
