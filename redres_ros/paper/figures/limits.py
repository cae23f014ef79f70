"""Figures 17 and 18, not in the paper: the same laws within the limits of the joints."""

from collections.abc import Callable
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from redres_ros.paper.experiment import Experiment
from redres_ros.paper.runs import TORQUE_SCALE, Runs, title
from redres_ros.robot_model import RobotModel
from redres_ros.simulation.colours import law_colour
from redres_ros.simulation.drawing import legend_below, time_panels
from redres_ros.simulation.effort import acceleration_usage
from redres_ros.simulation.recording import Recording

_SIZE = (10.0, 7.4)  # [in]
_HEIGHTS = (2.0, 1.0, 1.0)  # of the panels
_LEAST = 1e-3  # of the logarithmic axis
_ALLOWED: dict[str, Any] = {'color': 'black', 'ls': ':', 'lw': 1.2}
_COLOURS = ('0.6', law_colour('minimum_velocity'))  # of the law without and with more limits


def figure_17(runs: Runs) -> Figure:
    """The run that stops the paper's robot, and the same with the limits of the joints on."""
    tried = {
        'no limits': runs['measured_2'],
        'position, velocity, acceleration': runs['within_limits'],
    }
    heading = f'{title(17, "measured_2")},\nwithout and within limits'
    figure, ax = _draw(heading, tried, lambda each: acceleration_usage(each, runs.experiment_model))
    ax.set_ylabel('largest acceleration\n[fraction of the limit]')
    ax.set_yscale('log')
    ax.set_ylim(bottom=_LEAST)
    ax.axhline(1.0, label='limit', **_ALLOWED)
    legend_below(figure.axes[-1], ax)
    return figure


def figure_18(runs: Runs) -> Figure:
    """Torque limits that are kept through a position interface."""
    tried = {
        'limits without torque': runs['within_limits'],
        f'and torque, {TORQUE_SCALE:g} of the torque limits': runs['within_torques'],
    }
    heading = f'{title(18, "within_torques")},\ntorque limits kept through a position interface'
    figure, ax = _draw(heading, tried, lambda each: torque_usage(each, runs.experiment_model))
    ax.set_ylabel('largest torque\n[fraction of the limit]')
    ax.set_ylim(bottom=0.0)
    ax.axhline(TORQUE_SCALE, label='allowed', **_ALLOWED)
    legend_below(figure.axes[-1], ax)
    return figure


def torque_usage(recording: Recording, model: RobotModel) -> np.ndarray:
    """Torque of Eq. (6) of the joint nearest to its limit, or beyond, as a fraction, (ticks,).

    Args:
        recording: Recording of commands.
        model: The arm, with its limits.
    """
    dq_prev = np.vstack((np.zeros(model.n), recording.vectors('dq1')[:-1]))  # (ticks, n)
    rows = zip(recording.vectors('q1'), dq_prev, recording.accelerations, strict=True)
    tau = np.array([model.torque(q, dq, ddq) for q, dq, ddq in rows])  # (ticks, n) [Nm]
    return np.abs(tau / model.tau_max).max(axis=1)


def _draw(
    heading: str, tried: dict[str, Experiment], usage: Callable[[Recording], np.ndarray]
) -> tuple[Figure, Axes]:
    """How much of a limit is used, in the panel that is returned; below it how fast the task goes
    on, and how far from its path the tip is.
    """
    figure, (limit, scaling, error) = time_panels(3, heading, _SIZE, _HEIGHTS)
    for (label, each), color in zip(tried.items(), _COLOURS, strict=True):
        recording = each.recording
        t = recording['t']
        limit.plot(t, usage(recording), color=color, lw=1.2, label=label)
        scaling.plot(t, recording['task_scaling'], color=color, lw=1.2)
        error.plot(t, 1e3 * recording['task_error'], color=color, lw=1.2)
        if each.stop_reason:
            limit.axvline(t[-1], color='tab:red', ls='--', label=f'stopped at {t[-1]:.2f} s')
    scaling.set_ylabel('task scaling $s$ [-]')
    error.set_ylabel('task error [mm]')
    return figure, limit
