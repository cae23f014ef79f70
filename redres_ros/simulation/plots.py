"""Pictures of motions: norms over time, and paths in space. Draws to files, without a display."""

import textwrap
from collections.abc import Mapping
from itertools import cycle
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.transforms import ScaledTranslation

from redres_ros.files.text import writing
from redres_ros.planning.waypoints import WaypointTask
from redres_ros.robot_model import RobotModel
from redres_ros.simulation.colours import law_colour
from redres_ros.simulation.recording import Recording

NORMS = {
    'joint_acceleration_norm': r'acceleration $\Vert\ddot q\Vert$ [rad/s$^2$]',
    'joint_velocity_norm': r'velocity $\Vert\dot q\Vert$ [rad/s]',
    'null_velocity_norm': r'null-space part $\Vert P\dot q\Vert$ [rad/s]',
    'joint_torque_norm': r'torque $\Vert\tau\Vert$ [Nm]',
}

_MARGIN = 0.015  # of a time axis, so that a step at either end is seen
_BELOW = 0.45  # [in] from the lowest panel to the legend, where its axis is labelled

# A norm is drawn on a logarithmic scale if its largest peak is so many times the median one
_WIDE = 10.0
_SHOWN = 1e4  # the range of such a scale

_BESIDE_PATHS = ('joint_acceleration_norm', 'joint_velocity_norm', 'null_velocity_norm')
_LEAST_SCALE = 0.1  # of a norm's axis, so that rounding does not fill the picture
_HEADROOM = 1.15  # of an axis, above the largest value of the run that is shown
_BEFORE_STOP = 0.2  # [s] at the end of a run that was stopped, which does not set the scale
_TITLE_WIDTH = 110  # letters
_MOST_POINTS = 2000  # of a curve
_LINE_STYLES = ('-', '--', ':', '-.')  # of several motions


def save(figure: Figure, path: Path) -> None:
    """Write a figure; its folder is made if it does not exist. Raises FileError."""
    with writing(path):  # a ValueError says that no picture ends like that
        figure.savefig(path, dpi=130)


def time_panels(count: int, title: str, size: tuple[float, float]) -> tuple[Figure, list[Axes]]:
    """A figure of some size [in] with panels above each other over one time axis."""
    figure = Figure(figsize=size, layout='constrained')
    panels = _panels(figure, count)
    panels[0].set_title(title)
    return figure, panels


def _panels(place: Any, count: int) -> list[Axes]:
    """Panels above each other over one time axis, in a figure or a part of it."""
    panels = list(np.atleast_1d(place.subplots(count, 1, sharex=True)))
    panels[-1].set_xlabel('time [s]')
    for ax in panels:
        ax.grid(alpha=0.3)
        ax.set_xmargin(_MARGIN)
    return panels


def legend_below(ax: Axes, labelled: Axes, *, ncols: int = 2, fontsize: str | None = None) -> None:
    """A legend of a panel's labels below the lowest one, `ax`; the layout leaves space for it."""
    # 'outside lower center' of a figure is the same, but needs matplotlib 3.7.
    below = ax.transAxes + ScaledTranslation(0.0, -_BELOW, ax.figure.dpi_scale_trans)
    ax.legend(
        *labelled.get_legend_handles_labels(),
        loc='upper center',
        bbox_to_anchor=(0.5, 0.0),
        bbox_transform=below,
        ncols=ncols,
        fontsize=fontsize,
    )


# --- several motions ------------------------------------------------------------------------------


def draw_norms(recordings: Mapping[str, Recording], title: str) -> Figure:
    """The norms of motions over time, by their labels, one panel a norm; and the task scaling."""
    figures = {**NORMS, 'task_scaling': 'task scaling $s$'}
    figure, axes = time_panels(len(figures), title, (11.0, 11.0))
    for ax, (norm, quantity) in zip(axes, figures.items(), strict=True):
        for (name, recording), style in zip(recordings.items(), cycle(_LINE_STYLES), strict=False):
            label = _in_symbols(name)
            ax.plot(recording['t'], recording[norm], label=label, color=law_colour(name), ls=style)
        ax.set_ylabel(quantity, fontsize='small')
        peaks = [recording.peak(norm)[0] for recording in recordings.values()]
        if max(peaks) > _WIDE * np.median(peaks):
            ax.set_yscale('log')
            ax.set_ylim(bottom=max(peaks) / _SHOWN)
    legend_below(axes[-1], axes[0], ncols=1, fontsize='small')
    return figure


def _in_symbols(text: str) -> str:
    """A law's label or a title as a picture shows it."""
    return text.replace('k_d', '$k_d$').replace('1/s', 's$^{-1}$')


# --- one motion -----------------------------------------------------------------------------------


