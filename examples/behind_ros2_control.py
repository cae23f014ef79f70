"""A robot behind ros2_control: its joint_state_broadcaster and forward_position_controller.

Its stamps are this computer's clock, with jitter; its message lists a gripper too; its commands are
numbers without a stamp. The arm is ideal. Start it with:

    python examples/behind_ros2_control.py --seconds 20

and beside it, with the same rate:

    redres_controller --ros-args -p robot_interface:=ros2_control -p rate:=100.0
    redres_planner --ros-args -p autostart:=true -p rate:=100.0
"""

import argparse
import contextlib
import random
import signal
import time

import numpy as np
import rclpy
from rclpy.node import Node
from rclpy.signals import SignalHandlerOptions
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64MultiArray

from redres_ros import RobotModel, load_task

GRIPPER = ('gripper_left_joint', 'gripper_right_joint')
JITTER = 0.4  # of a period, to either side


class Robot(Node):
    """States out at a rate, by a schedule; the newest command in."""

    def __init__(self, rate: float) -> None:
        super().__init__('forward_position_controller')
        task = load_task('rectangle')
        joints = RobotModel.named(task.robot).joint_names
        self.declare_parameter('joints', joints)  # in whose order the controller sends numbers
        self.period = 1.0 / rate
        self.q = task.start
        self.names = [GRIPPER[0], *joints, GRIPPER[1]]
        self.states = 0  # sent since the arm began to move
        self.way: list[np.ndarray] = []  # positions asked for since then, one for each command
        self.random = random.Random(0)
        self.publisher = self.create_publisher(JointState, 'joint_states', 10)
        self.create_subscription(
            Float64MultiArray, 'forward_position_controller/commands', self.on_command, 10
        )

    def on_command(self, message: Float64MultiArray) -> None:
        """The arm follows its commands exactly."""
        moves = not np.array_equal(message.data, self.q)
        self.q = np.array(message.data)
        if self.way or moves:
            self.way.append(self.q)

    def publish_state(self) -> None:
        """A state, stamped a little too early or too late."""
        message = JointState(name=self.names)
        message.position = [0.02, *self.q.tolist(), 0.02]
        jitter = self.random.uniform(-JITTER, JITTER) * self.period
        stamp = self.get_clock().now() + rclpy.duration.Duration(seconds=jitter)
        message.header.stamp = stamp.to_msg()
        self.publisher.publish(message)
        self.states += bool(self.way)


def run(robot: Robot, seconds: float) -> None:
    """Cycles until so much time has passed in motion; a delay is followed by no burst."""
    due = time.monotonic()
    while robot.states * robot.period < seconds:
        robot.publish_state()
        due = max(due + robot.period, time.monotonic())
        while time.monotonic() < due:
            rclpy.spin_once(robot, timeout_sec=max(due - time.monotonic(), 0.0))


parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
parser.add_argument('--seconds', type=float, default=20.0, help='of motion')
parser.add_argument('--rate', type=float, default=100.0, help='cycles per second')
options = parser.parse_args()

rclpy.init(signal_handler_options=SignalHandlerOptions.NO)
robot = Robot(options.rate)
with contextlib.suppress(KeyboardInterrupt):
    signal.signal(signal.SIGTERM, signal.default_int_handler)  # ends as Ctrl-C does
    run(robot, options.seconds)
print(f'commanded {100.0 * len(robot.way) / max(robot.states, 1):.1f} % of {robot.states} states')
if robot.way:
    moved = float(np.abs(robot.way[-1] - robot.way[0]).max())
    print(f'one joint has moved by {moved:.3f} rad')
