"""Figures 5, 8, 13, 16: how far the velocity laws (I) are from the schemes of second order (II)
that they come from.
"""

import numpy as np
from matplotlib.figure import Figure

from redres_ros.paper.equivalence import velocity_difference
from redres_ros.paper.figures.naming import gain, title
from redres_ros.paper.figures.runs import (
    EXPERIMENT_DAMPING,
    EXPERIMENT_T,
    SIMULATION_DAMPING,
    SIMULATION_T,
    Runs,
)
from redres_ros.paper.velocity_difference import VelocityDifference
from redres_ros.simulation.recording import Recording

_ROUNDING = 1e-17, 1e2  # of the axis [rad/s]: from below rounding to above any speed of the arm
_MEASURED = 1e-5, 1e1  # [rad/s]: from below the noise
_SCALE = r'$\Vert\dot q_{\mathrm{I}}\Vert$, for scale'
_DIFFERENCE = r'$\Vert\dot q_{\mathrm{I}}-\dot q_{\mathrm{II}}\Vert$'
_PAIR_23 = 'minimum_acceleration (23) and scheme (22)'
_PAIR_35 = 'dynamically_consistent (35) and scheme (29) with (34)'


def figure_5(runs: Runs) -> Figure:
    """Simulation: law (23) against scheme (22)."""
    text = f'{_PAIR_23}{gain(SIMULATION_T, SIMULATION_DAMPING)}, T = 1 ms'
    return _simulations(title(5, 'Simulation', text), runs.ideal_damped, runs.ideal_22)


def figure_8(runs: Runs) -> Figure:
    """Simulation: law (35) against scheme (29)."""
    text = f'{_PAIR_35}{gain(SIMULATION_T, 1.0 / SIMULATION_T)}, T = 1 ms'
    return _simulations(title(8, 'Simulation', text), runs.ideal_35, runs.ideal_29)


def figure_13(runs: Runs) -> Figure:
    """Experiment: law (23) against scheme (22)."""
    text = f'{_PAIR_23}{gain(EXPERIMENT_T, EXPERIMENT_DAMPING)}, T = 2 ms'
    return _experiments(title(13, 'Experiments', text), runs.difference_23)


def figure_16(runs: Runs) -> Figure:
    """Experiment: law (35) against scheme (29)."""
    text = f'{_PAIR_35}{gain(EXPERIMENT_T, 1.0 / EXPERIMENT_T)},\npoints in reverse order, T = 2 ms'
    return _experiments(title(16, 'Experiments', text), runs.difference_35)


def _simulations(heading: str, law: Recording, scheme: Recording) -> Figure:
    dq_I = law.vectors('dq1')
    curves = {
        _SCALE: np.linalg.norm(dq_I, axis=1),
        _DIFFERENCE: velocity_difference(dq_I, scheme.vectors('dq1')),
    }
    return _draw(heading, law['t'], curves, _ROUNDING)


def _experiments(heading: str, apart: VelocityDifference) -> Figure:
    """The paper's quantity, and what it consists of."""
    curves = {
        _SCALE: apart.dq,
        f'{_DIFFERENCE}, I commanded, II measured, as in the paper': apart.total,
        'of it, what the filter smooths away': apart.filtered,
        'of it, servo, speed limit and encoders': apart.servo,
        f'{_DIFFERENCE}, both measured': apart.measured,
    }
    return _draw(heading, apart.t, curves, _MEASURED)


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
    figure.legend(loc='outside lower center', ncols=2)
    return figure
