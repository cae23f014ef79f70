"""Figures 4, 7, 10, 12, 15: norms over time."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from redres_ros.paper.experiment import Experiment
from redres_ros.paper.figures.naming import law, title
from redres_ros.paper.figures.runs import (
    EXPERIMENT_DAMPING,
    EXPERIMENT_T,
    SIMULATION_DAMPING,
    SIMULATION_T,
    Runs,
)
from redres_ros.paper.savgol import FINER, WINDOW, MeasuredMotion
from redres_ros.planning.waypoints import WaypointTask
from redres_ros.robot_model import RobotModel
from redres_ros.simulation.plots import NORMS, draw_norm
from redres_ros.simulation.recording import Recording

Curves = Mapping[str, np.ndarray]  # norm -> its values over a motion's samples, (N,)

# P dq of a law of least acceleration is what it keeps of the last velocity, as the paper plots it.
_REMEMBERED = r'null-space part $\Vert\lambda P\dot q_{k-1}\Vert$ [rad/s]'
_MARGIN = 0.01  # of the time axis, so that a step at the start is seen


@dataclass(frozen=True)
class _Measured:
    """Curves of one filter, and how they are drawn."""

    motion: MeasuredMotion
    curves: Curves
    label: str
    color: str
    width: float


def figure_4(runs: Runs) -> Figure:
    """Law (23): acceleration, null-space part and velocity."""
    shown = {
        'joint_acceleration_norm': NORMS['joint_acceleration_norm'],
        'null_velocity_norm': _REMEMBERED,
        'joint_velocity_norm': NORMS['joint_velocity_norm'],
    }
    text = law('minimum_acceleration', '23', SIMULATION_T, SIMULATION_DAMPING)
    return _simulation(title(4, 'Simulation', text), runs.ideal_damped, shown, runs.task)


def figure_7(runs: Runs) -> Figure:
    """Law (35): torque and velocity."""
    shown = {norm: NORMS[norm] for norm in ('joint_torque_norm', 'joint_velocity_norm')}
    text = law('dynamically_consistent', '35', SIMULATION_T, 1.0 / SIMULATION_T)
    return _simulation(title(7, 'Simulation', text), runs.ideal_35, shown, runs.task)


def figure_10(runs: Runs) -> Figure:
    """Law (2): acceleration and velocity until the robot stops, and a little longer."""
    text = law('minimum_velocity', '2', EXPERIMENT_T)
    tried = runs.experiment_minimum_velocity
    return _experiment(title(10, 'Experiment', text), tried, _both_filters(tried), runs.task)


def figure_12(runs: Runs) -> Figure:
    """Law (23): acceleration and velocity."""
    text = law('minimum_acceleration', '23', EXPERIMENT_T, EXPERIMENT_DAMPING)
    tried = runs.experiment_damped
    return _experiment(title(12, 'Experiment', text), tried, _both_filters(tried), runs.task)


def figure_15(runs: Runs) -> Figure:
    """Law (35): torque and velocity."""
    text = law('dynamically_consistent', '35', EXPERIMENT_T, 1.0 / EXPERIMENT_T)
    tried = runs.experiment_35
    curves = {
        'joint_torque_norm': torque_norm(tried.motion, runs.experiment_model),
        'joint_velocity_norm': _norm(tried.motion.dq),
    }
    measured = _Measured(tried.motion, curves, 'measured', 'tab:blue', 1.6)
    heading = title(15, 'Experiment', f'{text}, reverse order')
    return _experiment(heading, tried, [measured], runs.reversed_task)


def torque_norm(motion: MeasuredMotion, model: RobotModel) -> np.ndarray:
    """Norm of M(q) ddq + n(q, dq), Eq. (6), along a measured motion, (N,) [Nm].

    Args:
        motion: As it was measured.
        model: Of the arm.
    """
    states = (model.state(q, dq) for q, dq in zip(motion.q, motion.dq, strict=True))
    return np.array(
        [
            np.linalg.norm(state.M @ ddq + state.n)
            for state, ddq in zip(states, motion.ddq, strict=True)
        ]
    )


def _both_filters(tried: Experiment) -> list[_Measured]:
    """The paper's filter, and a finer one that shows what the paper's smooths away."""
    T = tried.recording.T
    finer = tried.motion_through(FINER)
    fine = f'measured, window of {FINER * T:g} s'
    usual = f'measured, window of {WINDOW * T:g} s as in the paper'
    return [
        _Measured(finer, _kinematic(finer), fine, 'tab:orange', 1.0),
        _Measured(tried.motion, _kinematic(tried.motion), usual, 'tab:blue', 1.6),
    ]


def _kinematic(motion: MeasuredMotion) -> Curves:
    return {'joint_acceleration_norm': _norm(motion.ddq), 'joint_velocity_norm': _norm(motion.dq)}


def _norm(vectors: np.ndarray) -> np.ndarray:
    return np.linalg.norm(vectors, axis=1)


def _simulation(
    heading: str, recording: Recording, norms: Mapping[str, str], task: WaypointTask
) -> Figure:
    figure, panels = _panels(heading, len(norms), task)
    for ax, (norm, label) in zip(panels, norms.items(), strict=True):
        draw_norm(ax, norm, recording, {})
        ax.set_ylabel(label, fontsize='medium')
    return figure


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
        ax.grid(alpha=0.3)
    handles, labels = panels[0].get_legend_handles_labels()
    figure.legend(handles, labels, loc='outside lower center', ncols=2)
    return figure


def _panels(heading: str, count: int, task: WaypointTask) -> tuple[Figure, list[Axes]]:
    """Panels above each other with one time axis, and a mark where a segment ends."""
    figure = Figure(figsize=(10.0, 2.0 + 2.2 * count), layout='constrained')
    panels = list(np.atleast_1d(figure.subplots(count, 1, sharex=True)))
    panels[0].set_title(heading)
    panels[-1].set_xlabel('time [s]')
    for ax in panels:
        ax.set_xmargin(_MARGIN)
        for segment in range(1, task.segments):
            ax.axvline(segment * task.segment_time, color='0.8', lw=0.8, zorder=0)
    return figure, panels
