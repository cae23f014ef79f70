"""The panel of the page: texts and bars as HTML, texts from the graph escaped, and live plots."""

from collections.abc import Iterable, Mapping, Sequence
from html import escape

import numpy as np
import viser
from viser import uplot

from redres_ros.graph.monitor import NODES
from redres_ros.graph.watch import is_near_an_end
from redres_ros.nodes.controller_telemetry import Figures
from redres_ros.nodes.topics import MODE, QUALITY, REASON, SESSION, TASK_STATE
from redres_ros.planning.task_executor import UNDER_WAY
from redres_ros.simulation.colours import AXES, LIMIT_COLOURS, OTHER_LIMIT, law_colour

_FIGURES = Figures._fields[1:]  # all but the time
_HEIGHT = 92  # [pixels] of a plot
_STYLE = 'font: 13px/1.45 system-ui, sans-serif; padding: 2px 12px;'
_ALARM = 'background: #d62728; color: white; border-radius: 4px; padding: 6px 8px; margin: 4px 0;'
_DIM = 'color: #777;'
_TRACK = 'position: relative; height: 9px; background: #e8eaee; border-radius: 5px;'
_TAG = 'color: white; border-radius: 3px; padding: 0 4px; font-size: 10px;'
_LONGEST = 400  # letters
_UNDER_WAY = {each.value for each in UNDER_WAY}


def state_text(words: Mapping[str, str], health: Mapping[str, str], progress: float) -> str:
    """Session, planner and controller as HTML, and why the robot has stopped, if it has; words by
    topic, and the progress of a goal, 0 to 1, while it is under way.
    """
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
    for node in NODES:
        text = health.get(node, 'no message')
        lines.append(f'<div>{_dim(f"{node}: {text}")}</div>')
    return f'<div style="{_STYLE}">{"".join(lines)}</div>'


def joint_bars(
    names: Sequence[str], fractions: np.ndarray, acting: Mapping[str, Iterable[str]]
) -> str:
    """A bar for each joint as HTML, with the limits that act on it or on a pair of bodies. The
    fractions (n,) are of the joints' ranges, 0 to 1.
    """
    bars = dict(zip(names, map(_bar, fractions.tolist()), strict=True))
    places = dict.fromkeys([*names, *sorted(acting)])
    rows = [_row(place, bars.get(place, ''), acting.get(place, ())) for place in places]
    table = f'<table style="width: 100%; border-collapse: collapse;">{"".join(rows)}</table>'
    return f'<div style="{_STYLE}">{table}</div>'


def _row(place: str, bar: str, limits: Iterable[str]) -> str:
    tags = ' '.join(
        f'<span style="background: {LIMIT_COLOURS.get(limit, OTHER_LIMIT)}; {_TAG}">'
        f'{escape(limit)}</span>'
        for limit in sorted(limits)
    )
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


def _escaped(text: str) -> str:
    """A text from the graph, escaped and of limited length."""
    return escape(text[:_LONGEST])


def _dim(text: str) -> str:
    return f'<span style="{_DIM}">{_escaped(text)}</span>'


class Plots:
    """One small plot for each figure."""

    def __init__(self, gui: viser.GuiApi, law: str) -> None:
        self._handles = {}
        for figure in _FIGURES:
            # Axes begin at zero and show at least so much.
            top = {'pad': 0.05, 'soft': AXES[figure].least, 'mode': 1}
            bottom = {'hard': 0.0, 'soft': 0.0, 'mode': 1}
            self._handles[figure] = gui.add_uplot(
                (np.zeros(2), np.zeros(2)),
                _series(figure, law),
                title=AXES[figure].title,
                scales={
                    'x': uplot.Scale(time=False),
                    'y': uplot.Scale(range={'min': bottom, 'max': top}),
                },
                axes=({'show': False}, {'size': 44, 'font': '10px sans-serif'}),
                legend=uplot.Legend(show=False),
                height=_HEIGHT,
                padding=(8, 12, 4, 0),
            )

    def set_law(self, law: str) -> None:
        """Go over to the colour of another law."""
        for figure, handle in self._handles.items():
            handle.series = _series(figure, law)

    def show(self, figures: Sequence[Figures]) -> None:
        """Draw figures over time, the newest one last."""
        seconds = np.array([each.time for each in figures]) - figures[-1].time
        for figure, handle in self._handles.items():
            handle.data = (seconds, np.array([getattr(each, figure) for each in figures]))


def _series(figure: str, law: str) -> tuple[uplot.Series, uplot.Series]:
    """The time, and a figure's curve in the colour of a law."""
    curve: uplot.Series = {'label': figure, 'stroke': law_colour(law), 'width': 1.5}
    return {'label': 't'}, curve
