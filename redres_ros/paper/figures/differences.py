"""Figures 5, 8, 13, 16: how far the velocity laws (I) are from the schemes of second order (II)
that they come from.
"""

import numpy as np
from matplotlib.figure import Figure

from redres_ros.paper.experiment import Experiment
from redres_ros.paper.figures.runs import Runs
from redres_ros.paper.savgol import LEFT_OUT
from redres_ros.simulation.recording import Recording

_RANGE = 1e-17, 1e2  # of the axis [rad/s]: from below rounding to above any speed of the arm
_SCALE = r'$\Vert\dot q_{\mathrm{I}}\Vert$, for scale'
_DIFFERENCE = r'$\Vert\dot q_{\mathrm{I}}-\dot q_{\mathrm{II}}\Vert$'


def figure_5(runs: Runs) -> Figure:
    """Simulation: law (23) against scheme (22)."""
    title = (
        r'velocity law (23), $\lambda$ = 0.99, and acceleration scheme (22), '
        r'$k_d$ = 10 1/s, T = 1 ms'
    )
    return _simulations(f'Figure 5. Simulation: {title}', runs.ideal_damped, runs.ideal_22)


def figure_8(runs: Runs) -> Figure:
    """Simulation: law (35) against scheme (29)."""
    title = (
        'Figure 8. Simulation: velocity law (35) and torque scheme (29) with damping (34), T = 1 ms'
    )
    return _simulations(title, runs.ideal_35, runs.ideal_29)


def figure_13(runs: Runs) -> Figure:
    """Experiment: law (23) against scheme (22)."""
    title = (
        r'velocity law (23), $\lambda$ = 0.99, and acceleration scheme (22), '
        r'$k_d$ = 5 1/s, T = 2 ms'
    )
    return _experiments(
        f'Figure 13. Experiment: {title}', runs.experiment_damped_unblended, runs.experiment_22
    )


def figure_16(runs: Runs) -> Figure:
    """Experiment: law (35) against scheme (29)."""
    title = (
        'velocity law (35) and torque scheme (29) with damping (34), '
        'points in reverse order, T = 2 ms'
    )
    return _experiments(
        f'Figure 16. Experiment: {title}', runs.experiment_35_unblended, runs.experiment_29
    )


def difference(dq_I: np.ndarray, dq_II: np.ndarray) -> np.ndarray:
    """Norm of the difference, sample by sample as long as there are both, (N,) [rad/s]."""
    both = min(len(dq_I), len(dq_II))
    return np.linalg.norm(dq_I[:both] - dq_II[:both], axis=1)


def _simulations(title: str, law: Recording, scheme: Recording) -> Figure:
    dq_I = law.vectors('dq1')
    curves = {
        _SCALE: np.linalg.norm(dq_I, axis=1),
        _DIFFERENCE: difference(dq_I, scheme.vectors('dq1')),
    }
    return _draw(title, law['t'], curves)


def _experiments(title: str, law: Experiment, scheme: Experiment) -> Figure:
    """The measured velocities of both, and the commanded one of the law, which is what the paper's
    captions name.
    """
    dq_I = law.motion.dq
    dq_II = scheme.motion.dq
    return _draw(
        title,
        law.motion.t,
        {
            _SCALE: np.linalg.norm(dq_I, axis=1),
            f'{_DIFFERENCE}, I commanded, II measured': difference(
                law.recording.vectors('dq1')[LEFT_OUT:], dq_II
            ),
            f'{_DIFFERENCE}, both measured': difference(dq_I, dq_II),
        },
    )


def _draw(title: str, t: np.ndarray, curves: dict[str, np.ndarray]) -> Figure:
    """Curves in front of each other, each as long as it is, with gaps where it is exactly zero."""
    figure = Figure(figsize=(10.0, 4.8), layout='constrained')
    ax = figure.add_subplot(xmargin=0.0)
    for (label, values), color in zip(
        curves.items(), ('0.65', 'tab:blue', 'tab:orange'), strict=False
    ):
        ax.plot(
            t[: len(values)],
            np.where(values > 0.0, values, np.nan),
            label=label,
            color=color,
            lw=1.2,
        )
    ax.set(xlabel='time [s]', ylabel='joint velocity [rad/s]', yscale='log', ylim=_RANGE)
    ax.set_title(title, fontsize='medium')
    ax.grid(alpha=0.3)
    ax.legend(loc='center right')
    return figure
