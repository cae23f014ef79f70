"""A ROS 2 node of your own with a law inside: it moves the tip up and down.

Start a robot first, the fake one with `redres_sim`, then: python examples/law_behind_your_node.py
"""

import contextlib
import math
import signal

import numpy as np
import rclpy
from rclpy.node import Node
from rclpy.qos import QoSProfile, ReliabilityPolicy
from rclpy.signals import SignalHandlerOptions
from sensor_msgs.msg import JointState
from std_msgs.msg import String

from redres_ros import Controller, RobotModel, make_law

T = 0.002  # the robot's cycle [s]
SPEED = 0.05  # of the tip, at most [m/s]
DURATION = 4.0  # of the motion [s]


class UpAndDown(Node):
    """Answers each state of the robot with the next position reference."""

    def __init__(self) -> None:
        super().__init__('up_and_down')
        self.model = RobotModel.named('lwr4_paper')
        law = make_law('minimum_acceleration', damping=10.0)
        self.controller = Controller(self.model, law, T)
        self.commanding = False
        self.t = 0.0  # since the robot follows [s]
        self.heights: list[float] = []

        newest = QoSProfile(depth=1, reliability=ReliabilityPolicy.BEST_EFFORT)
        self.create_subscription(JointState, 'joint_states', self.on_state, newest)
        self.create_subscription(String, 'sim/session_state', self.on_session, 10)
        self.commands = self.create_publisher(JointState, 'joint_command', 1)

    def on_session(self, message: String) -> None:
        """Keep whether the robot takes commands."""
        self.commanding = message.data == 'CMD'

    def on_state(self, message: JointState) -> None:
        """Respond to a state."""
        positions = dict(zip(message.name, message.position, strict=True))
        q = np.array([positions[name] for name in self.model.joint_names])

        dx = np.zeros(3)
        if self.commanding:
            dx[2] = SPEED * math.sin(math.pi * self.t)
            self.t += T
        command = self.controller.update(q, dx)
        self.heights.append(float(self.model.tip(q)[0][2]))

        answer = JointState(name=self.model.joint_names)
        answer.header.stamp = message.header.stamp  # the state that it responds to
        answer.position = command.q_ref.tolist()
        answer.velocity = command.dq.tolist()
        self.commands.publish(answer)


rclpy.init(signal_handler_options=SignalHandlerOptions.NO)
node = UpAndDown()
with contextlib.suppress(KeyboardInterrupt):
    signal.signal(signal.SIGTERM, signal.default_int_handler)  # ends as Ctrl-C does
    while node.t < DURATION:
        rclpy.spin_once(node, timeout_sec=0.1)
if node.heights:
    print(f'the tip moved up and down by {max(node.heights) - min(node.heights):.3f} m')
rclpy.shutdown()
