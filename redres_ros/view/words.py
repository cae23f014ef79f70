"""Texts and bars of the page as HTML. Texts from the graph are escaped."""

from collections.abc import Iterable, Mapping, Sequence
from html import escape

import numpy as np

from redres_ros.graph.graph_monitor import NODES
from redres_ros.graph.watch_page import is_near_an_end
from redres_ros.loop.limit_report import LimitReport
from redres_ros.nodes.topics import MODE, QUALITY, REASON, SESSION, TASK_STATE
from redres_ros.planning.task_executor import UNDER_WAY
from redres_ros.simulation.colours import LIMIT_COLOURS, OTHER_LIMIT

_STYLE = 'font: 13px/1.45 system-ui, sans-serif; padding: 2px 12px;'
_ALARM = 'background: #d62728; color: white; border-radius: 4px; padding: 6px 8px; margin: 4px 0;'
_DIM = 'color: #777;'
_TRACK = 'position: relative; height: 9px; background: #e8eaee; border-radius: 5px;'
_ALMOST_ALL = 0.995  # of a velocity
_SCALED = {'s': 'whole task s', 'translation': 'translation', 'rotation': 'rotation'}
_LONGEST = 400  # letters
_UNDER_WAY = {each.value for each in UNDER_WAY}


def state_text(words: Mapping[str, str], health: Mapping[str, str], progress: float) -> str:
    """Session, planner and controller as HTML, and why the robot has stopped, if it has.

    Args:
        words: The newest by topic.
        health: Of the nodes, by their names.
        progress: Of the goal, 0 to 1; shown while it is under way.
    """
    lines = []
    if words[REASON]:
        reason = _escaped(words[REASON])
        lines.append(
            f'<div style="{_ALARM}"><b>Stopped:</b> {reason}<br>Reset lets it go on.</div>'
        )
    session = _escaped(words[SESSION] or 'no message')
    quality = _escaped(words[QUALITY])
    lines.append(f'<div>Robot: <b>{session}</b> {_dim(quality and f"connection {quality}")}</div>')
    task = words[TASK_STATE]
    done = f'{progress:.0%}' if task in _UNDER_WAY else ''
    lines.append(f'<div>Task: <b>{_escaped(task or "no message")}</b> {_dim(done)}</div>')
    lines.append(f'<div>Controller: <b>{_escaped(words[MODE] or "no message")}</b></div>')
    for node in NODES:
        text = _escaped(health.get(node, 'no message'))
        lines.append(f'<div>{_dim(f"{node}: {text}")}</div>')
    return f'<div style="{_STYLE}">{"".join(lines)}</div>'


def limits_text(report: LimitReport) -> str:
    """What limits leave of the commanded velocity as HTML, and which way leads out of them."""
    scaling = report.scaling if report.limit else {}
    shown = {_SCALED[name]: min(max(scaling.get(name, 1.0), 0.0), 1.0) for name in _SCALED}
    rows = [
        _row(f'{name} {fraction:.0%}', _filled(fraction), ()) for name, fraction in shown.items()
    ]
    line = _dim('no limit acts')
    if report.limit:
        line = f'<b>{_escaped(report.limit)}</b>'
        if report.away:
            line += f'<br>leave it: move the tip along <b>{_escaped(report.away)}</b> of the base'
    return f'<div style="{_STYLE} min-height: 3em;">{line}</div>{_table(rows)}'


def joint_bars(
    names: Sequence[str], fractions: np.ndarray, acting: Mapping[str, Iterable[str]]
) -> str:
    """A bar for each joint as HTML, with the limits that act.

    Args:
        names: Of the joints.
        fractions: Where each is in its range, 0 to 1, (n,).
        acting: The limits that act on a joint, or on a pair of bodies, by its name.
    """
    rows = [
        _row(name, _bar(fraction), acting.get(name, ()))
        for name, fraction in zip(names, fractions.tolist(), strict=True)
    ]
    others = [place for place in acting if place not in names]
    rows.extend(_row(place, '', acting[place]) for place in sorted(others))
    return _table(rows)


def _table(rows: Iterable[str]) -> str:
    table = f'<table style="width: 100%; border-collapse: collapse;">{"".join(rows)}</table>'
    return f'<div style="{_STYLE}">{table}</div>'


def _row(place: str, bar: str, limits: Iterable[str]) -> str:
    tags = ' '.join(_tag(limit) for limit in sorted(limits))
    return (
        f'<tr><td style="{_DIM} white-space: nowrap; padding-right: 8px;">{escape(place)}</td>'
        f'<td style="width: 45%;">{bar}</td>'
        f'<td style="padding-left: 8px; width: 40%;">{tags}</td></tr>'
    )


def _bar(fraction: float) -> str:
    place = 100.0 * min(max(fraction, 0.0), 1.0)
    colour = '#d62728' if is_near_an_end(fraction) else '#1f77b4'
    knob = (
        f'<div style="position: absolute; left: calc({place:.1f}% - 5px); width: 10px; '
        f'height: 9px; border-radius: 5px; background: {colour};"></div>'
    )
    return f'<div style="{_TRACK}">{knob}</div>'


def _filled(fraction: float) -> str:
    colour = '#2ca02c' if fraction > _ALMOST_ALL else '#ff7f0e'
    full = (
        f'<div style="width: {100.0 * fraction:.1f}%; height: 9px; border-radius: 5px; '
        f'background: {colour};"></div>'
    )
    return f'<div style="{_TRACK}">{full}</div>'


def _tag(limit: str) -> str:
    colour = LIMIT_COLOURS.get(limit, OTHER_LIMIT)
    return (
        f'<span style="background: {colour}; color: white; border-radius: 3px; padding: 0 4px; '
        f'font-size: 10px;">{escape(limit)}</span>'
    )


def _escaped(text: str) -> str:
    """A text from the graph, escaped and of limited length."""
    return escape(text[:_LONGEST])


def _dim(text: str) -> str:
    return f'<span style="{_DIM}">{text}</span>'
