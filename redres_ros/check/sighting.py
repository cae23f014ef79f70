"""What a listener has seen of a running graph in a few seconds, before the arm moves."""

import time
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import partial
from typing import Any, NamedTuple

from geometry_msgs.msg import TwistStamped
from rcl_interfaces.srv import GetParameters
from rclpy.node import Node
from rclpy.parameter import parameter_value_to_python
from rclpy.qos import QoSProfile, ReliabilityPolicy
from sensor_msgs.msg import JointState
from std_msgs.msg import String

from redres_ros.demo.client import CallError, call
from redres_ros.demo.onlooker import REASON, SESSION
from redres_ros.nodes.conversions import to_nanoseconds
from redres_ros.nodes.qos import LATCHED
from redres_ros.nodes.robot_parameters import DESCRIPTION

STATES = 'joint_states'
TWISTS = 'cartesian_velocity'
COMMANDS = 'joint_command'
FORWARD = 'forward_position_controller/commands'
CONTROLLER = 'controller'

_ASKED = (  # of the controller
    'rate',
    'robot',
    'tip_frame',
    'base_frame',
    'forward_commands',
    'limits',
    'limit_scale',
)
_MANY = QoSProfile(depth=1000, reliability=ReliabilityPolicy.BEST_EFFORT)


class StateSeen(NamedTuple):
    """A message of joint_states: stamp [ns], arrival by this computer's clock [ns], and joints."""

    stamp: int
    arrived: int
    positions: Mapping[str, float]


@dataclass(frozen=True)
class Sighting:
    """All that was seen.

    Args:
        states: In the order of arrival.
        publishers: Full names of the nodes that publish on a topic, by topic.
        subscribers: Of those that subscribe.
        twist_frames: Frames of the task velocities that came.
        words: The newest words of a robot that tells of its session, by topic.
        description: The URDF on robot_description; empty: none came.
        controller: Parameters of the controller by name; None: there is no controller.
        controllers: How many nodes have its name.
    """

    states: tuple[StateSeen, ...] = ()
    publishers: Mapping[str, tuple[str, ...]] = field(default_factory=dict)
    subscribers: Mapping[str, tuple[str, ...]] = field(default_factory=dict)
    twist_frames: frozenset[str] = frozenset()
    words: Mapping[str, str] = field(default_factory=dict)
    description: str = ''
    controller: Mapping[str, Any] | None = None
    controllers: int = 0


class Looker(Node):
    """Listens, and asks the controller for its parameters; publishes nothing."""

    def __init__(self, namespace: str = '') -> None:
        super().__init__('redres_check', namespace=namespace or None)
        self._states: list[StateSeen] = []
        self._frames: set[str] = set()
        self._words: dict[str, str] = {}
        self.create_subscription(JointState, STATES, self._on_state, _MANY)
        self.create_subscription(TwistStamped, TWISTS, self._on_twist, _MANY)
        for topic in (DESCRIPTION, SESSION, REASON):
            self.create_subscription(String, topic, partial(self._on_word, topic), LATCHED)

    def look(self, seconds: float) -> Sighting:
        """What is seen in that time; the node must be spun by somebody else."""
        time.sleep(seconds)
        topics = (STATES, TWISTS, COMMANDS, FORWARD)
        return Sighting(
            states=tuple(self._states),
            publishers={topic: self._nodes(topic, publishers=True) for topic in topics},
            subscribers={topic: self._nodes(topic, publishers=False) for topic in topics},
            twist_frames=frozenset(self._frames),
            words={topic: word for topic, word in self._words.items() if topic != DESCRIPTION},
            description=self._words.get(DESCRIPTION, ''),
            controller=self._ask_controller(),
            controllers=self._count(CONTROLLER),
        )

    def _nodes(self, topic: str, *, publishers: bool) -> tuple[str, ...]:
        name = self.resolve_topic_name(topic)
        found = self.get_subscriptions_info_by_topic(name)
        if publishers:
            found = self.get_publishers_info_by_topic(name)
        nodes = (f'{info.node_namespace.rstrip("/")}/{info.node_name}' for info in found)
        own = self.get_fully_qualified_name()
        return tuple(sorted(node for node in nodes if node != own))

    def _count(self, name: str) -> int:
        wanted = (name, self.get_namespace())
        return self.get_node_names_and_namespaces().count(wanted)

    def _ask_controller(self) -> dict[str, Any] | None:
        if not self._count(CONTROLLER):
            return None
        request = GetParameters.Request(names=list(_ASKED))
        try:
            answer = call(self, GetParameters, f'{CONTROLLER}/get_parameters', request)
        except CallError:
            return None
        values = map(parameter_value_to_python, answer.values)
        return dict(zip(_ASKED, values, strict=True))

    def _on_state(self, message: JointState) -> None:
        stamp = to_nanoseconds(message.header.stamp)
        positions = dict(zip(message.name, message.position, strict=False))
        self._states.append(StateSeen(stamp, time.time_ns(), positions))

    def _on_twist(self, message: TwistStamped) -> None:
        self._frames.add(message.header.frame_id)

    def _on_word(self, topic: str, message: String) -> None:
        self._words[topic] = message.data
