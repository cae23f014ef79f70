"""Figures 5, 8, 13, 16: how far the velocity laws (I) are from the schemes of second order (II)
that they come from.
"""

import numpy as np
from matplotlib.figure import Figure

from redres_ros.paper.equivalence import velocity_difference
from redres_ros.paper.runs import Runs, title
from redres_ros.simulation.drawing import legend_below

_ROUNDING = 1e-17, 1e2  # of the axis [rad/s]: from below rounding to above any speed of the arm
_MEASURED = 1e-5, 1e1  # [rad/s]: from below the noise
_SCALE = r'$\Vert\dot q_{\mathrm{I}}\Vert$, for scale'
_DIFFERENCE = r'$\Vert\dot q_{\mathrm{I}}-\dot q_{\mathrm{II}}\Vert$'


def draw_simulated(number: int, law: str, scheme: str, runs: Runs) -> Figure:
    """Two simulations, whose difference is rounding."""
    dq_I, dq_II = (runs[name].vectors('dq1') for name in (law, scheme))
    curves = {_SCALE: np.linalg.norm(dq_I, axis=1), _DIFFERENCE: velocity_difference(dq_I, dq_II)}
    return _draw(title(number, law, scheme), runs[law]['t'], curves, _ROUNDING)


def draw_measured(number: int, law: str, scheme: str, runs: Runs) -> Figure:
    """Two experiments: the paper's quantity, and what it consists of."""
    found = runs.difference(law, scheme)
    curves = {
        _SCALE: found.dq,
        f'{_DIFFERENCE}, I commanded, II measured, as in the paper': found.total,
        'of it, what the filter smooths away': found.filtered,
        'of it, servo, speed limit and encoders': found.servo,
        f'{_DIFFERENCE}, both measured': found.measured,
    }
    return _draw(title(number, law, scheme), found.t, curves, _MEASURED)


def _draw(
    heading: str, t: np.ndarray, curves: dict[str, np.ndarray], span: tuple[float, float]
) -> Figure:
    """Curves in front of each other, with gaps where they are exactly zero."""
    figure = Figure(figsize=(10.0, 5.2), layout='constrained')
    ax = figure.add_subplot(xmargin=0.01)
    colors = ('0.65', 'tab:blue', 'tab:green', 'tab:purple', 'tab:orange')
    for (label, values), color in zip(curves.items(), colors, strict=False):
        shown = np.where(values > 0.0, values, np.nan)
        ax.plot(t[: len(values)], shown, label=label, color=color, lw=1.2)
    ax.set(xlabel='time [s]', ylabel='joint velocity [rad/s]', yscale='log', ylim=span)
    ax.set_title(heading, fontsize='medium')
    ax.grid(alpha=0.3)
    legend_below(ax, ax)
    return figure
