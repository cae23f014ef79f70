"""Ways from a bare robot to what answers it: topics in a namespace, or UDP."""

import math
from typing import Protocol

import numpy as np
from geometry_msgs.msg import TwistStamped
from rclpy.node import Node
from rclpy.serialization import serialize_message
from sensor_msgs.msg import JointState

from redres_ros.bench.exchange import Stopwatch
from redres_ros.bench.udp import Client
from redres_ros.fri.robot_clock import NANOSECONDS, RobotClock
from redres_ros.nodes.conversions import JointMessage, to_nanoseconds, to_twist
from redres_ros.nodes.qos import NEWEST, PUBLISH
from redres_ros.robot_model import RobotModel
from redres_ros.waypoints import load_task

_SPEED = 0.05
_FREQUENCY = 0.5  # [m/s], [Hz] of the tip's motion to and fro


class Lane(Protocol):
    """Sends the state of a tick; the answers go to the stopwatch that is in force."""

    stopwatch: Stopwatch

    def send(self, tick: int) -> None: ...


class TopicLane:
    """A robot that is where it was told to be, with the planner's part: a task velocity once the
    answer is here.
    """

    def __init__(self, node: Node, name: str, period: int) -> None:
        model = RobotModel.named('lwr4_paper')
        start = load_task('rectangle').start
        self.stopwatch = Stopwatch(0, 0)
        self._frame = model.base_frame
        self._clock = RobotClock(node.get_clock().now().nanoseconds, period)
        self._message = JointMessage(model.joint_names)
        self._q = start
        self._dq = np.zeros(model.n)
        self._states = node.create_publisher(JointState, f'{name}/joint_states', PUBLISH)
        self._twists = node.create_publisher(TwistStamped, f'{name}/cartesian_velocity', PUBLISH)
        node.create_subscription(JointState, f'{name}/joint_command', self._on_command, NEWEST)

    def send(self, tick: int) -> None:
        """Publish the state of a tick."""
        message = self._message.filled(self._clock.stamp(tick), self._q, self._dq)
        self.stopwatch.out(tick)
        self._states.publish(message)

    def _on_command(self, message: JointState) -> None:
        stamp = to_nanoseconds(message.header.stamp)
        tick = self._clock.tick(stamp)
        self.stopwatch.back(tick)
        self._q = np.array(message.position)
        self._dq = np.array(message.velocity)
        speed = _SPEED * math.sin(
            2.0 * math.pi * _FREQUENCY * tick * self._clock.period / NANOSECONDS
        )
        if self._twists.get_subscription_count():
            self._twists.publish(to_twist(stamp, self._frame, np.array((0.0, speed, 0.0))))


class UdpLane:
    """Datagrams of the size of a state."""

    def __init__(self, port: int) -> None:
        self.stopwatch = Stopwatch(0, 0)
        size = len(
            serialize_message(JointMessage(RobotModel.named('lwr4_paper').joint_names).message)
        )
        self._client = Client(port, size, lambda tick: self.stopwatch.back(tick))

    def send(self, tick: int) -> None:
        """Send the datagram of a tick."""
        self.stopwatch.out(tick)
        self._client.send(tick)
