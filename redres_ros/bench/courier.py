"""Node `courier`: receives and publishes what the controller does, and computes nothing.

It shows what the messages of the graph cost by themselves: the planner takes it for a
controller that follows, and streams task velocities.
"""

import sys

import numpy as np
from geometry_msgs.msg import TwistStamped
from rclpy.node import Node
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64

from redres_ros.nodes.qos import NEWEST, PUBLISH, RECENT
from redres_ros.nodes.runtime import run_nodes
from redres_ros.nodes.wire import JointStateReader, JointStateWriter

_REMINDER = 4  # cycles from one word on the scaling to the next, as the controller's


class CourierNode(Node):
    """Responds to every state with a command to stay there."""

    def __init__(self) -> None:
        super().__init__('controller')
        self._reader = JointStateReader()
        self._writer: JointStateWriter | None = None
        self._answered = 0
        self._commands = self.create_publisher(JointState, 'joint_command', PUBLISH)
        self._scalings = self.create_publisher(Float64, 'controller/task_scaling', PUBLISH)
        self.create_subscription(JointState, 'joint_states', self._on_state, NEWEST, raw=True)
        self.create_subscription(
            TwistStamped, 'cartesian_velocity', lambda data: None, RECENT, raw=True
        )

    def _on_state(self, data: bytes) -> None:
        stamp, names, position = self._reader.read(data)
        if self._writer is None:
            self._writer = JointStateWriter(names)
        self._commands.publish(
            self._writer.written(stamp, np.asarray(position), np.zeros(len(names)))
        )
        self._answered += 1
        if self._answered % _REMINDER == 0:
            self._scalings.publish(Float64(data=1.0))


if __name__ == '__main__':
    sys.exit(run_nodes(CourierNode))
