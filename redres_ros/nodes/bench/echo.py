"""Node `echo`: sends every joint_states back as joint_command, and does nothing else."""

import sys

from rclpy.node import Node
from sensor_msgs.msg import JointState

from redres_ros.nodes.runtime import NEWEST, PUBLISH, run_nodes


class EchoNode(Node):
    """What any controller on this machine would be with nothing to compute."""

    def __init__(self) -> None:
        super().__init__('echo')
        commands = self.create_publisher(JointState, 'joint_command', PUBLISH)
        self.create_subscription(JointState, 'joint_states', commands.publish, NEWEST)


if __name__ == '__main__':
    sys.exit(run_nodes(EchoNode))
