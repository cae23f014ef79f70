"""Figures as files: pictures for the screen, or drawings for a column of a paper."""

import textwrap
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from matplotlib import rc_context
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.text import Text
from matplotlib.transforms import ScaledTranslation

from redres_ros.files.text import writing

_MARGIN = 0.01  # of a time axis, so that a step at either end is seen

DRAWINGS = ('.pdf', '.svg')  # written at the width of a column
COLUMN = 3.5  # [in] of a page in two columns
_COLUMN_RATIO = 1.6  # such a figure is so many times as high for its width
_COLUMN_TEXT = 7.0  # [pt]
_COLUMN_LINE = 0.7  # of the line width
_COLUMN_LETTERS = 64  # of a line of the title

_BELOW = 0.45  # [in] from the lowest panel to the legend, where its axis is labelled
_OF_ALL = 'legend of all panels'

NORMS = {
    'joint_acceleration_norm': r'acceleration $\Vert\ddot q\Vert$ [rad/s$^2$]',
    'joint_velocity_norm': r'velocity $\Vert\dot q\Vert$ [rad/s]',
    'null_velocity_norm': r'null-space part $\Vert P\dot q\Vert$ [rad/s]',
    'joint_torque_norm': r'torque $\Vert\tau\Vert$ [Nm]',
}

# What plain text writes, and how a picture shows it
_SYMBOLS = {'k_d': '$k_d$', '1/s': 's$^{-1}$', 'λ': r'$\lambda$'}


def save(figure: Figure, path: Path) -> None:
    """Write a figure as a picture for the screen, or as a .pdf or .svg as wide as a column of a
    paper. Its folder is made if it does not exist. Raises FileError.
    """
    if path.suffix in DRAWINGS:
        _fit_column(figure)
    # 42: TrueType, as publishers ask for. A ValueError says that no picture ends like that.
    with writing(path), rc_context({'pdf.fonttype': 42}):
        figure.savefig(path, dpi=130)


def time_panels(
    count: int, title: str, size: tuple[float, float], heights: Sequence[float] | None = None
) -> tuple[Figure, list[Axes]]:
    """A figure of some size [in] with panels above each other over one time axis."""
    figure = Figure(figsize=size, layout='constrained')
    panels = list(np.atleast_1d(figure.subplots(count, 1, sharex=True, height_ratios=heights)))
    panels[0].set_title(title)
    panels[-1].set_xlabel('time [s]')
    for ax in panels:
        ax.grid(alpha=0.3)
        ax.set_xmargin(_MARGIN)
    return figure, panels


def legend_below(ax: Axes, labelled: Axes, *, ncols: int = 2, fontsize: str | None = None) -> None:
    """A legend of a panel's labels below the lowest one, `ax`; the layout leaves space for it."""
    # 'outside lower center' of a figure is the same, but needs matplotlib 3.7.
    below = ax.transAxes + ScaledTranslation(0.0, -_BELOW, ax.figure.dpi_scale_trans)
    legend = ax.legend(
        *labelled.get_legend_handles_labels(),
        loc='upper center',
        bbox_to_anchor=(0.5, 0.0),
        bbox_transform=below,
        ncols=ncols,
        fontsize=fontsize,
    )
    legend.set_gid(_OF_ALL)


def in_symbols(text: str) -> str:
    """A law's label or a title as a picture shows it."""
    for plain, symbol in _SYMBOLS.items():
        text = text.replace(plain, symbol)
    return text


def _fit_column(figure: Figure) -> None:
    """Give a figure the width of a column, and texts and lines that suit it."""
    width, height = figure.get_size_inches()
    figure.set_size_inches(COLUMN, min(height, _COLUMN_RATIO * COLUMN * height / width))
    for line in figure.findobj(Line2D):
        line.set_linewidth(_COLUMN_LINE * line.get_linewidth())
    for ax in figure.axes:
        legend = ax.get_legend()
        if legend is not None and legend.get_gid() == _OF_ALL:
            names = {text.get_text() for text in legend.get_texts()}
            labelled = (each for each in figure.axes if names == set(_labels(each)))
            legend_below(ax, next(labelled), ncols=1)
        ax.tick_params(labelsize=_COLUMN_TEXT)
        ax.set_ylabel(_in_two_lines(ax.get_ylabel()))
        ax.set_title(textwrap.fill(ax.get_title(), _COLUMN_LETTERS))
    for title in figure.texts:
        title.set_text(textwrap.fill(title.get_text(), _COLUMN_LETTERS))
    for text in figure.findobj(Text):
        text.set_fontsize(_COLUMN_TEXT)
    figure.align_ylabels()


def _labels(ax: Axes) -> list[str]:
    """Labels of the curves of a panel."""
    return ax.get_legend_handles_labels()[1]


def _in_two_lines(label: str) -> str:
    """The label of an axis, with its unit on a line of its own."""
    return label if '\n' in label else label.replace(' [', '\n[')