def draw_motion(
    recording: Recording,
    model: RobotModel,
    task: WaypointTask,
    title: str,
    law: str,
    stopped: str = '',
) -> Figure:
    """One page: the paths of tip and elbow on the left, norms over time on the right, in the colour
    of the law; and the errors of a task with orientations. The motion has at least one row.
    `stopped` is why the robot was stopped, which is marked at the end of the curves.
    """
    figure = Figure(figsize=(13.0, 7.5), layout='constrained')
    lines = [_in_symbols(title)]
    if stopped:
        reason = stopped.replace('^2', '²')
        lines += textwrap.wrap(f'stopped at the red line: {reason}', _TITLE_WIDTH)
    figure.suptitle('\n'.join(lines), fontsize='medium')
    left, right = np.asarray(figure.subfigures(1, 2, width_ratios=(1.0, 1.3)))
    draw_paths(left.add_subplot(projection='3d'), recording, model, task)
    panels = _panels(right, len(_BESIDE_PATHS) + int(recording.pose))
    for ax, norm in zip(panels, _BESIDE_PATHS, strict=False):
        draw_norm(ax, norm, recording, law, stopped=bool(stopped))
        if stopped:
            ax.axvline(recording['t'][-1], color='tab:red', lw=1.5, label='stopped', zorder=0)
    if recording.pose:
        _draw_errors(panels[-1], recording)
    legend_below(panels[-1], panels[0], ncols=4, fontsize='small')
    return figure


def draw_contact(forces: np.ndarray, recording: Recording, model: RobotModel, title: str) -> Figure:
    """Force on the tip, and its and the elbow's path; `forces` (N, 4) are times [s], forces [N]."""
    figure, (force, distance) = time_panels(2, _in_symbols(title), (9.0, 5.5))
    force.plot(forces[:, 0], np.linalg.norm(forces[:, 1:], axis=1), color='tab:red')
    force.set_ylabel('force on the tip [N]')
    every = max(len(recording.data) // _MOST_POINTS, 1)
    t = recording['t'][::every]
    positions = recording.vectors('q1')[::every]
    for name, frame in (('tip', model.arm.tip_frame), ('elbow', model.arm.elbow_frame)):
        if frame:
            x = np.array([model.position(q, frame) for q in positions])
            distance.plot(t, 1e3 * np.linalg.norm(x - x[0], axis=1), label=name)
    distance.set_ylabel('distance from its start [mm]')
    distance.legend(fontsize='small')
    return figure


def draw_norm(
    ax: Axes, norm: str, recording: Recording, law: str, *, stopped: bool = False
) -> None:
    """One of NORMS over time, in the colour of the law.

    What the robot stopped may be far beyond the rest: it does not set the scale, but is labelled.
    """
    ax.plot(recording['t'], recording[norm], color=law_colour(law), lw=1.2, label='this run')
    ax.set_ylabel(NORMS[norm], fontsize='small')
    peak, at = recording.peak(norm)
    top = peak
    earlier = recording[norm][recording['t'] < recording['t'][-1] - _BEFORE_STOP]
    if stopped and len(earlier):
        top = min(peak, 2.0 * float(earlier.max()))
    top = _HEADROOM * max(top, _LEAST_SCALE)
    ax.set_ylim(0.0, top)
    if peak > top:
        across = ax.get_xaxis_transform()
        ax.text(at, 0.96, f'up to {peak:.3g} ', transform=across, ha='right', va='top')


def _draw_errors(ax: Axes, recording: Recording) -> None:
    """Position and orientation errors of the tip."""
    for column, color, name in (
        ('task_error', 'black', 'position [mm]'),
        ('orientation_error', 'tab:orange', 'orientation [mrad]'),
    ):
        ax.plot(recording['t'], 1e3 * recording[column], color=color, lw=1.2, label=name)
    ax.set_ylabel('error', fontsize='small')
    ax.set_ylim(bottom=0.0)
    ax.legend(fontsize='x-small', loc='upper right')


# --- paths ----------------------------------------------------------------------------------------


def draw_paths(ax: Any, recording: Recording, model: RobotModel, task: WaypointTask) -> None:
    """Paths of tip (black) and elbow (blue), which begin at a dot, and the task's points (red)."""
    postures = recording.vectors('q1')[::10]
    elbow = np.array([model.position(q, model.arm.elbow_frame) for q in postures])
    tip = recording.vectors('x')
    for name, path, color in (('tip', tip, 'black'), ('elbow', elbow, 'tab:blue')):
        ax.plot(*path.T, color=color, label=name)
        ax.plot(*path[:1].T, 'o', color=color, ms=7)
    points = task.waypoints if task.times is None else task.waypoints[[0, -1]]
    ax.plot(*points.T, 's', color='tab:red', ms=4, label='points of the task')
    places, place_of = np.unique(points.round(6), axis=0, return_inverse=True)
    for number, place in enumerate(places):
        names = [f'$x_{point}$' for point in np.flatnonzero(place_of.ravel() == number)]
        ax.text(*place, f'  {", ".join(names)}', color='tab:red')
    ax.set(xlabel='x [m]', ylabel='y [m]', zlabel='z [m]', title='paths of tip and elbow')
    lengths = np.ptp((ax.get_xlim(), ax.get_ylim(), ax.get_zlim()), axis=1)  # of the axes [m]
    ax.set_box_aspect(lengths, zoom=0.85)  # leaves space for the labels of the axes
    ax.view_init(elev=18.0, azim=-35.0)
    ax.locator_params(nbins=4)
    ax.tick_params(labelsize='small')
    ax.legend(loc='upper center', bbox_to_anchor=(0.5, -0.08), ncols=3, fontsize='small')
