"""The live plots of a page, in the colour of the law in force."""

from collections import deque
from collections.abc import Sequence
from typing import Any

import numpy as np
import viser
from viser import uplot

from redres_ros.nodes.controller_telemetry import Figures
from redres_ros.simulation.colours import AXES, law_colour


class RingBuffer:
    """The newest values of a signal, each with its time.

    Args:
        span: How long they are kept [s].
    """

    def __init__(self, span: float) -> None:
        self._span = span
        self._kept: deque[tuple[float, Any]] = deque()

    def add(self, time: float, value: Any) -> None:
        """Append a value; a clock that went back clears the buffer.

        Args:
            time: [s].
            value: At that time.
        """
        if self._kept and time < self._kept[-1][0]:
            self._kept.clear()
        self._kept.append((time, value))
        while time - self._kept[0][0] > self._span:
            self._kept.popleft()

    def clear(self) -> None:
        """Remove all values."""
        self._kept.clear()

    @property
    def times(self) -> np.ndarray:
        """(N,) [s]."""
        return np.array([time for time, _ in self._kept])

    @property
    def values(self) -> list[Any]:
        """In their order."""
        return [value for _, value in self._kept]


_HEIGHT = 92  # [pixels]
_ZERO = np.zeros(2)


_FIGURES = Figures._fields[1:]  # all but the time


class Plots:
    """One small plot for each figure.

    Args:
        gui: Of viser.
        law: In force.
    """

    def __init__(self, gui: viser.GuiApi, law: str) -> None:
        self._handles = {}
        for figure in _FIGURES:
            self._handles[figure] = gui.add_uplot(
                (_ZERO, _ZERO),
                _series(figure, law),
                title=AXES[figure].title,
                scales=_scales(AXES[figure].least),
                axes=({'show': False}, {'size': 44, 'font': '10px sans-serif'}),
                legend=uplot.Legend(show=False),
                height=_HEIGHT,
                padding=(8, 12, 4, 0),
            )

    def set_law(self, law: str) -> None:
        """Go over to the colour of another law."""
        for figure, handle in self._handles.items():
            handle.series = _series(figure, law)

    def show(self, times: np.ndarray, figures: Sequence[Figures]) -> None:
        """Draw figures over time.

        Args:
            times: (N,) [s].
            figures: Over these times, (N,) each.
        """
        seconds = times - times[-1]
        for figure, handle in self._handles.items():
            handle.data = (seconds, np.array([getattr(each, figure) for each in figures]))


def _series(figure: str, law: str) -> tuple[uplot.Series, uplot.Series]:
    """The time, and a figure's curve in the colour of a law."""
    curve: uplot.Series = {'label': figure, 'stroke': law_colour(law), 'width': 1.5}
    return {'label': 't'}, curve


def _scales(least: float) -> dict[str, uplot.Scale]:
    """Axes that begin at zero and show at least so much."""
    top = {'pad': 0.05, 'soft': least, 'mode': 1}
    return {
        'x': uplot.Scale(time=False),
        'y': uplot.Scale(range={'min': {'hard': 0.0, 'soft': 0.0, 'mode': 1}, 'max': top}),
    }
