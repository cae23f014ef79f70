"""The paper's figures of motions by number, computed again."""

from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure, SubFigure
from matplotlib.ticker import MaxNLocator

from redres_ros.command import norms
from redres_ros.geometry import from_roll_pitch_yaw
from redres_ros.paper.experiment import (
    FINER,
    WINDOW,
    Experiment,
    MeasuredMotion,
    VelocityDifference,
    velocity_difference,
)
from redres_ros.paper.runs import MOTIONS, Runs, title
from redres_ros.planning.waypoints import WaypointTask
from redres_ros.robot_model import RobotModel
from redres_ros.simulation.batch import in_parallel
from redres_ros.simulation.colours import law_colour
from redres_ros.simulation.plots import (
    NORMS,
    draw_norm,
    draw_paths,
    legend_below,
    save,
    time_panels,
)
from redres_ros.simulation.recording import Recording

_PICTURES = (2, 3)  # rows and columns of pictures, evenly spaced in time
_ELEVATION = 14.0  # [deg] of the camera
_AZIMUTH = -152.0  # [deg]
_ROUNDING = 1e-17, 1e2  # of the axis [rad/s]: from below rounding to above any speed of the arm
_MEASURED = 1e-5, 1e1  # [rad/s]: from below the noise
_SCALE = r'$\Vert\dot q_{\mathrm{I}}\Vert$, for scale'
_DIFFERENCE = r'$\Vert\dot q_{\mathrm{I}}-\dot q_{\mathrm{II}}\Vert$'
# P dq of a law of least acceleration is what it keeps of the last velocity, as the paper plots it.
_LABELS = {
    **NORMS,
    'null_velocity_norm': r'null-space part $\Vert\lambda P\dot q_{k-1}\Vert$ [rad/s]',
}
_ACCELERATION = ('joint_acceleration_norm', 'null_velocity_norm', 'joint_velocity_norm')
_MEASURED_NORMS = ('joint_acceleration_norm', 'joint_velocity_norm')
_TORQUE = ('joint_torque_norm', 'joint_velocity_norm')


# --- the paths of tip and elbow, and pictures of the arm -----------------------------------------


def _draw_motion(number: int, name: str, runs: Runs) -> Figure:
    """The motion of one run."""
    recording = runs[name]
    model = runs.experiment_model if isinstance(recording, Experiment) else runs.model
    figure = Figure(figsize=(13.0, 7.0), layout='constrained')
    ending = recording.ending.replace('rad/s^2', 'rad/s²')
    figure.suptitle(f'{title(number, name)}\n{ending}')
    left, right = np.asarray(figure.subfigures(1, 2, width_ratios=(1.0, 1.35)))
    ax = left.add_subplot(projection='3d')
    task = MOTIONS[name].task(runs)
    draw_paths(ax, recording, model, task)
    ax.view_init(elev=_ELEVATION, azim=_AZIMUTH)
    for axis in (ax.xaxis, ax.yaxis):
        axis.set_major_locator(MaxNLocator(2))
    ax.legend(loc='lower center', bbox_to_anchor=(0.5, -0.09), ncols=2)
    ax.set_title('(a) path of the tip (black) and of the elbow (blue)')
    _draw_pictures(right, recording, model, task)
    return figure


def _draw_pictures(
    place: SubFigure, recording: Recording, model: RobotModel, task: WaypointTask
) -> None:
    """(b): the links of the arm along its path, with the path of the tip up to there."""
    rows, columns = _PICTURES
    ticks = np.linspace(0, len(recording.data) - 1, rows * columns).round().astype(int)
    place.suptitle('(b) the arm on its path', fontsize='large')
    for ax, tick in zip(place.subplots(rows, columns).flat, ticks, strict=True):
        links = _links(model, recording.vectors('q1')[tick])
        ax.plot(*_as_seen(task.waypoints), 'o', color='tab:red', ms=5.0)
        ax.plot(*_as_seen(recording.vectors('x')[: tick + 1]), color='black', lw=1.5)
        ax.plot(
            *_as_seen(links[:-1]), 'o-', color='tab:orange', mfc='0.7', mec='0.5', lw=6.0, ms=9.0
        )
        ax.plot(*_as_seen(links[-2:]), color='tab:purple', lw=3.0)
        ax.set_title(f't = {recording["t"][tick]:.2f} s', fontsize='medium')
        ax.set(xlim=(-0.8, 0.8), ylim=(-0.3, 1.4), aspect='equal')
        ax.set_axis_off()


def _as_seen(points: np.ndarray) -> np.ndarray:
    """Points (N, 3) [m] as the camera sees them, to the right and upwards, (2, N)."""
    camera = from_roll_pitch_yaw(np.radians((0.0, -_ELEVATION, _AZIMUTH)))  # back, right, up
    return camera.T[1:] @ points.T


def _links(model: RobotModel, q: np.ndarray) -> np.ndarray:
    """Positions of the joints from the base on, and of the tip, (n + 2, 3) [m]."""
    joints = [model.position(q, f'link_{number}') for number in range(1, model.n + 1)]
    return np.array([np.zeros(3), *joints, model.tip(q)[0]])


# --- norms over time -----------------------------------------------------------------------------


