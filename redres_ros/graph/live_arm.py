"""A running arm, sampled: its model, its positions, and the controller's figures."""

import time
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import fields
from typing import Any

import numpy as np
from rclpy.qos import QoSProfile, ReliabilityPolicy
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64MultiArray, String

from redres_ros.errors import RedresError
from redres_ros.graph.graph_monitor import GraphMonitor
from redres_ros.nodes import controller_telemetry
from redres_ros.nodes.controller_telemetry import Figures
from redres_ros.nodes.conversions import JointMapper
from redres_ros.nodes.robot_parameters import DESCRIPTION, TOPIC, MountingParameters
from redres_ros.nodes.topics import LATCHED, NEWEST
from redres_ros.nodes.wire import deserialised
from redres_ros.robot_model import RobotModel
from redres_ros.robots import arm_from_urdf, choose_arm
from redres_ros.types import finite_vector

_STATES = 'joint_states'
_PATIENCE = 3.0  # [s] for the URDF on a topic, which is latched
_LOOK = 0.02  # [s] between looks at whether it has come
_SILENCE = 1.0  # [s] without a snapshot after which the arm's own states are read
# Best effort: an observer must not delay the nodes. Deep enough for one that was delayed itself.
_QUALITY = QoSProfile(depth=50, reliability=ReliabilityPolicy.BEST_EFFORT)


class LiveArm:
    """The state of an arm from the controller's snapshots; from its own states if there are none.

    Args:
        monitor: Monitor of the arm's graph and namespace, spun elsewhere.
        values: The controller's parameters.

    Raises:
        RedresError: The controller has an arm that is not known here.
    """

    def __init__(self, monitor: GraphMonitor, values: Mapping[str, Any]) -> None:
        self._samples = monitor.samples
        self.model = self._find_model(values)
        self.q = np.zeros(self.model.n)  # as measured [rad]
        self._joints = JointMapper(self.model.joint_names)
        self._received_at = time.monotonic()  # [s] when a snapshot came last
        self._is_silent = False  # then the states are read
        self._samples.add(controller_telemetry.TOPIC, Float64MultiArray, _QUALITY)

    def look(self) -> list[Figures]:
        """Process the messages since the last call; returns their figures in order."""
        figures = []
        for sample in self._samples.take(controller_telemetry.TOPIC):
            with suppress(RedresError):  # malformed
                message = deserialised(sample.data, Float64MultiArray)
                seen = controller_telemetry.from_message(message, self.model.n)
                self.q = seen.q
                self._received_at = time.monotonic()
                figures.append(seen.figures)
        self._look_at_states()
        return figures

    @property
    def fractions(self) -> np.ndarray:
        """Position of each joint in its range, 0 to 1, (n,)."""
        model = self.model
        fractions: np.ndarray = (self.q - model.q_min) / (model.q_max - model.q_min)
        return fractions

    def _look_at_states(self) -> None:
        """Read states while the controller is silent: else they cost the robot a message."""
        was_silent = self._is_silent
        self._is_silent = time.monotonic() - self._received_at > _SILENCE
        if self._is_silent and not was_silent:
            self._samples.add(_STATES, JointState, NEWEST)
        elif was_silent and not self._is_silent:
            self._samples.remove(_STATES)
        state = self._samples.newest(_STATES) if self._is_silent else None
        if state is not None and self._joints.concerns(state):
            with suppress(RedresError):  # malformed
                self.q = finite_vector(self._joints.positions(state), self.model.n, 'q')

    def _find_model(self, values: Mapping[str, Any]) -> RobotModel:
        """The controller's arm. Raises RedresError for one that is not known here."""
        links = (values['tip_frame'], values['elbow_frame'])
        if values['robot'] == TOPIC:
            arm = arm_from_urdf(self._await_description(), *links)
        else:
            arm = choose_arm(values['robot'], *links)
        mounting = {field.name: values[field.name] for field in fields(MountingParameters)}
        for name, value in mounting.items():
            if not isinstance(value, (float, str)):
                mounting[name] = tuple(value)
        return RobotModel(MountingParameters(**mounting).mount(arm))

    def _await_description(self) -> str:
        """The URDF on the topic; empty if none comes."""
        self._samples.add(DESCRIPTION, String, LATCHED)
        until = time.monotonic() + _PATIENCE
        try:
            while time.monotonic() < until:
                message = self._samples.newest(DESCRIPTION)
                if message is not None:
                    return str(message.data)
                time.sleep(_LOOK)
            return ''
        finally:
            self._samples.remove(DESCRIPTION)
