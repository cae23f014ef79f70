"""`redres watch`: the live state of the nodes in a terminal."""

import threading
import time
from functools import partial
from typing import Any

import rclpy
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from geometry_msgs.msg import PoseStamped
from rclpy.node import Node
from rich.console import RenderableType
from rich.live import Live
from std_msgs.msg import Float64, Int32, String

from redres_ros.demo.watch_page import NODES, Heard, NodeHealth, page
from redres_ros.nodes.qos import LATCHED, NEWEST

_REFRESH = 5.0  # [Hz]

_LATCHED = {'sim/session_state', 'sim/connection_quality', 'sim/stop_reason', 'planner/state'}
_WORDS = {*_LATCHED, 'controller/law', 'controller/limiting'}
_COUNTS = {'planner/segment'}
_POSES = {'controller/tip_pose'}


class Watch(Node):
    """Keeps the newest word and figure of every topic on the page, and when it came."""

    def __init__(self) -> None:
        super().__init__('watch')
        self._heard: dict[str, Heard] = {}
        for rows in NODES.values():
            for row in rows:
                self._listen(row.topic)
        self.create_subscription(DiagnosticArray, '/diagnostics', self._on_diagnostics, 10)

    @property
    def heard(self) -> bool:
        """Whether anything has come."""
        return bool(self._heard)

    def page(self) -> RenderableType:
        """The page as it is now."""
        return page(dict(self._heard), time.monotonic(), self.context.get_domain_id())

    def _listen(self, topic: str) -> None:
        kind: type = Float64
        if topic in _WORDS:
            kind = String
        elif topic in _COUNTS:
            kind = Int32
        elif topic in _POSES:
            kind = PoseStamped
        quality = LATCHED if topic in _LATCHED else NEWEST
        self.create_subscription(kind, topic, partial(self._on_message, topic), quality)

    def _on_message(self, topic: str, message: Any) -> None:
        if topic in _POSES:
            position = message.pose.position
            self._keep(topic, (position.x, position.y, position.z))
        else:
            self._keep(topic, message.data)

    def _on_diagnostics(self, message: DiagnosticArray) -> None:
        """What a node of this namespace says of its health."""
        prefix = self.get_namespace().rstrip('/') + '/'
        for status in message.status:
            node = status.name.removeprefix(prefix)
            if node in NODES:
                self._keep(node, NodeHealth(status.message, status.level == DiagnosticStatus.OK))

    def _keep(self, source: str, value: object) -> None:
        self._heard[source] = Heard(value, time.monotonic())


def watch(node: Watch, stopped: threading.Event, duration: float | None = None) -> None:
    """Show the page.

    Args:
        node: What listens.
        stopped: Ends it.
        duration: Ends it after that time [s]; None: not.
    """
    until = time.monotonic() + duration if duration is not None else float('inf')
    with Live(node.page(), refresh_per_second=_REFRESH) as live:
        while rclpy.ok() and not stopped.is_set() and time.monotonic() < until:
            time.sleep(1.0 / _REFRESH)
            live.update(node.page())
