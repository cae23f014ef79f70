"""The page of `redres watch`, from the messages received."""

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple

from rich import box
from rich.console import Group, RenderableType
from rich.panel import Panel
from rich.table import Table
from rich.text import Text

from redres_ros.graph.graph_monitor import STALE, LastValue, NodeHealth
from redres_ros.nodes.topics import PROGRESS, QUALITY, REASON, SESSION, TASK_STATE
from redres_ros.simulation.colours import LIMIT_COLOURS, OTHER_LIMIT

_BAR = 33  # letters of a joint's bar
_NEAR = 0.06  # of the range, from an end


@dataclass(frozen=True)
class Row:
    """A line of the page: topic, label, unit, factor; and whether it is in the line for a pipe."""

    topic: str
    label: str
    unit: str = ''
    factor: float = 1.0
    in_line: bool = False


NODES: dict[str, tuple[Row, ...]] = {
    'sim': (
        Row(SESSION, 'session', in_line=True),
        Row(QUALITY, 'connection'),
        Row(REASON, 'stop reason', in_line=True),
    ),
    'planner': (
        Row(TASK_STATE, 'state', in_line=True),
        Row(PROGRESS, 'progress', '%', 100.0, in_line=True),
        Row('planner/segment', 'segment'),
        Row('planner/task_error', 'task error', 'mm', 1e3, in_line=True),
    ),
    'controller': (
        Row('controller/law', 'law', in_line=True),
        Row('controller/tip_pose', 'tip', 'm'),
        Row('controller/task_scaling', 'task scaling s', '%', 100.0),
        Row('controller/active_limits', 'limited by', in_line=True),
        Row('controller/joint_velocity_norm', 'joint velocity, norm', 'rad/s', in_line=True),
        Row('controller/joint_acceleration_norm', 'joint acceleration, norm', 'rad/s²'),
        Row('controller/null_velocity_norm', 'null-space velocity, norm', 'rad/s'),
        Row('controller/joint_torque_norm', 'joint torque, norm', 'Nm'),
        Row('controller/min_singular_value', 'smallest singular value'),
    ),
}


class JointBar(NamedTuple):
    """A joint: where it is in its range, 0 to 1, and in [rad]; the limits that act on it."""

    name: str
    fraction: float
    position: float
    limits: tuple[str, ...]


def page(
    received: Mapping[str, LastValue], now: float, domain: int, joints: Sequence[JointBar] = ()
) -> RenderableType:
    """The whole page.

    Args:
        received: The newest of each topic; the NodeHealth of a node is under the node's name.
        now: The instant at which it is shown [s].
        domain: The ROS domain.
        joints: Those of the arm, as far as they are known.
    """
    title = Text(f'redres watch, ROS domain {domain}', style='bold')
    if not received:
        text = (
            f'No node of redres_ros runs in domain {domain}.\n'
            'Start one, for example with `redres demo`, which prints its domain, or pass --domain.'
        )
        return Group(title, Text(text, style='yellow'))
    bars = [_joints(joints)] if joints else []
    return Group(title, *_alarms(received, now), *_panels(received, now), *bars)


def line(received: Mapping[str, LastValue], now: float, domain: int) -> str:
    """The most important values of the page, in a line.

    Args:
        received: See page().
        now: The instant of printing [s].
        domain: The ROS domain.
    """
    if not received:
        return f'no node in domain {domain}'
    parts = []
    for node, rows in NODES.items():
        quiet = silence(received, node, now)
        rows_shown = [row for row in rows if row.in_line and row.topic in received]
        if quiet > STALE:
            parts.append(f'{node} {_absence(quiet)}')
        else:
            parts += [f'{row.label} {_words(received[row.topic].value, row)}' for row in rows_shown]
    return ', '.join(parts)


def is_near_an_end(fraction: float) -> bool:
    """Whether a joint at this fraction of its range, 0 to 1, is near its limits."""
    return min(fraction, 1.0 - fraction) < _NEAR


def silence(received: Mapping[str, LastValue], node: str, now: float) -> float:
    """Time since the last message of a node [s]; infinite if there was none.

    Args:
        received: The last message of each source.
        node: Its name.
        now: [s], on the clock of `received`.
    """
    sources = {node, *(row.topic for row in NODES[node])}
    return min(
        (now - received[source].at for source in sources & received.keys()), default=float('inf')
    )


def _alarms(received: Mapping[str, LastValue], now: float) -> Iterator[Panel]:
    """The alarms."""
    reason = received.get(REASON, LastValue('', now)).value
    if reason:
        text = Text(f'The robot has stopped: {reason}\nThe service sim/reset clears it.')
        yield Panel(text, style='bold red', expand=False)
    if all(silence(received, node, now) > STALE for node in NODES):
        last = min(silence(received, node, now) for node in NODES)
        text = Text(f'No node has sent a message for {last:.0f} s. The values below are old.')
        yield Panel(text, style='bold yellow', expand=False)


def _panels(received: Mapping[str, LastValue], now: float) -> Iterator[Panel]:
    for node, rows in NODES.items():
        quiet = silence(received, node, now)
        table = Table(box=None, show_header=False, pad_edge=False)
        table.add_column(min_width=28)
        table.add_column(min_width=30)
        for row in rows:
            table.add_row(row.label, _value(received, row, quiet > STALE, now))
        if quiet > STALE:
            title = f'{node}: {_absence(quiet)}'
            style = 'dim' if quiet == float('inf') else 'yellow'
        else:
            health = _health(received, node)
            title = f'{node}: {health.text}'
            style = 'green' if health.is_well else 'yellow'
        yield Panel(table, title=Text(title), title_align='left', box=box.ROUNDED, style=style)


def _absence(quiet: float) -> str:
    return 'no message' if quiet == float('inf') else f'silent for {quiet:.0f} s'


def _joints(joints: Sequence[JointBar]) -> Panel:
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
    bar = Text(_BAR * '─', style='dim')
    bar.plain = bar.plain[:place] + '●' + bar.plain[place + 1 :]
    colour = 'red' if is_near_an_end(fraction) else 'cyan'
    bar.stylize(f'not dim bold {colour}', place, place + 1)
    return bar


def _health(received: Mapping[str, LastValue], node: str) -> NodeHealth:
    """The node's last report; 'running' before the first."""
    value = received[node].value if node in received else None
    return value if isinstance(value, NodeHealth) else NodeHealth('running', True)


def _value(received: Mapping[str, LastValue], row: Row, is_stale: bool, now: float) -> Text:
    entry = received.get(row.topic)
    if entry is None:
        return Text('-', style='dim')
    text = _words(entry.value, row)
    if is_stale or (isinstance(entry.value, float) and now - entry.at > STALE):
        return Text(f'{text}  (old, {now - entry.at:.0f} s)', style='dim')
    return Text(text, style='default')


def _words(value: object, row: Row) -> str:
    """A value with its unit."""
    if isinstance(value, tuple):
        shown = '  '.join(f'{member:+.4f}' for member in value)
    elif isinstance(value, float):
        shown = f'{value * row.factor:.4g}'
    else:
        shown = str(value) or 'none'
    return f'{shown} {row.unit}'.rstrip()
