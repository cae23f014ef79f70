"""What the page knows of a running graph: its newest words and parameters."""

import time
from collections.abc import Callable
from functools import partial
from typing import Any

from diagnostic_msgs.msg import DiagnosticArray
from rcl_interfaces.msg import ParameterEvent
from rclpy.node import Node
from rclpy.parameter import parameter_value_to_python
from std_msgs.msg import String

from redres_ros.demo.onlooker import PLANNER, REASON, SESSION
from redres_ros.demo.watch_page import STALE
from redres_ros.nodes.qos import LATCHED

QUALITY = 'sim/connection_quality'
WORDS = (SESSION, QUALITY, REASON, PLANNER)
NODES = ('sim', 'planner', 'controller')

NICENESS = 10  # who looks on must wait for those who work, where processors are few


class Spectator(Node):
    """Listens to what the nodes tell anyway, so that a page costs them next to nothing.

    `on_parameters` is called with node and changed values whenever a node's parameters change.
    """

    def __init__(self) -> None:
        super().__init__('view')
        self.words = dict.fromkeys(WORDS, '')
        self._health: dict[str, tuple[str, float]] = {}  # what a node said, and when [s]
        self.on_parameters: Callable[[str, dict[str, Any]], None] = lambda node, values: None
        for topic in WORDS:
            self.create_subscription(String, topic, partial(self._on_word, topic), LATCHED)
        self.create_subscription(DiagnosticArray, '/diagnostics', self._on_diagnostics, 10)
        self.create_subscription(ParameterEvent, '/parameter_events', self._on_event, 100)

    def health(self) -> dict[str, str]:
        """What each node said of itself last, or for how long it has been silent."""
        now = time.monotonic()
        health = {}
        for node, (said, at) in self._health.items():
            silence = now - at
            health[node] = said if silence < STALE else f'silent for {silence:.0f} s'
        return health

    def _on_word(self, topic: str, message: String) -> None:
        self.words[topic] = message.data

    def _on_diagnostics(self, message: DiagnosticArray) -> None:
        for status in message.status:
            name = self._own(status.name)
            if name in NODES:
                self._health[name] = (status.message, time.monotonic())

    def _on_event(self, message: ParameterEvent) -> None:
        name = self._own(message.node)
        if name in NODES:
            changed = [*message.new_parameters, *message.changed_parameters]
            values = {p.name: parameter_value_to_python(p.value) for p in changed}
            self.on_parameters(name, values)

    def _own(self, name: str) -> str:
        """The name of a node in this namespace."""
        return name.removeprefix(self.get_namespace().rstrip('/') + '/')
