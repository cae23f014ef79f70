"""A snapshot of a running graph over a few seconds, before the arm moves."""

import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from typing import Any, NamedTuple

from diagnostic_msgs.msg import DiagnosticArray
from geometry_msgs.msg import TwistStamped
from rclpy.qos import QoSProfile, ReliabilityPolicy
from rclpy.topic_endpoint_info import TopicEndpointInfo
from sensor_msgs.msg import JointState
from std_msgs.msg import String

from redres_ros.errors import one_line
from redres_ros.graph.client import CallError
from redres_ros.graph.monitor import GraphMonitor, Sample
from redres_ros.nodes.conversions import EncodingError, deserialised, to_nanoseconds
from redres_ros.nodes.robot_parameters import DESCRIPTION
from redres_ros.nodes.topics import LATCHED, MODE, REASON, SESSION

STATES = 'joint_states'
TWISTS = 'cartesian_velocity'
COMMANDS = 'joint_command'
FORWARD = 'forward_position_controller/commands'
CONTROLLER = 'controller'
ACTIVITY = 'controller_manager/activity'

_FORWARDING = 'forward_position_controller'
_DIAGNOSTICS = '/diagnostics'  # of controller_managers, too
_HARDWARE = 'Hardware Components'  # in the name of their status there
_LOOK = 0.5  # [s] between looks at what has come: fewer messages than may wait
_DISCOVERY = 4.0  # [s]; a node whose first announcements are lost is found 3 s later
_ASKED = (  # of the controller
    'rate',
    'robot',
    'tip_frame',
    'base_frame',
    'robot_interface',
    'limits',
    'limit_scale',
    'position.margin',
)
_MANY = QoSProfile(depth=1000, reliability=ReliabilityPolicy.BEST_EFFORT)


class StateSeen(NamedTuple):
    """A message of joint_states: stamp [ns], arrival by this computer's clock [ns], and joints."""

    stamp: int
    arrived: int
    positions: Mapping[str, float]


@dataclass(frozen=True)
class GraphSnapshot:
    """What was observed of a graph.

    Attributes:
        states: In the order of arrival.
        publishers: Full names of the nodes that publish on a topic, by topic.
        subscribers: The same of subscribers.
        twist_frames: Frames of the task velocities that came.
        words: Newest session state, stop reason and mode, by topic.
        description: The URDF on robot_description; empty: none came.
        controller: Parameters of the controller by name; None: there is no controller.
        controllers: How many nodes have its name.
        forward_joints: In the order of the forward_position_controller; empty: not known.
        forward_states: States of its life cycle, as controller_managers report them; none: not
            known.
        hardware: States of ros2_control's hardware components by their names.
    """

    states: tuple[StateSeen, ...] = ()
    publishers: Mapping[str, tuple[str, ...]] = field(default_factory=dict)
    subscribers: Mapping[str, tuple[str, ...]] = field(default_factory=dict)
    twist_frames: frozenset[str] = frozenset()
    words: Mapping[str, str] = field(default_factory=dict)
    description: str = ''
    controller: Mapping[str, Any] | None = None
    controllers: int = 0
    forward_joints: tuple[str, ...] = ()
    forward_states: frozenset[str] = frozenset()
    hardware: Mapping[str, str] = field(default_factory=dict)


