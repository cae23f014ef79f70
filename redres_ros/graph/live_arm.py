"""A running arm, sampled: positions, commands, and the active limits."""

import time
from collections.abc import Mapping
from contextlib import suppress
from typing import Any

import numpy as np
from rclpy.qos import QoSProfile, ReliabilityPolicy
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64MultiArray, String

from redres_ros.errors import RedresError
from redres_ros.graph.graph_monitor import GraphMonitor
from redres_ros.graph.settings import credible, judge_of, model_of
from redres_ros.nodes import controller_telemetry
from redres_ros.nodes.controller_telemetry import Figures
from redres_ros.nodes.conversions import JointMapper
from redres_ros.nodes.robot_parameters import DESCRIPTION, TOPIC
from redres_ros.nodes.topics import LATCHED, NEWEST
from redres_ros.nodes.wire import deserialised

_STATES = 'joint_states'
_PATIENCE = 3.0  # [s] for the URDF on a topic, which is latched
_LOOK = 0.02  # [s] between looks at whether it has come
_SILENCE = 1.0  # [s] without a snapshot after which the arm's own states are looked at
_LIVE = {'limits', 'limit_scale', 'torque_scale'}  # and gains, as velocity.margin
_SHOWN = 0.5  # [s] for which a limit counts as acting after it did
# Best effort: an observer must not delay the nodes. Deep enough for one that was delayed itself.
_QUALITY = QoSProfile(depth=50, reliability=ReliabilityPolicy.BEST_EFFORT)


class LiveArm:
    """The state of an arm from the controller's snapshots; from its own states if there are none.

    Args:
        monitor: In whose graph and namespace it is; is spun elsewhere.
        values: The controller's parameters.

    Raises:
        RedresError: The controller has an arm or a limit that is not known here.
    """

    def __init__(self, monitor: GraphMonitor, values: Mapping[str, Any]) -> None:
        self._samples = monitor.samples
        self.model = model_of(values, self._description(values))
        self.q = np.zeros(self.model.n)  # as measured [rad]
        self._values = dict(values)
        self._judge = judge_of(values, self.model)
        self._joints = JointMapper(self.model.joint_names)
        self._acted: dict[tuple[str, str], float] = {}  # limit and place: when it did [s]
        self._now = 0.0  # [s] of the newest snapshot
        self._received_at = time.monotonic()  # [s] when a snapshot came last
        self._is_silent = False  # then the states are looked at
        self._samples.add(controller_telemetry.TOPIC, Float64MultiArray, _QUALITY)

    def apply(self, changes: Mapping[str, Any]) -> None:
        """Apply changes of the controller's limits, as published; impossible values are skipped."""
        live = {name: value for name, value in changes.items() if name in _LIVE or '.' in name}
        values = {**self._values, **credible(live, self._values)}
        with suppress(RedresError):
            self._judge = judge_of(values, self.model)
            self._values = values

    def look(self) -> list[Figures]:
        """Process the messages since the last call; their figures, in their order."""
        figures = []
        for sample in self._samples.take(controller_telemetry.TOPIC):
            with suppress(RedresError):  # one that no controller would send
                message = deserialised(sample.data, Float64MultiArray)
                seen = controller_telemetry.from_message(message, self.model.n)
                self.q = seen.q
                self._now = seen.figures.time
                self._received_at = time.monotonic()
                self._acted.update(dict.fromkeys(self._judge.acting(seen), self._now))
                figures.append(seen.figures)
        self._look_at_states()
        return figures

    @property
    def fractions(self) -> np.ndarray:
        """Position of each joint in its range, 0 to 1, (n,)."""
        model = self.model
        fractions: np.ndarray = (self.q - model.q_min) / (model.q_max - model.q_min)
        return fractions

    @property
    def acting(self) -> dict[str, set[str]]:
        """Names of the recently active limits, by joint or pair of bodies."""
        acting: dict[str, set[str]] = {}
        for (limit, place), at in self._acted.items():
            if 0.0 <= self._now - at <= _SHOWN:
                acting.setdefault(place, set()).add(limit)
        return acting

    def _look_at_states(self) -> None:
        """While the controller is silent; states at every tick would cost the robot a message."""
        was_silent = self._is_silent
        self._is_silent = time.monotonic() - self._received_at > _SILENCE
        if self._is_silent and not was_silent:
            self._samples.add(_STATES, JointState, NEWEST)
        elif was_silent and not self._is_silent:
            self._samples.remove(_STATES)
        state = self._samples.newest(_STATES) if self._is_silent else None
        if state is not None and self._joints.concerns(state):
            with suppress(RedresError):  # one that no robot would send
                self.q = self._joints.positions(state)

    def _description(self, values: Mapping[str, Any]) -> str:
        """The URDF on the topic if the controller uses that; empty if none comes."""
        if values['robot'] != TOPIC:
            return ''
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
