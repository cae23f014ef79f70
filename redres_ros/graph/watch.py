"""`redres watch`: the live state of the nodes in a terminal."""

import math
import time
from collections.abc import Mapping, Sequence
from contextlib import nullcontext
from typing import Any, NamedTuple

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
from redres_ros.graph.monitor import STALE, GraphMonitor, LastValue, LiveArm, NodeHealth
from redres_ros.nodes.topics import ACTIVE_LIMITS, PROGRESS, QUALITY, REASON, SESSION, TASK_STATE
from redres_ros.simulation.colours import LIMIT_COLOURS, OTHER_LIMIT

_REFRESH = 5.0  # [Hz]
_LINE_EVERY = 1.0  # [s]
_BAR = 33  # letters of a joint's bar
_NEAR = 0.06  # of the range, from an end

_LAW = 'controller/law'
_TIP = 'controller/tip_pose'
_SEGMENT = 'planner/segment'
_ERROR = 'planner/task_error'
_FOLLOWED = {ACTIVE_LIMITS: String, PROGRESS: Float64, _SEGMENT: Int32, _ERROR: Float64}


class _Row(NamedTuple):
    """A line of the page; `in_line`: also in the line for a pipe."""

    topic: str
    label: str
    unit: str = ''
    factor: float = 1.0
    in_line: bool = False


_ROWS: dict[str, tuple[_Row, ...]] = {
    'sim': (
        _Row(SESSION, 'session', in_line=True),
        _Row(QUALITY, 'connection'),
        _Row(REASON, 'stop reason', in_line=True),
    ),
    'planner': (
        _Row(TASK_STATE, 'state', in_line=True),
        _Row(PROGRESS, 'progress', '%', 100.0, in_line=True),
        _Row(_SEGMENT, 'segment'),
        _Row(_ERROR, 'task error', 'mm', 1e3, in_line=True),
    ),
    'controller': (
        _Row(_LAW, 'law', in_line=True),
        _Row(_TIP, 'tip', 'm'),
        _Row('controller/task_scaling', 'task scaling s', '%', 100.0),
        _Row(ACTIVE_LIMITS, 'limited by', in_line=True),
        _Row('controller/joint_velocity_norm', 'joint velocity, norm', 'rad/s', in_line=True),
        _Row('controller/joint_acceleration_norm', 'joint acceleration, norm', 'rad/s²'),
        _Row('controller/null_velocity_norm', 'null-space velocity, norm', 'rad/s'),
        _Row('controller/joint_torque_norm', 'joint torque, norm', 'Nm'),
        _Row('controller/min_singular_value', 'smallest singular value'),
    ),
}


class _JointBar(NamedTuple):
    """A joint: where it is in its range, 0 to 1, and in [rad]; the limits that act on it."""

    name: str
    fraction: float
    position: float
    limits: Sequence[str]


class Watch(GraphMonitor):
    """Keeps the newest value of every topic on the page, with its time."""

    def __init__(self, namespace: str = '') -> None:
        super().__init__('watch', namespace)
        self._arm: LiveArm | None = None
        self._is_known = True  # whether the arm is known here
        self.on_parameters = self._on_parameters

    def page(self) -> RenderableType:
        """The page as it is now."""
        domain = self.context.get_domain_id()
        return _page(dict(self.values), time.monotonic(), domain, self._joints())

    def line(self) -> str:
        """The most important values, in a line."""
        return _line(dict(self.values), time.monotonic(), self.context.get_domain_id())

    def look(self) -> None:
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
            self._look_at(self._arm)

    def _look_at(self, arm: LiveArm) -> None:
        before = arm.q
        # A snapshot has all figures: subscribing to each would cost the controller time.
        for figures in arm.look()[-1:]:
            for name in VALUES:
                self.keep(f'controller/{name}', getattr(figures, name))
        if arm.q is not before:  # measured anew, if not by the controller
            self.keep(_TIP, tuple(arm.model.tip(arm.q)[0].tolist()))

    def _joints(self) -> list[_JointBar]:
        arm = self._arm
        if arm is None:
            return []
        acting = self.limits()
        placed = zip(arm.model.joint_names, arm.fractions().tolist(), arm.q.tolist(), strict=True)
        return [
            _JointBar(name, fraction, q, sorted(acting.get(name, ())))
            for name, fraction, q in placed
        ]

    def _on_parameters(self, node: str, values: dict[str, Any]) -> None:
        if node == 'controller' and 'law' in values:
            self.keep(_LAW, values['law'])