class SnapshotNode(GraphMonitor):
    """Observes the arm's nodes, and asks controllers for their parameters; publishes nothing."""

    def __init__(self, namespace: str = '', states: str = STATES) -> None:
        super().__init__('redres_check', namespace)
        self._states_topic = states
        self._states: list[StateSeen] = []
        self._frames: set[str] = set()
        self._description = ''
        self._forward_states: dict[str, str] = {}  # by controller_manager
        self._hardware: dict[str, str] = {}  # by component
        self._activity_type = _find_activity_type()
        self.samples.add(states, JointState, _MANY)
        self.samples.add(TWISTS, TwistStamped, _MANY)
        self.samples.add(DESCRIPTION, String, LATCHED)
        self.samples.add(_DIAGNOSTICS, DiagnosticArray, _MANY)
        if self._activity_type is not None:
            self.samples.add(ACTIVITY, self._activity_type, LATCHED)

    def look(self, seconds: float) -> GraphSnapshot:
        """A snapshot over that time [s], longer while states or a controller are missing; the node
        must be spun elsewhere.
        """
        self._collect(seconds)
        if not (self._states and self._count(CONTROLLER)):
            self._collect(max(_DISCOVERY - seconds, 0.0))
        topics = {topic: topic for topic in (TWISTS, COMMANDS, FORWARD, ACTIVITY)}
        topics[STATES] = self._states_topic
        forwarding = self._ask(_FORWARDING, ('joints',)) or {}
        return GraphSnapshot(
            states=tuple(self._states),
            publishers=self._nodes(topics, self.get_publishers_info_by_topic),
            subscribers=self._nodes(topics, self.get_subscriptions_info_by_topic),
            twist_frames=frozenset(self._frames),
            words={topic: self.word(topic) for topic in (SESSION, REASON, MODE)},
            description=self._description,
            controller=self._ask(CONTROLLER, _ASKED),
            controllers=self._count(CONTROLLER),
            forward_joints=tuple(forwarding.get('joints') or ()),
            forward_states=frozenset(self._forward_states.values()),
            hardware=dict(self._hardware),
        )

    def _collect(self, seconds: float) -> None:
        """Record what comes in that time [s]."""
        until = time.monotonic() + seconds
        while (left := until - time.monotonic()) > 0.0:
            time.sleep(min(left, _LOOK))
            for sample, state in self._taken(self._states_topic, JointState):
                stamp = to_nanoseconds(state.header.stamp)
                positions = dict(zip(state.name, state.position, strict=False))
                self._states.append(StateSeen(stamp, sample.received, positions))
            for _, twist in self._taken(TWISTS, TwistStamped):
                self._frames.add(twist.header.frame_id)
            for _, diagnostics in self._taken(_DIAGNOSTICS, DiagnosticArray):
                self._take_diagnostics(diagnostics)
            activity = None if self._activity_type is None else self.samples.newest(ACTIVITY)
            if activity is not None:
                self._take_activity(activity)
            description = self.samples.newest(DESCRIPTION)
            if description is not None:
                self._description = description.data

    def _taken(self, topic: str, kind: type) -> Iterator[tuple[Sample, Any]]:
        """What has come on a topic, without what is malformed."""
        for sample in self.samples.take(topic):
            with suppress(EncodingError):
                yield sample, deserialised(sample.data, kind)

    def _take_diagnostics(self, message: DiagnosticArray) -> None:
        """Record the states of controllers and hardware, which any manager may report."""
        for status in message.status:
            for pair in status.values:
                name, _, rest = pair.key.rpartition('.')
                if rest == 'state' and name == _FORWARDING:
                    self._forward_states[status.name] = one_line(pair.value)
                elif rest == 'state' and _HARDWARE in status.name:
                    self._hardware[one_line(name)] = one_line(pair.value)

    def _take_activity(self, message: Any) -> None:
        """Record the states that the manager of this namespace reports, as soon as they change."""
        for controller in message.controllers:
            if controller.name == _FORWARDING:
                self._forward_states = {ACTIVITY: one_line(controller.state.label)}
        for component in message.hardware_components:
            self._hardware[one_line(component.name)] = one_line(component.state.label)

    def _nodes(
        self, topics: Mapping[str, str], infos: Callable[[str], Sequence[TopicEndpointInfo]]
    ) -> dict[str, tuple[str, ...]]:
        """Full names of the nodes at the ends of topics, by the topics' own names."""
        own = self.get_fully_qualified_name()
        found = {}
        for topic, name in topics.items():
            ends = infos(self.resolve_topic_name(name))
            nodes = {f'{end.node_namespace.rstrip("/")}/{end.node_name}' for end in ends}
            found[topic] = tuple(sorted(node for node in nodes if not node.startswith(own)))
        return found

    def _count(self, name: str) -> int:
        wanted = (name, self.get_namespace())
        return self.get_node_names_and_namespaces().count(wanted)

    def _ask(self, node: str, names: Sequence[str]) -> dict[str, Any] | None:
        """Parameters of a node; None if it is not there, or does not respond."""
        if not self._count(node):
            return None
        try:
            return self.client.parameters(node, names)
        except CallError:
            return None


def _find_activity_type() -> Any:
    """The type of ros2_control's topic of activity; None if its messages are not installed here."""
    try:
        from controller_manager_msgs.msg import ControllerManagerActivity
    except ImportError:
        return None
    return ControllerManagerActivity
