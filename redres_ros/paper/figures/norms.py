"""Figures 4, 7, 10, 12, 15: norms over time."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from redres_ros.command import norms
from redres_ros.paper.experiment import FINER, WINDOW, Experiment, MeasuredMotion
from redres_ros.paper.runs import MOTIONS, Runs, title
from redres_ros.planning.waypoints import WaypointTask
from redres_ros.robot_model import RobotModel
from redres_ros.simulation.colours import law_colour
from redres_ros.simulation.drawing import NORMS, legend_below, time_panels
from redres_ros.simulation.plots import Remarks, draw_norm

Curves = Mapping[str, np.ndarray]  # norm -> its values over a motion's samples, (N,)

# P dq of a law of least acceleration is what it keeps of the last velocity, as the paper plots it.
_LABELS = {
    **NORMS,
    'null_velocity_norm': r'null-space part $\Vert\lambda P\dot q_{k-1}\Vert$ [rad/s]',
}


@dataclass(frozen=True)
class _Measured:
    """Curves of one filter, and how they are drawn."""

    motion: MeasuredMotion
    curves: Curves
    label: str
    color: str
    width: float


def draw_simulated(number: int, name: str, columns: Sequence[str], runs: Runs) -> Figure:
    """Norms of a simulation."""
    figure, panels = _panels(title(number, name), len(columns), runs.task)
    for ax, norm in zip(panels, columns, strict=True):
        draw_norm(ax, norm, runs[name], Remarks({}, law=MOTIONS[name].law))
        ax.set_ylabel(_LABELS[norm], fontsize='medium')
    return figure


def draw_accelerations(number: int, name: str, runs: Runs) -> Figure:
    """Acceleration and velocity of an experiment, through the paper's filter and a finer one that
    shows what the paper's smooths away.
    """
    tried = runs[name]
    colour = law_colour(MOTIONS[name].law)
    T = tried.recording.T
    finer = tried.motion_through(FINER)
    fine = f'measured, window of {FINER * T:g} s'
    usual = f'measured, window of {WINDOW * T:g} s as in the paper'
    measured = [
        _Measured(finer, _kinematic(finer), fine, 'black', 0.8),
        _Measured(tried.motion, _kinematic(tried.motion), usual, colour, 1.8),
    ]
    return _experiment(title(number, name), tried, measured, runs.task)


def draw_torques(number: int, name: str, runs: Runs) -> Figure:
    """Torque and velocity of an experiment."""
    tried = runs[name]
    curves = {
        'joint_torque_norm': torque_norm(tried.motion, runs.experiment_model),
        'joint_velocity_norm': norms(tried.motion.dq),
    }
    colour = law_colour(MOTIONS[name].law)
    measured = _Measured(tried.motion, curves, 'measured', colour, 1.6)
    return _experiment(title(number, name), tried, [measured], runs.task)


def torque_norm(motion: MeasuredMotion, model: RobotModel) -> np.ndarray:
    """Norm of M(q) ddq + n(q, dq), Eq. (6), along a measured motion, (N,) [Nm]."""
    rows = zip(motion.q, motion.dq, motion.ddq, strict=True)
    return norms(np.array([model.torque(q, dq, ddq) for q, dq, ddq in rows]))


def _kinematic(motion: MeasuredMotion) -> Curves:
    return {'joint_acceleration_norm': norms(motion.ddq), 'joint_velocity_norm': norms(motion.dq)}


def _experiment(
    heading: str, tried: Experiment, measured: list[_Measured], task: WaypointTask
) -> Figure:
    """What was measured in front of what was commanded."""
    figure, panels = _panels(heading, len(measured[0].curves), task)
    recording = tried.recording
    for ax, norm in zip(panels, measured[0].curves, strict=True):
        ax.plot(recording['t'], recording[norm], color='0.6', lw=1.0, label='commanded')
        for each in measured:
            t = each.motion.t
            ax.plot(t, each.curves[norm], color=each.color, lw=each.width, label=each.label)
        if tried.stop_reason:
            end = recording['t'][-1]
            ax.axvline(end, color='tab:red', ls='--', lw=1.2, label=f'stopped at {end:.2f} s')
        ax.set_ylabel(NORMS[norm])
        ax.set_ylim(bottom=0.0)
    legend_below(panels[-1], panels[0])
    return figure


def _panels(heading: str, count: int, task: WaypointTask) -> tuple[Figure, list[Axes]]:
    """Panels above each other with one time axis, and a mark where a segment ends."""
    figure, panels = time_panels(count, heading, (10.0, 2.0 + 2.2 * count))
    for ax in panels:
        for segment in range(1, task.segments):
            ax.axvline(segment * task.segment_time, color='0.8', lw=0.8, zorder=0)
    return figure, panels
