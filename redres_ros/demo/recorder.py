"""A listener that keeps all that the nodes say to each other."""

import time

import numpy as np
from diagnostic_msgs.msg import DiagnosticArray
from geometry_msgs.msg import TwistStamped
from rclpy.node import Node
from rclpy.qos import QoSProfile, ReliabilityPolicy
from sensor_msgs.msg import JointState
from std_msgs.msg import String

from redres_ros.demo.replay import Log
from redres_ros.nodes.conversions import JointOrder, to_nanoseconds
from redres_ros.nodes.qos import LATCHED
from redres_ros.robot_model import RobotModel
from redres_ros.waypoints import WaypointTask

EVERYTHING = QoSProfile(depth=2000, reliability=ReliabilityPolicy.RELIABLE)


class Recorder(Node):
    """Keeps states and commands by stamp, every word of session and planner, and the sim's newest
    diagnostics.
    """

    def __init__(self, joint_names: tuple[str, ...]) -> None:
        super().__init__('recorder')
        self._joints = JointOrder(joint_names)
        self.log = Log({}, {})
        self.states_heard = 0
        self.newest = 0  # stamp [ns] of the newest state
        self.heard = time.monotonic()  # when that came
        self.words: dict[str, list[str]] = {
            'sim/session_state': [],
            'sim/stop_reason': [],
            'planner/state': [],
        }
        self.figures: dict[str, str] = {}  # the sim's newest diagnostics
        self._planner_figures: dict[str, str] = {}
        self._first_twist = 0  # stamp [ns] of the first one heard
        self.create_subscription(JointState, 'joint_states', self._on_state, EVERYTHING)
        self.create_subscription(JointState, 'joint_command', self._on_command, EVERYTHING)
        self.create_subscription(TwistStamped, 'cartesian_velocity', self._on_twist, EVERYTHING)
        self.create_subscription(DiagnosticArray, '/diagnostics', self._on_diagnostics, EVERYTHING)
        for topic, heard in self.words.items():
            self.create_subscription(
                String, topic, lambda message, heard=heard: heard.append(message.data), LATCHED
            )

    @property
    def stopped(self) -> bool:
        """Whether the robot has a reason why it stopped."""
        return any(self.words['sim/stop_reason'])

    @property
    def stopped_at(self) -> int:
        """Stamp [ns] at which the robot says that it stopped; 0 as long as it has not said so."""
        return int(self.figures.get('stopped at [ns]', 0))

    @property
    def begun(self) -> int:
        """Stamp [ns] at which the planner began, as it says itself or as it was heard; 0 before."""
        return int(self._planner_figures.get('begun at [ns]', 0)) or self._first_twist

    @property
    def seconds(self) -> float:
        """Time on the robot's clock since the planner began [s]."""
        return (self.newest - self.begun) / 1e9 if self.begun else 0.0

    def final_error(self, model: RobotModel, task: WaypointTask) -> float:
        """Distance from the tip to the last point at the newest state [m]."""
        return float(
            np.linalg.norm(model.tip(self.log.states[self.newest])[0] - task.waypoints[-1])
        )

    def _on_state(self, message: JointState) -> None:
        stamp = to_nanoseconds(message.header.stamp)
        self.states_heard += stamp != self.newest  # a robot that waits sends its state again
        self.newest = stamp
        self.heard = time.monotonic()
        self.log.states[self.newest] = self._joints.positions(message)

    def _on_command(self, message: JointState) -> None:
        stamp = to_nanoseconds(message.header.stamp)
        self.log.commands[stamp] = (self._joints.positions(message), np.array(message.velocity))

    def _on_twist(self, message: TwistStamped) -> None:
        self._first_twist = self._first_twist or to_nanoseconds(message.header.stamp)

    def _on_diagnostics(self, message: DiagnosticArray) -> None:
        for status in message.status:
            figures = {pair.key: pair.value for pair in status.values}
            if status.name.endswith('/sim'):
                self.figures = figures
            elif status.name.endswith('/planner'):
                self._planner_figures = figures