def watch(node: Watch, duration: float | None = None) -> None:
    """Show the page for that time [s], or until Ctrl-C.

    In a pipe or a file, print a line a second, and the page once, at the end.
    """
    until = time.monotonic() + duration if duration is not None else math.inf
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


def _page(
    received: Mapping[str, LastValue], now: float, domain: int, joints: Sequence[_JointBar] = ()
) -> RenderableType:
    """The whole page at an instant [s]; the NodeHealth of a node is received under its name."""
    title = Text(f'redres watch, ROS domain {domain}', style='bold')
    if not received:
        text = (
            f'No node of redres_ros runs in domain {domain}.\n'
            'Start one, for example with `redres demo`, which prints its domain, or pass --domain.'
        )
        return Group(title, Text(text, style='yellow'))
    parts: list[RenderableType] = [title]
    if REASON in received and received[REASON].value:
        stop = f'The robot has stopped: {received[REASON].value}\nThe service sim/reset clears it.'
        parts.append(Panel(Text(stop), style='bold red', expand=False))
    parts += [_node_panel(received, node, now) for node in _ROWS]
    if joints:
        parts.append(_joint_panel(joints))
    return Group(*parts)


def _line(received: Mapping[str, LastValue], now: float, domain: int) -> str:
    """The most important values of the page at an instant [s], in a line."""
    if not received:
        return f'no node in domain {domain}'
    parts = []
    for node, rows in _ROWS.items():
        silence = _silence(received, node, now)
        if silence > STALE:
            parts.append(f'{node} {_absence(silence)}')
            continue
        shown = [row for row in rows if row.in_line and row.topic in received]
        parts += [f'{row.label} {_words(received[row.topic].value, row)}' for row in shown]
    return ', '.join(parts)


def is_near_an_end(fraction: float) -> bool:
    """Whether a joint at this fraction of its range, 0 to 1, is near its limits."""
    return min(fraction, 1.0 - fraction) < _NEAR


def _silence(received: Mapping[str, LastValue], node: str, now: float) -> float:
    """Time since the last message of a node [s]; infinite if there was none."""
    sources = {node, *(row.topic for row in _ROWS[node])} - {_TIP}  # known without the controller
    ages = [now - received[source].at for source in sources if source in received]
    return min(ages, default=math.inf)


def _absence(silence: float) -> str:
    return 'no message' if silence == math.inf else f'silent for {silence:.0f} s'


def _node_panel(received: Mapping[str, LastValue], node: str, now: float) -> Panel:
    table = Table(box=None, show_header=False, pad_edge=False)
    table.add_column(min_width=28)
    table.add_column(min_width=30)
    for row in _ROWS[node]:
        words = _words(received[row.topic].value, row) if row.topic in received else '-'
        table.add_row(row.label, Text(words))
    value = received[node].value if node in received else None
    health = value if isinstance(value, NodeHealth) else NodeHealth('running', True)
    text = health.text
    style = 'green' if health.is_well else 'yellow'
    silence = _silence(received, node, now)
    if silence > STALE:
        text = _absence(silence)
        style = 'dim'
    title = Text(f'{node}: {text}')
    return Panel(table, title=title, title_align='left', box=box.ROUNDED, style=style)


def _joint_panel(joints: Sequence[_JointBar]) -> Panel:
    """A bar for each joint, and beside it the limits that act."""
    table = Table(box=None, show_header=False, pad_edge=False)
    for joint in joints:
        tags = Text()
        for limit in joint.limits:
            tags.append(f' {limit} ', style=f'white on {LIMIT_COLOURS.get(limit, OTHER_LIMIT)}')
            tags.append(' ')
        degrees = f'{math.degrees(joint.position):+7.1f}°'
        table.add_row(joint.name, degrees, _bar(joint.fraction), tags)
    title = Text('joints in their ranges, and the limits that act')
    return Panel(table, title=title, title_align='left', box=box.ROUNDED)


def _bar(fraction: float) -> Text:
    place = round(min(max(fraction, 0.0), 1.0) * (_BAR - 1))
    colour = 'red' if is_near_an_end(fraction) else 'cyan'
    bar = Text(place * '─', style='dim')
    bar.append('●', style=f'not dim bold {colour}')
    return bar.append((_BAR - 1 - place) * '─')


def _words(value: object, row: _Row) -> str:
    """A value with its unit."""
    if isinstance(value, tuple):
        shown = '  '.join(f'{member:+.4f}' for member in value)
    elif isinstance(value, float):
        shown = f'{value * row.factor:.4g}'
    else:
        shown = str(value) or 'none'
    return f'{shown} {row.unit}'.rstrip()
