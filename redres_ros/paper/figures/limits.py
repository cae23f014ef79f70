"""Figures 17 and 18, not in the paper: the same laws within the limits of the joints."""

from collections.abc import Callable

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
_COLOURS = ('0.6', law_colour('minimum_velocity'))  # of the law without and with more limits


def figure_17(runs: Runs) -> Figure:
    """The run that stops the paper's robot, and the same with the limits of the joints on."""
    tried = {
        'no limits': runs['measured_2'],
        'position, velocity, acceleration': runs['within_limits'],
    }
    heading = f'{title(17, "measured_2")},\nwithout and within limits'
    figure, panels = time_panels(3, heading, _SIZE, _HEIGHTS)
    _draw_usage(panels[0], tried, lambda each: acceleration_usage(each, runs.experiment_model))
    panels[0].set_ylabel('largest acceleration\n[fraction of the limit]')
    panels[0].set_yscale('log')
    panels[0].set_ylim(bottom=_LEAST)
    _draw_limit(panels[0], 1.0, 'limit')
    _draw_rest(panels, tried)
    legend_below(panels[-1], panels[0])
    return figure


def figure_18(runs: Runs) -> Figure:
    """Torque limits that are kept through a position interface."""
    tried = {
        'limits without torque': runs['within_limits'],
        f'and torque, {TORQUE_SCALE:g} of the torque limits': runs['within_torques'],
    }
    heading = f'{title(18, "within_torques")},\ntorque limits kept through a position interface'
    figure, panels = time_panels(3, heading, _SIZE, _HEIGHTS)
    _draw_usage(panels[0], tried, lambda each: torque_usage(each, runs.experiment_model))
    panels[0].set_ylabel('largest torque\n[fraction of the limit]')
    panels[0].set_ylim(bottom=0.0)
    _draw_limit(panels[0], TORQUE_SCALE, 'allowed')
    _draw_rest(panels, tried)
    legend_below(panels[-1], panels[0])
    return figure


def torque_usage(recording: Recording, model: RobotModel) -> np.ndarray:
    """Torque of Eq. (6) of the joint nearest to its limit, or beyond, as a fraction, (ticks,).

    Args:
        recording: Of commands.
        model: The arm, with its limits.
    """
    dq_prev = np.vstack((np.zeros(model.n), recording.vectors('dq1')[:-1]))  # (ticks, n)
    rows = zip(recording.vectors('q1'), dq_prev, recording.accelerations, strict=True)
    tau = np.array([model.torque(q, dq, ddq) for q, dq, ddq in rows])  # (ticks, n) [Nm]
    return np.abs(tau / model.tau_max).max(axis=1)


def _draw_usage(
    ax: Axes, tried: dict[str, Experiment], usage: Callable[[Recording], np.ndarray]
) -> None:
    for (label, each), color in zip(tried.items(), _COLOURS, strict=True):
        recording = each.recording
        ax.plot(recording['t'], usage(recording), color=color, lw=1.2, label=label)
        if each.stop_reason:
            end = recording['t'][-1]
            ax.axvline(end, color='tab:red', ls='--', lw=1.2, label=f'stopped at {end:.2f} s')


def _draw_limit(ax: Axes, usage: float, name: str) -> None:
    ax.axhline(usage, color='black', ls=':', lw=1.2, label=name)


def _draw_rest(panels: list[Axes], tried: dict[str, Experiment]) -> None:
    """How fast the task goes on, and how far from its path the tip is."""
    _, scaling, error = panels
    for each, color in zip(tried.values(), _COLOURS, strict=True):
        recording = each.recording
        scaling.plot(recording['t'], recording['task_scaling'], color=color, lw=1.2)
        error.plot(recording['t'], 1e3 * recording['task_error'], color=color, lw=1.2)
    scaling.set_ylabel('task scaling $s$ [-]')
    error.set_ylabel('task error [mm]')
