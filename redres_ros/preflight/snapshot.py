"""A snapshot of a running graph over a few seconds, before the arm moves."""

import time
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from typing import Any, NamedTuple

from rclpy.qos import QoSProfile, ReliabilityPolicy
from rclpy.topic_endpoint_info import TopicEndpointInfo
from sensor_msgs.msg import JointState
from std_msgs.msg import String

from redres_ros.graph.client import CallError
from redres_ros.graph.monitor import GraphMonitor
from redres_ros.nodes.conversions import EncodingError, deserialised, to_nanoseconds
from redres_ros.nodes.robot_parameters import DESCRIPTION
from redres_ros.nodes.topics import LATCHED, MODE, REASON, SESSION

STATES = 'joint_states'
TWISTS = 'cartesian_velocity'
COMMANDS = 'joint_command'
FORWARD = 'forward_position_controller/commands'
CONTROLLER = 'controller'

_FORWARDING = 'forward_position_controller'
_LOOK = 0.5  # [s] between looks at what has come: fewer messages than may wait
_DISCOVERY = 4.0  # [s]; a node whose first announcements are lost is found 3 s later
# Parameters of the controller.
_ASKED = ('rate', 'robot', 'tip_frame', 'base_frame', 'robot_interface', 'limits', 'limit_scale')
_MANY = QoSProfile(depth=1000, reliability=ReliabilityPolicy.BEST_EFFORT)


class StateSeen(NamedTuple):
    """A message of joint_states: stamp [ns], and joints."""

    stamp: int
    positions: Mapping[str, float]


@dataclass
class GraphSnapshot:
    """What was observed of a graph; nodes by their full names."""

    states: list[StateSeen] = field(default_factory=list)  # in the order of arrival
    publishers: dict[str, list[str]] = field(default_factory=dict)  # nodes by topic
    subscribers: dict[str, list[str]] = field(default_factory=dict)  # nodes by topic
    words: dict[str, str] = field(default_factory=dict)  # session state, stop reason, mode by topic
    description: str = ''  # the URDF on robot_description; empty: none came
    controller: dict[str, Any] | None = None  # its parameters; None: there is no controller
    controllers: int = 0  # nodes of its name
    problem: str = ''  # that it reports on /diagnostics
    forward_joints: list[str] = field(default_factory=list)  # of the forward_position_controller


class SnapshotNode(GraphMonitor):
    """Observes the arm's nodes, and asks controllers for their parameters; publishes nothing."""

    def __init__(self, namespace: str = '', states: str = STATES) -> None:
        super().__init__('redres_check', namespace)
        self._states_topic = states
        self.samples.add(states, JointState, _MANY)
        self.samples.add(DESCRIPTION, String, LATCHED)

    def look(self, seconds: float) -> GraphSnapshot:
        """A snapshot over some seconds, more if nodes are missing; the node is spun elsewhere."""
        seen = GraphSnapshot()
        self._collect(seen, seconds)
        if not (seen.states and self._count(CONTROLLER)):
            self._collect(seen, max(_DISCOVERY - seconds, 0.0))
        seen.publishers = self._nodes(self.get_publishers_info_by_topic)
        seen.subscribers = self._nodes(self.get_subscriptions_info_by_topic)
        seen.words = {topic: self.word(topic) for topic in (SESSION, REASON, MODE)}
        seen.controller = self._ask(CONTROLLER, _ASKED)
        seen.controllers = self._count(CONTROLLER)
        health = self.health()[CONTROLLER]
        if health.is_well is False:
            seen.problem = health.text
        forwarding = self._ask(_FORWARDING, ('joints',)) or {}
        seen.forward_joints = forwarding.get('joints') or []
        return seen

    def _collect(self, seen: GraphSnapshot, seconds: float) -> None:
        until = time.monotonic() + seconds
        while (left := until - time.monotonic()) > 0.0:
            time.sleep(min(left, _LOOK))
            for sample in self.samples.take(self._states_topic):
                with suppress(EncodingError):  # malformed
                    state = deserialised(sample.data, JointState)
                    stamp = to_nanoseconds(state.header.stamp)
                    positions = dict(zip(state.name, state.position, strict=False))
                    seen.states.append(StateSeen(stamp, positions))
        if description := self.samples.newest(DESCRIPTION):
            seen.description = description.data

    def _nodes(self, infos: Callable[[str], Sequence[TopicEndpointInfo]]) -> dict[str, list[str]]:
        """The nodes at the ends of topics."""
        own = self.get_fully_qualified_name()
        found = {}
        for topic in (STATES, TWISTS, COMMANDS, FORWARD):
            name = self._states_topic if topic == STATES else topic
            ends = infos(self.resolve_topic_name(name))
            nodes = {f'{end.node_namespace.rstrip("/")}/{end.node_name}' for end in ends}
            found[topic] = sorted(node for node in nodes if not node.startswith(own))
        return found

    def _count(self, name: str) -> int:
        return self.get_node_names_and_namespaces().count((name, self.get_namespace()))

    def _ask(self, node: str, names: Sequence[str]) -> dict[str, Any] | None:
        """Parameters of a node; None if it is not there, or does not respond."""
        if not self._count(node):
            return None
        try:
            return self.client.parameters(node, names)
        except CallError:
            return None
