"""The panel of the page: texts and bars as HTML, texts from the graph escaped, and live plots."""

from collections.abc import Mapping, Sequence
from html import escape

import numpy as np
import viser
from viser import uplot

from redres_ros.command import VALUES
from redres_ros.graph.monitor import NodeHealth
from redres_ros.nodes.controller_telemetry import Figures
from redres_ros.nodes.topics import MODE, QUALITY, REASON, SESSION, TASK_STATE
from redres_ros.planning.task_executor import UNDER_WAY
from redres_ros.robot_model import RobotModel
from redres_ros.simulation.colours import AXES, LIMIT_COLOURS, OTHER_LIMIT
from redres_ros.types import JointPositions

_HEIGHT = 92  # [pixels] of a plot
_STYLE = 'font: 13px/1.45 system-ui, sans-serif; padding: 2px 12px;'
_ALARM = 'background: #d62728; color: white; border-radius: 4px; padding: 6px 8px; margin: 4px 0;'
_DIM = 'color: #777;'
_CURVE = '#0072b2'
_TAG = 'color: white; border-radius: 3px; padding: 0 4px; font-size: 10px;'
_LONGEST = 400  # letters
_NEAR = 0.06  # of a joint's range, from an end
_UNDER_WAY = {each.value for each in UNDER_WAY}


def state_text(words: Mapping[str, str], health: Mapping[str, NodeHealth], progress: float) -> str:
    """Session, task, controller and any stop as HTML; words by topic, progress from 0 to 1."""
    lines = []
    if words[REASON]:
        reason = _escaped(words[REASON])
        lines.append(
            f'<div style="{_ALARM}"><b>Stopped:</b> {reason}<br>Reset lets it go on.</div>'
        )
    quality = words[QUALITY] and f'connection {words[QUALITY]}'
    done = f'{progress:.0%}' if words[TASK_STATE] in _UNDER_WAY else ''
    for name, topic, more in (
        ('Robot', SESSION, quality),
        ('Task', TASK_STATE, done),
        ('Controller', MODE, ''),
    ):
        word = _escaped(words[topic] or 'no message')
        lines.append(f'<div>{name}: <b>{word}</b> {_dim(more)}</div>')
    for node, report in health.items():
        lines.append(f'<div>{_dim(f"{node}: {report.text}")}</div>')
    return f'<div style="{_STYLE}">{"".join(lines)}</div>'


def joint_bars(model: RobotModel, q: JointPositions, limited: str) -> str:
    """A bar for each joint in its range as HTML, and the active limit, given as 'place: limit'."""
    place, _, limit = limited.rpartition(': ')
    fractions = (q - model.q_min) / (model.q_max - model.q_min)
    bars = dict(zip(model.joint_names, map(_bar, fractions.tolist()), strict=True))
    if place not in ('', *bars):
        bars[place] = ''
    tag = (
        f'<span style="background: {LIMIT_COLOURS.get(limit, OTHER_LIMIT)}; {_TAG}">'
        f'{escape(limit)}</span>'
    )
    rows = [
        f'<tr><td style="{_DIM} white-space: nowrap; padding-right: 8px;">{escape(name)}</td>'
        f'<td style="width: 45%;">{bar}</td>'
        f'<td style="padding-left: 8px; width: 40%;">{tag if name == place else ""}</td></tr>'
        for name, bar in bars.items()
    ]
    table = f'<table style="width: 100%; border-collapse: collapse;">{"".join(rows)}</table>'
    return f'<div style="{_STYLE}">{table}</div>'


def _bar(fraction: float) -> str:
    colour = '#d62728' if min(fraction, 1.0 - fraction) < _NEAR else '#1f77b4'
    return (
        f'<input type="range" inert min="0" max="1" step="any" value="{fraction:.3f}" '
        f'style="width: 100%; height: 12px; accent-color: {colour};">'
    )


def _escaped(text: str) -> str:
    """A text from the graph, escaped and of limited length."""
    return escape(text[:_LONGEST])


def _dim(text: str) -> str:
    return f'<span style="{_DIM}">{_escaped(text)}</span>'


class Plots:
    def __init__(self, gui: viser.GuiApi) -> None:
        self._handles = {}
        for figure in VALUES:
            title, least = AXES[figure]
            # Axes begin at zero and show at least so much.
            top = {'pad': 0.05, 'soft': least, 'mode': 1}
            bottom = {'hard': 0.0, 'soft': 0.0, 'mode': 1}
            self._handles[figure] = gui.add_uplot(
                (np.zeros(2), np.zeros(2)),
                ({'label': 't'}, {'label': figure, 'stroke': _CURVE, 'width': 1.5}),
                title=title,
                scales={
                    'x': uplot.Scale(time=False),
                    'y': uplot.Scale(range={'min': bottom, 'max': top}),
                },
                axes=({'show': False}, {'size': 44, 'font': '10px sans-serif'}),
                legend=uplot.Legend(show=False),
                height=_HEIGHT,
                padding=(8, 12, 4, 0),
            )

    def show(self, figures: Sequence[Figures]) -> None:
        """Draw figures over time, the newest one last."""
        seconds = np.array([each['time'] for each in figures]) - figures[-1]['time']
        for figure, handle in self._handles.items():
            handle.data = (seconds, np.array([each[figure] for each in figures]))
