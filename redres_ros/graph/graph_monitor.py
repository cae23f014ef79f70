"""A running graph from outside: its nodes' newest messages, health, parameters and services."""

import time
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import Any, NamedTuple

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from rcl_interfaces.msg import ParameterEvent
from rclpy.node import Node
from rclpy.parameter import parameter_value_to_python
from rclpy.qos import QoSProfile
from std_msgs.msg import Float64, String

from redres_ros.errors import one_line
from redres_ros.graph.client import PATIENCE, GraphClient
from redres_ros.nodes.topics import (
    ACTIVE_LIMITS,
    LATCHED,
    MODE,
    NEWEST,
    PROGRESS,
    QUALITY,
    REASON,
    SESSION,
    TASK_STATE,
)
from redres_ros.nodes.wire import EncodingError, deserialised


class Sample(NamedTuple):
    """A serialised message, and when it was sent and received, time of day [ns]."""

    data: bytes
    sent: int
    received: int


class Sampler:
    """Takes what has come in since the last look.

    A callback for each message of a robot would wake this process a thousand times a second. Here
    messages wait in DDS, whose thread does not need Python, until they are taken.

    Args:
        beside: A node that is spun; the subscriptions belong to another one, which is not spun.
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
        """Start to collect the messages of a topic, unless they are collected already.

        Args:
            topic: Its name.
            kind: Type of its messages.
            quality: Its depth is how many may wait.
        """
        if topic not in self._subscriptions:
            self._subscriptions[topic] = self._node.create_subscription(
                kind, topic, _never, quality, raw=True
            )

    def remove(self, topic: str) -> None:
        """Stop collecting a topic."""
        self._node.destroy_subscription(self._subscriptions.pop(topic))

    def take(self, topic: str) -> list[Sample]:
        """The messages of a topic since the last call, oldest first."""
        subscription = self._subscriptions[topic]
        taken = []
        handle = subscription.handle
        with handle:
            while (found := handle.take_message(subscription.msg_type, True)) is not None:
                data, times = found
                taken.append(Sample(data, times['source_timestamp'], times['received_timestamp']))
        return taken

    def newest(self, topic: str) -> Any:
        """The newest message of a topic since the last call; None if there is none."""
        taken = self.take(topic)
        if not taken:
            return None
        try:
            return deserialised(taken[-1].data, self._subscriptions[topic].msg_type)
        except EncodingError:
            return None

    def close(self) -> None:
        """Release the subscriptions."""
        self._node.destroy_node()


def _never(message: Any) -> None:
    """Never called, because the node is not spun."""


WORDS = (SESSION, QUALITY, REASON, TASK_STATE, MODE)
NODES = ('sim', 'planner', 'controller')

STALE = 3.0  # [s] a node that is silent for longer has gone: it sends diagnostics once a second


@dataclass(frozen=True)
class LastValue:
    """A value, and the instant [s] at which it came."""

    value: object
    at: float


class NodeHealth(NamedTuple):
    """A node's own report, and whether all is well."""

    text: str
    is_well: bool


class GraphMonitor(Node):
    """Receives what the nodes publish anyway, so that observing costs them almost nothing.

    Attributes:
        values: The newest of each topic, and the NodeHealth of a node under the node's name.
        samples: Messages of fast topics, which wait until they are taken.
        client: Calls the nodes' services.
        on_parameters: Called with the node and the changed values when parameters change.

    Args:
        name: Name of this node.
        namespace: Namespace of the arm's nodes; empty: none.
        patience: How long to wait for a service, and for its response [s].
    """

    def __init__(self, name: str, namespace: str = '', patience: float = PATIENCE) -> None:
        super().__init__(name, namespace=namespace or None)
        self.values: dict[str, LastValue] = {}
        self.samples = Sampler(self)
        self.client = GraphClient(self, patience)
        self.on_parameters: Callable[[str, dict[str, Any]], None] = lambda node, values: None
        for topic in WORDS:
            self.create_subscription(String, topic, partial(self._on_word, topic), LATCHED)
        self.create_subscription(DiagnosticArray, '/diagnostics', self._on_diagnostics, 10)
        self.create_subscription(ParameterEvent, '/parameter_events', self._on_event, 100)

    def word(self, topic: str) -> str:
        """What was published last on a topic of text; empty before anything was."""
        return str(self.values[topic].value) if topic in self.values else ''

    def health(self) -> dict[str, str]:
        """The last report of each node, or the duration of its silence."""
        now = time.monotonic()
        health = {}
        for node in NODES:
            last = self.values.get(node)
            if last is not None and isinstance(last.value, NodeHealth):
                silence = now - last.at
                health[node] = f'silent for {silence:.0f} s'
                if silence < STALE:
                    health[node] = last.value.text
        return health

    def progress(self) -> float:
        """The fraction of the goal that is done, 0 to 1; followed from the first call on."""
        return float(self._newest(PROGRESS, Float64, 0.0))

    def limits(self) -> dict[str, set[str]]:
        """The most active limit by joint or pair of bodies; followed from the first call on."""
        place, _, limit = self._newest(ACTIVE_LIMITS, String, '').rpartition(': ')
        return {place: {limit}} if limit else {}

    def _newest(self, topic: str, kind: type, before: Any) -> Any:
        """The newest value of a sampled topic; `before` until there is one."""
        self.samples.add(topic, kind, NEWEST)
        message = self.samples.newest(topic)
        if message is not None:
            self.keep(topic, message.data)
        return self.values[topic].value if topic in self.values else before

    def keep(self, source: str, value: object) -> None:
        """Store a value with the present time.

        Args:
            source: A topic, or the name of a node.
            value: What it published.
        """
        if isinstance(value, str):
            value = one_line(value)  # anyone may have published it
        self.values[source] = LastValue(value, time.monotonic())

    def destroy_node(self) -> None:
        """Release this node, and that of the samples."""
        self.samples.close()
        super().destroy_node()  # type: ignore[no-untyped-call]

    def _on_word(self, topic: str, message: String) -> None:
        self.keep(topic, message.data)

    def _on_diagnostics(self, message: DiagnosticArray) -> None:
        for status in message.status:
            name = self._own(status.name)
            if name in NODES:
                summary = one_line(status.message)
                self.keep(name, NodeHealth(summary, status.level == DiagnosticStatus.OK))

    def _on_event(self, message: ParameterEvent) -> None:
        name = self._own(message.node)
        if name in NODES:
            changed = [*message.new_parameters, *message.changed_parameters]
            values = {p.name: parameter_value_to_python(p.value) for p in changed}
            self.on_parameters(name, values)

    def _own(self, name: str) -> str:
        """The name of a node in this namespace."""
        return name.removeprefix(self.get_namespace().rstrip('/') + '/')
