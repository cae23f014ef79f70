"""A running arm, looked at now and then: where it is, what was commanded, which limits act."""

import math
import time
from collections import deque
from collections.abc import Mapping
from contextlib import suppress
from typing import Any

import numpy as np
from geometry_msgs.msg import TwistStamped
from rclpy.node import Node
from rclpy.qos import QoSProfile, ReliabilityPolicy
from sensor_msgs.msg import JointState
from std_msgs.msg import String

from redres_ros.demo.judge import Cycle, Figures, read_cycle
from redres_ros.demo.sampling import Sample, Sampler
from redres_ros.demo.settings import credible, judge_of, model_of
from redres_ros.errors import RedresError
from redres_ros.nodes.conversions import JointOrder
from redres_ros.nodes.qos import LATCHED
from redres_ros.nodes.robot_parameters import DESCRIPTION, TOPIC
from redres_ros.nodes.wire import STAMP_END, EncodingError, deserialised, stamp_of

STATES = 'joint_states'
COMMANDS = 'joint_command'
TWISTS = 'cartesian_velocity'

_PATIENCE = 3.0  # [s] for the URDF on a topic, which is latched
_GLANCE = 0.02  # [s] between looks at whether it has come
_NEAR = 1.5  # cycles that a task velocity may be away from where it belongs
_LIVE = {'law', 'damping', 'limits', 'limit_scale', 'torque_scale'}  # and gains, as posture.gain
_SHOWN = 0.5  # [s] for which a limit counts as acting after it did
# Best effort: an onlooker must hold up nobody. Deep enough for one that was held up itself.
_QUALITY = QoSProfile(depth=200, reliability=ReliabilityPolicy.BEST_EFFORT)


class LiveArm:
    """What is known of an arm from its states and commands.

    Args:
        node: In whose graph and namespace it is.
        values: The controller's parameters.

    Raises:
        RedresError: The controller has an arm, a law or a limit that is not known here.
    """

    def __init__(self, node: Node, values: Mapping[str, Any]) -> None:
        self._samples = Sampler(node)
        self.model = model_of(values, self._description(values))
        self.q = np.zeros(self.model.n)  # as measured [rad]
        self.figures: Figures | None = None  # of what was judged last, if anything came
        self._values = dict(values)
        self._judge = judge_of(values, self.model)
        self._lag = round(1e9 * values['twist_lag'] * self._judge.period)  # [ns]
        self._joints = JointOrder(self.model.joint_names)
        self._twists: deque[bytes] = deque(maxlen=_QUALITY.depth)
        self._cycles: list[Cycle] = []
        self._acted: dict[tuple[str, str], int] = {}  # limit and place: the stamp [ns] when it did
        for topic, kind in ((STATES, JointState), (COMMANDS, JointState), (TWISTS, TwistStamped)):
            self._samples.add(topic, kind, _QUALITY)

    def apply(self, changes: Mapping[str, Any]) -> None:
        """Take in changes of what the controller's parameters say of law and limits.

        Args:
            changes: Of parameters, as told. What cannot be is passed over.
        """
        live = {name: value for name, value in changes.items() if name in _LIVE or '.' in name}
        values = {**self._values, **credible(live, self._values)}
        with suppress(RedresError):
            self._judge = judge_of(values, self.model)
            self._values = values

    def look(self) -> None:
        """Take in where the arm is."""
        state = self._samples.newest(STATES)
        if state is not None and self._joints.concerns(state):
            with suppress(RedresError):  # one that no robot would send
                self.q = self._joints.positions(state)

    def judge(self) -> None:
        """Take in what was commanded since the last time, and what it comes to."""
        twists = [sample.data for sample in self._samples.take(TWISTS)]
        self._twists.extend(data for data in twists if len(data) >= STAMP_END)
        self.figures = None
        cycles = self._new_cycles(self._samples.take(COMMANDS))
        if len(cycles) < 2:
            return
        self._cycles = cycles
        self.figures = self._judge.figures(self.q, cycles, self._asked(cycles[-1].stamp))
        for found in self._judge.acting(*cycles[-2:]):
            self._acted[found] = cycles[-1].stamp

    @property
    def shares(self) -> np.ndarray:
        """Where each joint is in its range, 0 to 1, (n,)."""
        model = self.model
        shares: np.ndarray = (self.q - model.q_min) / (model.q_max - model.q_min)
        return shares

    @property
    def acting(self) -> dict[str, set[str]]:
        """Names of the limits that acted a moment ago, by joint or what else they are about."""
        acting: dict[str, set[str]] = {}
        if self._cycles:
            now = self._cycles[-1].stamp
            for (limit, place), at in self._acted.items():
                if 0 <= now - at <= 1e9 * _SHOWN:
                    acting.setdefault(place, set()).add(limit)
        return acting

    def close(self) -> None:
        """Release the subscriptions."""
        self._samples.close()

    def _asked(self, stamp: int) -> float:
        """The speed [m/s] that the task asks for at a state of that stamp [ns]; 0 if it does not.

        The controller plays task velocities out with a fixed lag. Its own word on the scaling would
        cost it a message in every cycle.
        """
        wanted = stamp - self._lag
        twist = min(self._twists, key=lambda data: abs(stamp_of(data) - wanted), default=b'')
        if not twist or abs(stamp_of(twist) - wanted) > _NEAR * self._judge.period * 1e9:
            return 0.0
        try:
            linear = deserialised(twist, TwistStamped).twist.linear
        except EncodingError:
            return 0.0
        return math.hypot(linear.x, linear.y, linear.z)

    def _description(self, values: Mapping[str, Any]) -> str:
        """The URDF on the topic, where the controller has it from there; empty if none comes."""
        if values['robot'] != TOPIC:
            return ''
        self._samples.add(DESCRIPTION, String, LATCHED)
        until = time.monotonic() + _PATIENCE
        while time.monotonic() < until:
            message = self._samples.newest(DESCRIPTION)
            if message is not None:
                return str(message.data)
            time.sleep(_GLANCE)
        return ''

    def _new_cycles(self, samples: list[Sample]) -> list[Cycle]:
        """The newest one that is known, and those that came since, in their order."""
        cycles = self._cycles[-1:]
        for sample in samples:
            try:
                cycle = read_cycle(sample.data, self._joints)
            except RedresError:
                continue  # of another arm, or of nobody's
            if cycles and cycle.stamp < cycles[-1].stamp:
                cycles = []  # the clock of another robot
            if not cycles or cycle.stamp > cycles[-1].stamp:
                cycles.append(cycle)
        return cycles
