"""Node `echo`: subscribes as the controller does and returns every state as joint_command. It
measures the cost of a controller that computes nothing.
"""

import sys

from geometry_msgs.msg import TwistStamped
from rclpy.node import Node
from sensor_msgs.msg import JointState

from redres_ros.nodes.runtime import run_nodes
from redres_ros.nodes.topics import NEWEST, PUBLISH


class EchoNode(Node):
    """Responds to every state with that state."""

    def __init__(self) -> None:
        super().__init__('echo')
        commands = self.create_publisher(JointState, 'joint_command', PUBLISH)
        self.create_subscription(JointState, 'joint_states', commands.publish, NEWEST)
        self.create_subscription(TwistStamped, 'cartesian_velocity', lambda message: None, NEWEST)


if __name__ == '__main__':
    sys.exit(run_nodes(EchoNode))
