"""`redres watch`: the live state of the nodes in a terminal."""

import time
from contextlib import nullcontext
from typing import Any

import rclpy
from rich.console import Console, RenderableType
from rich.live import Live
from std_msgs.msg import Float64, Int32, String

from redres_ros.command import VALUES
from redres_ros.errors import RedresError
from redres_ros.graph.graph_monitor import WORDS, GraphMonitor
from redres_ros.graph.live_arm import LiveArm
from redres_ros.graph.watch_page import NODES, JointBar, line, page
from redres_ros.nodes.topics import ACTIVE_LIMITS

_REFRESH = 5.0  # [Hz]
_LINE_EVERY = 1.0  # [s]

_LAW = 'controller/law'
_TIP = 'controller/tip_pose'
_TYPES = {_LAW: String, ACTIVE_LIMITS: String, 'planner/segment': Int32}  # all others: Float64


class Watch(GraphMonitor):
    """Keeps the newest value of every topic on the page, with its time."""

    def __init__(self, namespace: str = '') -> None:
        super().__init__('watch', namespace)
        self._arm: LiveArm | None = None
        self._followed = [ACTIVE_LIMITS, *_sampled('planner')]
        self._is_known = True  # whether the arm is known here
        self.on_parameters = self._on_parameters

    def page(self) -> RenderableType:
        """The page as it is now."""
        domain = self.context.get_domain_id()
        return page(dict(self.values), time.monotonic(), domain, self._joints())

    def line(self) -> str:
        """The most important values, in a line."""
        return line(dict(self.values), time.monotonic(), self.context.get_domain_id())

    def look(self) -> None:
        """Update the arm's state; identify the arm once its controller is there."""
        for topic in self._followed:
            self._newest(topic, _TYPES.get(topic, Float64), None)
        if self._arm is not None:
            self._look_at(self._arm)
        elif self._is_known and self.client.offers('controller'):
            try:
                values = self.client.parameters('controller')
                self._arm = LiveArm(self, values)
                self.keep(_LAW, values['law'])
            except RedresError:
                self._is_known = False  # the page shows the rest
                self._followed += _sampled('controller')

    def _look_at(self, arm: LiveArm) -> None:
        # A snapshot has all figures: subscribing to each would cost the controller time.
        seen = arm.look()
        if not seen:
            return
        for name in VALUES:
            self.keep(f'controller/{name}', getattr(seen[-1], name))
        self.keep(_TIP, tuple(arm.model.tip(arm.q)[0].tolist()))

    def _joints(self) -> list[JointBar]:
        arm = self._arm
        if arm is None:
            return []
        acting = self.limits()
        names = arm.model.joint_names
        return [
            JointBar(name, fraction, q, tuple(sorted(acting.get(name, ()))))
            for name, fraction, q in zip(names, arm.fractions.tolist(), arm.q.tolist(), strict=True)
        ]

    def _on_parameters(self, node: str, values: dict[str, Any]) -> None:
        if node == 'controller' and 'law' in values:
            self.keep(_LAW, values['law'])


def _sampled(node: str) -> list[str]:
    """The topics of a node on the page with figures of which only the newest matters."""
    topics = [row.topic for row in NODES[node]]
    return [topic for topic in topics if topic not in (*WORDS, ACTIVE_LIMITS, _TIP)]


def watch(node: Watch, duration: float | None = None) -> None:
    """Show the page; in a pipe or a file print a line a second, and the page once, at the end.

    Args:
        node: What listens.
        duration: Ends it after that time [s]; None: not.
    """
    until = time.monotonic() + duration if duration is not None else float('inf')
    console = Console()
    live = Live(node.page(), console=console, refresh_per_second=_REFRESH)
    due = 0.0  # [s] when the next line is
    with live if console.is_terminal else nullcontext():
        while rclpy.ok() and time.monotonic() < until:
            time.sleep(1.0 / _REFRESH)
            node.look()
            if console.is_terminal:
                live.update(node.page())
            elif time.monotonic() >= due:
                due = time.monotonic() + _LINE_EVERY
                print(node.line(), flush=True)  # a pipe would keep it back
    if not console.is_terminal:
        console.print(node.page())
