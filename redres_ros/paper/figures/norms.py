"""Figures 4, 7, 10, 12, 15: norms over time."""

from collections.abc import Mapping

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from redres_ros.paper.experiment import Experiment
from redres_ros.paper.figures.runs import Runs
from redres_ros.paper.savgol import MeasuredMotion
from redres_ros.robot_model import RobotModel
from redres_ros.simulation.plots import NORMS, draw_norm
from redres_ros.simulation.recording import Recording
from redres_ros.waypoints import WaypointTask

Curves = Mapping[str, np.ndarray]  # norm -> its values over a motion's samples, (N,)


def figure_4(runs: Runs) -> Figure:
    """Law (23): acceleration, null-space part and velocity."""
    title = r'Figure 4. Simulation: least acceleration, law (23), $\lambda$ = 0.99, T = 1 ms'
    shown = 'joint_acceleration_norm', 'null_velocity_norm', 'joint_velocity_norm'
    return _simulation(title, runs.ideal_damped, shown, runs.task)


def figure_7(runs: Runs) -> Figure:
    """Law (35): torque and velocity."""
    shown = 'joint_torque_norm', 'joint_velocity_norm'
    return _simulation(
        'Figure 7. Simulation: least torque, law (35), T = 1 ms', runs.ideal_35, shown, runs.task
    )


def figure_10(runs: Runs) -> Figure:
    """Law (2): acceleration and velocity until the robot stops, and a little longer."""
    title = 'Figure 10. Experiment: least velocity, law (2), T = 2 ms'
    tried = runs.experiment_minimum_velocity
    return _experiment(title, tried, _kinematic(tried.motion), runs.task)


def figure_12(runs: Runs) -> Figure:
    """Law (23): acceleration and velocity."""
    title = (
        r'Figure 12. Experiment: least acceleration, law (23), '
        r'$k_d$ = 5 1/s ($\lambda$ = 0.99), T = 2 ms'
    )
    tried = runs.experiment_damped
    return _experiment(title, tried, _kinematic(tried.motion), runs.task)


def figure_15(runs: Runs) -> Figure:
    """Law (35): torque and velocity."""
    title = 'Figure 15. Experiment: least torque, law (35), points in reverse order, T = 2 ms'
    tried = runs.experiment_35
    tau = torque_norm(tried.motion, runs.experiment_model)
    dq = _norm(tried.motion.dq)
    return _experiment(
        title, tried, {'joint_torque_norm': tau, 'joint_velocity_norm': dq}, runs.reversed_task
    )


def torque_norm(motion: MeasuredMotion, model: RobotModel) -> np.ndarray:
    """Norm of M(q) ddq + n(q, dq), Eq. (6), along a measured motion, (N,) [Nm]."""
    states = (model.state(q, dq) for q, dq in zip(motion.q, motion.dq, strict=True))
    return np.array(
        [
            np.linalg.norm(state.M @ ddq + state.n)
            for state, ddq in zip(states, motion.ddq, strict=True)
        ]
    )


def _kinematic(motion: MeasuredMotion) -> Curves:
    return {'joint_acceleration_norm': _norm(motion.ddq), 'joint_velocity_norm': _norm(motion.dq)}


def _norm(vectors: np.ndarray) -> np.ndarray:
    return np.linalg.norm(vectors, axis=1)


def _simulation(
    title: str, recording: Recording, norms: tuple[str, ...], task: WaypointTask
) -> Figure:
    figure, panels = _panels(title, len(norms), task)
    for ax, norm in zip(panels, norms, strict=True):
        draw_norm(ax, norm, recording, {})
        ax.set_ylabel(NORMS[norm], fontsize='medium')
    return figure


def _experiment(title: str, tried: Experiment, curves: Curves, task: WaypointTask) -> Figure:
    """What was measured in front of what was commanded."""
    figure, panels = _panels(title, len(curves), task)
    recording = tried.recording
    for ax, (norm, values) in zip(panels, curves.items(), strict=True):
        ax.plot(recording['t'], recording[norm], color='0.65', lw=1.0, label='commanded')
        ax.plot(tried.motion.t, values, color='tab:blue', lw=1.6, label='measured (Savitzky-Golay)')
        if tried.stop_reason:
            ax.axvline(recording['t'][-1], color='tab:red', ls='--', lw=1.2, label='stopped')
        ax.set_ylabel(NORMS[norm])
        ax.set_ylim(bottom=0.0)
        ax.grid(alpha=0.3)
    panels[0].legend(loc='upper left')
    return figure


def _panels(title: str, count: int, task: WaypointTask) -> tuple[Figure, list[Axes]]:
    """Panels above each other with one time axis, and a mark where a segment ends."""
    figure = Figure(figsize=(10.0, 2.0 + 2.2 * count), layout='constrained')
    panels = list(np.atleast_1d(figure.subplots(count, 1, sharex=True)))
    panels[0].set_title(title)
    panels[-1].set_xlabel('time [s]')
    for ax in panels:
        ax.set_xmargin(0.0)
        for segment in range(1, task.segments):
            ax.axvline(segment * task.segment_time, color='0.8', lw=0.8, zorder=0)
    return figure, panels
