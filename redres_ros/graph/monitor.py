"""A running graph from outside: its nodes' newest messages and health, and the state of the arm."""

import time
from collections.abc import Callable, Mapping
from contextlib import suppress
from dataclasses import replace
from functools import partial
from typing import Any, NamedTuple

import numpy as np
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from rcl_interfaces.msg import ParameterEvent
from rclpy.node import Node
from rclpy.parameter import parameter_value_to_python
from rclpy.qos import QoSProfile, ReliabilityPolicy
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64MultiArray, String

from redres_ros.errors import RedresError, one_line
from redres_ros.graph.client import GraphClient
from redres_ros.nodes import controller_telemetry
from redres_ros.nodes.controller_telemetry import Figures
from redres_ros.nodes.conversions import EncodingError, JointMapper, deserialised
from redres_ros.nodes.robot_parameters import DESCRIPTION, make_arm
from redres_ros.nodes.topics import LATCHED, MODE, NEWEST, QUALITY, REASON, SESSION, TASK_STATE
from redres_ros.robot_model import RobotModel
from redres_ros.types import finite_vector

WORDS = (SESSION, QUALITY, REASON, TASK_STATE, MODE)
NODES = ('sim', 'planner', 'controller')

_STALE = 3.0  # [s] a node that is silent for longer has gone: it sends diagnostics once a second
_STATES = 'joint_states'
_SILENCE = 1.0  # [s] without a snapshot after which the robot's own states are read
_PATIENCE = 3.0  # [s] for the URDF on a topic, which is latched
_LOOK = 0.02  # [s] between looks at whether it has come
# Best effort: an observer must not delay the nodes. Deep enough for one that was delayed itself.
_SNAPSHOTS = QoSProfile(depth=50, reliability=ReliabilityPolicy.BEST_EFFORT)


class Sample(NamedTuple):
    """A serialised message, and when it was sent, time of day [ns]."""

    data: bytes
    sent: int


class Sampler:
    """Takes what has come in since the last look.

    A callback for each message of a robot would wake this process a thousand times a second. Here
    messages wait in DDS, whose thread does not need Python, until they are taken. The subscriptions
    belong to a node that is not spun, beside one that is.
    """

    def __init__(self, beside: Node) -> None:
        self._node = Node(
            f'{beside.get_name()}_sampler',
            context=beside.context,
            namespace=beside.get_namespace(),
            start_parameter_services=False,
            enable_rosout=False,
        )
        self._subscriptions: dict[str, Any] = {}

    def add(self, topic: str, kind: type, quality: QoSProfile) -> None:
        """Collect the messages of a topic; the depth of the quality is how many may wait."""
        if topic not in self._subscriptions:
            self._subscriptions[topic] = self._node.create_subscription(
                kind, topic, lambda message: None, quality, raw=True
            )

    def remove(self, topic: str) -> None:
        """Stop collecting a topic, if it is collected."""
        if topic in self._subscriptions:
            self._node.destroy_subscription(self._subscriptions.pop(topic))

    def take(self, topic: str) -> list[Sample]:
        """The messages of a topic since the last call, oldest first."""
        subscription = self._subscriptions[topic]
        taken = []
        handle = subscription.handle
        with handle:
            while (found := handle.take_message(subscription.msg_type, True)) is not None:
                data, times = found
                taken.append(Sample(data, times['source_timestamp']))
        return taken

    def newest(self, topic: str) -> Any:
        """The newest message of a topic since the last call; None if there is none."""
        for sample in self.take(topic)[-1:]:
            with suppress(EncodingError):
                return deserialised(sample.data, self._subscriptions[topic].msg_type)
        return None

    def close(self) -> None:
        self._node.destroy_node()


class NodeHealth(NamedTuple):
    """A node's own report, and whether all is well; None: it is silent."""

    text: str
    is_well: bool | None


