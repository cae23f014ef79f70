"""`redres watch`: the live state of the nodes in a terminal."""

import math
import time
from collections.abc import Mapping
from contextlib import nullcontext
from typing import Any, NamedTuple

import numpy as np
import rclpy
from rich import box
from rich.console import Console, Group, RenderableType
from rich.live import Live
from rich.panel import Panel
from rich.table import Table
from rich.text import Text
from std_msgs.msg import Float64, Int32, String

from redres_ros.command import VALUES
from redres_ros.errors import RedresError
from redres_ros.graph.monitor import GraphMonitor, LiveArm, NodeHealth
from redres_ros.nodes.topics import ACTIVE_LIMITS, PROGRESS, QUALITY, REASON, SESSION, TASK_STATE

_REFRESH = 5.0  # [Hz]
_PRINT_EVERY = 1.0  # [s]
_PATIENCE = 20.0  # [s] for a controller on a busy machine to be found, and to respond
_STYLES = {True: 'green', False: 'yellow', None: 'dim'}

_LAW = 'controller/law'
_TIP = 'controller/tip_pose'
_JOINTS = 'joint_states'
_SEGMENT = 'planner/segment'
_ERROR = 'planner/task_error'
_FOLLOWED = {ACTIVE_LIMITS: String, PROGRESS: Float64, _SEGMENT: Int32, _ERROR: Float64}


class _Row(NamedTuple):
    topic: str
    label: str
    unit: str = ''
    factor: float = 1.0


_ROWS: dict[str, tuple[_Row, ...]] = {
    'sim': (_Row(SESSION, 'session'), _Row(QUALITY, 'connection'), _Row(REASON, 'stop reason')),
    'planner': (
        _Row(TASK_STATE, 'state'),
        _Row(PROGRESS, 'progress', '%', 100.0),
        _Row(_SEGMENT, 'segment'),
        _Row(_ERROR, 'task error', 'mm', 1e3),
    ),
    'controller': (
        _Row(_LAW, 'law'),
        _Row(_JOINTS, 'joint positions', '°'),
        _Row(_TIP, 'tip', 'm'),
        _Row('controller/task_scaling', 'task scaling s', '%', 100.0),
        _Row(ACTIVE_LIMITS, 'limited by'),
        _Row('controller/joint_velocity_norm', 'joint velocity, norm', 'rad/s'),
        _Row('controller/joint_acceleration_norm', 'joint acceleration, norm', 'rad/s²'),
        _Row('controller/null_velocity_norm', 'null-space velocity, norm', 'rad/s'),
        _Row('controller/joint_torque_norm', 'joint torque, norm', 'Nm'),
        _Row('controller/min_singular_value', 'smallest singular value'),
    ),
}


class Watch(GraphMonitor):
    """Shows the newest value of every topic on its page."""

    def __init__(self, namespace: str = '') -> None:
        super().__init__('watch', namespace, _PATIENCE)
        self._arm: LiveArm | None = None
        self._is_known = True  # whether the arm is known here
        self.on_parameters = self._on_parameters

    def run(self, duration: float | None = None) -> None:
        """Show the page for that time [s], or until Ctrl-C; outside a terminal once a second."""
        until = time.monotonic() + duration if duration is not None else math.inf
        console = Console()
        live = Live(self._page(), console=console, refresh_per_second=_REFRESH)
        shows = live.update if console.is_terminal else console.print
        period = 1.0 / _REFRESH if console.is_terminal else _PRINT_EVERY
        with live if console.is_terminal else nullcontext():
            while rclpy.ok() and time.monotonic() < until:
                time.sleep(period)
                self._look()
                shows(self._page())

    def _page(self) -> RenderableType:
        return _page(self.live_values(), self.health(), self.context.get_domain_id())

    def _look(self) -> None:
        """Update the arm's state; identify the arm once its controller is there."""
        for topic, kind in _FOLLOWED.items():
            self.sampled(topic, kind)
        if self._arm is None and self._is_known and self.client.offers('controller'):
            try:
                values = self.client.parameters('controller')
                self.keep(_LAW, values['law'])
                self._arm = LiveArm(self, values)
            except RedresError:
                self._is_known = False  # the page shows the rest
        if self._arm is not None:
            before = self._arm.q
            # A snapshot has all figures: subscribing to each would cost the controller time.
            for figures in self._arm.look()[-1:]:
                for name in VALUES:
                    self.keep(f'controller/{name}', figures[name])
            if self._arm.q is not before:  # measured anew, if not by the controller
                x, _ = self._arm.model.tip(self._arm.q)
                self.keep(_TIP, '  '.join(f'{value:+.4f}' for value in x))
                self.keep(_JOINTS, ' '.join(f'{angle:+.1f}' for angle in np.degrees(self._arm.q)))

    def _on_parameters(self, node: str, values: dict[str, Any]) -> None:
        if node == 'controller' and 'law' in values:
            self.keep(_LAW, values['law'])


def _page(
    values: Mapping[str, Any], health: Mapping[str, NodeHealth], domain: int
) -> RenderableType:
    title = Text(f'redres watch, ROS domain {domain}', style='bold')
    if not values:
        text = (
            f'No node of redres_ros runs in domain {domain}.\n'
            'Start one, for example with `redres demo`, which prints its domain, or pass --domain.'
        )
        return Group(title, Text(text, style='yellow'))
    parts: list[RenderableType] = [title]
    if values.get(REASON):
        stop = f'The robot has stopped: {values[REASON]}\nThe service sim/reset clears it.'
        parts.append(Panel(Text(stop), style='bold red', expand=False))
    parts += [_node_panel(values, node, health[node]) for node in _ROWS]
    return Group(*parts)


def _node_panel(values: Mapping[str, Any], node: str, health: NodeHealth) -> Panel:
    table = Table(box=None, show_header=False, pad_edge=False)
    table.add_column(min_width=28)
    table.add_column(min_width=30)
    for row in _ROWS[node]:
        words = _words(values[row.topic], row) if row.topic in values else '-'
        table.add_row(row.label, Text(words))
    title = Text(f'{node}: {health.text}')
    style = _STYLES[health.is_well]
    return Panel(table, title=title, title_align='left', box=box.ROUNDED, style=style)


def _words(value: object, row: _Row) -> str:
    if isinstance(value, float):
        value = f'{value * row.factor:.4g}'
    return f'{str(value) or "none"} {row.unit}'.rstrip()
