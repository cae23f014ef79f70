"""What a spectator knows of a running graph: its newest words, its health and its parameters."""

import time
from collections.abc import Callable
from functools import partial
from typing import Any

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from rcl_interfaces.msg import ParameterEvent
from rclpy.node import Node
from rclpy.parameter import parameter_value_to_python
from std_msgs.msg import String

from redres_ros.errors import one_line
from redres_ros.graph.last_value import STALE, LastValue, NodeHealth
from redres_ros.nodes.qos import LATCHED
from redres_ros.nodes.session_topics import QUALITY, REASON, SESSION
from redres_ros.nodes.task_topics import TASK_STATE

WORDS = (SESSION, QUALITY, REASON, TASK_STATE)
NODES = ('sim', 'planner', 'controller')

NICENESS = 10  # who looks on must wait for those who work, where processors are few


class GraphMonitor(Node):
    """Listens to what the nodes tell anyway, so that looking on costs them next to nothing.

    `heard` has the newest of each topic, and the NodeHealth of a node under the node's name.
    `on_parameters` is called with node and changed values whenever a node's parameters change.

    Args:
        name: Of this node.
        namespace: Of the arm's nodes; empty: none.
    """

    def __init__(self, name: str, namespace: str = '') -> None:
        super().__init__(name, namespace=namespace or None)
        self.heard: dict[str, LastValue] = {}
        self.on_parameters: Callable[[str, dict[str, Any]], None] = lambda node, values: None
        for topic in WORDS:
            self.create_subscription(String, topic, partial(self._on_word, topic), LATCHED)
        self.create_subscription(DiagnosticArray, '/diagnostics', self._on_diagnostics, 10)
        self.create_subscription(ParameterEvent, '/parameter_events', self._on_event, 100)

    @property
    def words(self) -> dict[str, str]:
        """What was said last on each of WORDS; empty before anything was."""
        nothing = LastValue('', 0.0)
        return {topic: str(self.heard.get(topic, nothing).value) for topic in WORDS}

    def health(self) -> dict[str, str]:
        """What each node said of itself last, or for how long it has been silent."""
        now = time.monotonic()
        health = {}
        for node in NODES:
            said = self.heard.get(node)
            if said is not None and isinstance(said.value, NodeHealth):
                silence = now - said.at
                health[node] = f'silent for {silence:.0f} s'
                if silence < STALE:
                    health[node] = said.value.text
        return health

    def keep(self, source: str, value: object) -> None:
        """Note what was heard now.

        Args:
            source: A topic, or the name of a node.
            value: What it said.
        """
        if isinstance(value, str):
            value = one_line(value)  # anyone may have said it
        self.heard[source] = LastValue(value, time.monotonic())

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