def _draw_norms(number: int, name: str, columns: Sequence[str], runs: Runs) -> Figure:
    """Norms of a simulation."""
    figure, panels = _panels(title(number, name), len(columns), runs.task)
    for ax, norm in zip(panels, columns, strict=True):
        draw_norm(ax, norm, runs[name], MOTIONS[name].law)
        ax.set_ylabel(_LABELS[norm], fontsize='medium')
    return figure


def _draw_measured_norms(
    number: int, name: str, columns: Sequence[str], windows: Sequence[int], runs: Runs
) -> Figure:
    """Norms of an experiment: measured, through filters of some windows, and commanded."""
    tried = runs[name]
    figure, panels = _panels(title(number, name), len(columns), runs.task)
    styles: dict[int, dict[str, Any]] = {
        FINER: {'color': 'black', 'lw': 0.8},
        WINDOW: {'color': law_colour(MOTIONS[name].law), 'lw': 1.8},
    }
    for ax, norm in zip(panels, columns, strict=True):
        ax.plot(tried['t'], tried[norm], color='0.6', lw=1.0, label='commanded')
        for window in windows:
            motion = tried.motion(window)
            values = _norm(norm, motion, runs.experiment_model)
            label = f'measured, window of {window * tried.T:g} s'
            ax.plot(motion.t, values, label=label, **styles[window])
        if tried.stop_reason:
            end = tried['t'][-1]
            ax.axvline(end, color='tab:red', ls='--', lw=1.2, label=f'stopped at {end:.2f} s')
        ax.set_ylabel(NORMS[norm])
        ax.set_ylim(bottom=0.0)
    legend_below(panels[-1], panels[0])
    return figure


def _norm(name: str, motion: MeasuredMotion, model: RobotModel) -> np.ndarray:
    """One of NORMS along a measured motion, (N,); that of M(q) ddq + n(q, dq), Eq. (6), too."""
    if name == 'joint_torque_norm':
        rows = zip(motion.q, motion.dq, motion.ddq, strict=True)
        return norms([model.torque(q, dq, ddq) for q, dq, ddq in rows])
    return norms(motion.dq if name == 'joint_velocity_norm' else motion.ddq)


def _panels(heading: str, count: int, task: WaypointTask) -> tuple[Figure, list[Axes]]:
    """Panels above each other with one time axis, and a mark where a segment ends."""
    figure, panels = time_panels(count, heading, (10.0, 2.0 + 2.2 * count))
    for ax in panels:
        for segment in range(1, task.segments):
            ax.axvline(segment * task.segment_time, color='0.8', lw=0.8, zorder=0)
    return figure, panels


# --- laws (I) beside the schemes of second order (II) that they come from ------------------------


def _draw_simulated_difference(number: int, law: str, scheme: str, runs: Runs) -> Figure:
    """Two simulations, whose difference is rounding."""
    curves = {
        _SCALE: norms(runs[law].vectors('dq1')),
        _DIFFERENCE: velocity_difference(runs[law], runs[scheme]),
    }
    return _draw_difference(title(number, law, scheme), runs[law]['t'], curves, _ROUNDING)


def _draw_measured_difference(number: int, law: str, scheme: str, runs: Runs) -> Figure:
    """Two experiments: the paper's quantity, and what it consists of."""
    found = VelocityDifference.between(runs[law], runs[scheme])
    curves = {
        _SCALE: found.dq,
        f'{_DIFFERENCE}, I commanded, II measured, as in the paper': found.total,
        'of it, what the filter smooths away': found.filtered,
        'of it, servo, speed limit and encoders': found.servo,
        f'{_DIFFERENCE}, both measured': found.measured,
    }
    return _draw_difference(title(number, law, scheme), found.t, curves, _MEASURED)


def _draw_difference(
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


FIGURES: dict[int, Callable[[Runs], Figure]] = {
    3: partial(_draw_motion, 3, 'simulated_23'),
    4: partial(_draw_norms, 4, 'simulated_23', _ACCELERATION),
    5: partial(_draw_simulated_difference, 5, 'simulated_23', 'simulated_22'),
    6: partial(_draw_motion, 6, 'simulated_35'),
    7: partial(_draw_norms, 7, 'simulated_35', _TORQUE),
    8: partial(_draw_simulated_difference, 8, 'simulated_35', 'simulated_29'),
    9: partial(_draw_motion, 9, 'measured_2'),
    10: partial(_draw_measured_norms, 10, 'measured_2', _MEASURED_NORMS, (FINER, WINDOW)),
    11: partial(_draw_motion, 11, 'measured_23'),
    12: partial(_draw_measured_norms, 12, 'measured_23', _MEASURED_NORMS, (FINER, WINDOW)),
    13: partial(_draw_measured_difference, 13, 'measured_23_at_once', 'measured_22'),
    14: partial(_draw_motion, 14, 'measured_35'),
    15: partial(_draw_measured_norms, 15, 'measured_35', _TORQUE, (WINDOW,)),
    16: partial(_draw_measured_difference, 16, 'measured_35_at_once', 'measured_29'),
}


def draw_all(out: Path, progress: Callable[[float], None], runs: Runs) -> dict[int, Path]:
    """Write each figure as out/figure_NN.png; the files by number. Raises RedresError."""
    files = {number: out / f'figure_{number:02d}.png' for number in FIGURES}
    in_parallel(lambda number: save(FIGURES[number](runs), files[number]), list(FIGURES), progress)
    return files