class GraphMonitor(Node):
    """Receives what the nodes publish anyway, so that observing costs them almost nothing."""

    def __init__(self, name: str, namespace: str = '', patience: float = 5.0) -> None:
        super().__init__(name, namespace=namespace or None)
        self.values: dict[str, Any] = {}  # the newest of each topic
        self._reports: dict[str, tuple[NodeHealth, float]] = {}  # by node, with their times [s]
        self.samples = Sampler(self)  # of fast topics
        self.client = GraphClient(self, patience)
        # Called with the node and the changed values.
        self.on_parameters: Callable[[str, dict[str, Any]], None] = lambda node, values: None
        for topic in WORDS:
            self.create_subscription(String, topic, partial(self._on_word, topic), LATCHED)
        self.create_subscription(DiagnosticArray, '/diagnostics', self._on_diagnostics, 10)
        self.create_subscription(ParameterEvent, '/parameter_events', self._on_event, 100)

    def word(self, topic: str) -> str:
        """The newest text of a topic; empty before there is one, or if its node is silent."""
        return str(self.live_values().get(topic, ''))

    def live_values(self) -> dict[str, Any]:
        """The newest values by topic, without what nodes have left that are silent by now."""
        health = self.health()
        silent = tuple(f'{node}/' for node in self._reports if health[node].is_well is None)
        return {name: value for name, value in self.values.items() if not name.startswith(silent)}

    def health(self) -> dict[str, NodeHealth]:
        """The last report of each node, or for how long it has been silent."""
        health = dict.fromkeys(NODES, NodeHealth('no message', None))
        for node, (report, at) in self._reports.items():
            silence = time.monotonic() - at
            is_silent = silence >= _STALE
            health[node] = NodeHealth(f'silent for {silence:.0f} s', None) if is_silent else report
        return health

    def sampled(self, topic: str, kind: type, default: Any = None) -> Any:
        """The newest `data` of a topic, which is followed from the first call on."""
        self.samples.add(topic, kind, NEWEST)
        message = self.samples.newest(topic)
        if message is not None:
            self.keep(topic, message.data)
        return self.values.get(topic, default)

    def keep(self, topic: str, value: object) -> None:
        """Store a value of a topic; a text may be anyone's."""
        self.values[topic] = one_line(value) if isinstance(value, str) else value

    def destroy_node(self) -> None:
        self.samples.close()
        super().destroy_node()  # type: ignore[no-untyped-call]

    def _on_word(self, topic: str, message: String) -> None:
        self.keep(topic, message.data)

    def _on_diagnostics(self, message: DiagnosticArray) -> None:
        for status in message.status:
            name = self._own(status.name)
            if name in NODES:
                is_well = status.level == DiagnosticStatus.OK
                report = NodeHealth(one_line(status.message), is_well)
                self._reports[name] = (report, time.monotonic())

    def _on_event(self, message: ParameterEvent) -> None:
        name = self._own(message.node)
        if name in NODES:
            changed = [*message.new_parameters, *message.changed_parameters]
            values = {p.name: parameter_value_to_python(p.value) for p in changed}
            self.on_parameters(name, values)

    def _own(self, name: str) -> str:
        return name.removeprefix(self.get_namespace().rstrip('/') + '/')


class LiveArm:
    """The measured positions of an arm from the controller's snapshots, or from the robot itself
    while there are none: the controller may be inactive, and somebody else move the arm.

    Raises RedresError if the arm in the controller's parameters is not known here.
    """

    def __init__(self, monitor: GraphMonitor, values: Mapping[str, Any]) -> None:
        self._samples = monitor.samples
        arm = make_arm(values['robot'], values['tip_frame'], self._await_description)
        limits = tuple(values['acceleration_limit'])
        self.model = RobotModel(
            replace(arm, acceleration_limit=limits, dynamics=values['dynamics'])
        )
        self.q = np.zeros(self.model.n)
        self._joints = JointMapper(self.model.joint_names)
        self._seen_at = time.monotonic()  # [s] when a snapshot came last
        self._samples.add(controller_telemetry.TOPIC, Float64MultiArray, _SNAPSHOTS)

    def look(self) -> list[Figures]:
        """Process the messages since the last call; returns their figures in order."""
        figures = []
        for sample in self._samples.take(controller_telemetry.TOPIC):
            with suppress(RedresError):  # malformed
                message = deserialised(sample.data, Float64MultiArray)
                seen, self.q = controller_telemetry.from_message(message, self.model.n)
                self._seen_at = time.monotonic()
                figures.append(seen)
        if time.monotonic() - self._seen_at > _SILENCE:
            self._look_at_states()
        else:
            self._samples.remove(_STATES)  # each would cost the robot a message
        return figures

    def _look_at_states(self) -> None:
        self._samples.add(_STATES, JointState, NEWEST)
        state = self._samples.newest(_STATES)
        if state is not None:
            with suppress(RedresError):  # malformed, or of another device
                self.q = finite_vector(self._joints.in_order(state, 'position'), self.model.n, 'q')

    def _await_description(self) -> str:
        """The URDF on the topic; empty if none comes."""
        self._samples.add(DESCRIPTION, String, LATCHED)
        until = time.monotonic() + _PATIENCE
        message = None
        while message is None and time.monotonic() < until:
            time.sleep(_LOOK)
            message = self._samples.newest(DESCRIPTION)
        self._samples.remove(DESCRIPTION)
        return str(message.data) if message else ''
