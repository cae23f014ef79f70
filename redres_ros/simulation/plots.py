"""Pictures of one motion: paths in space and norms over time. Draws to files, without a display."""

import textwrap
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from redres_ros.planning.waypoints import WaypointTask
from redres_ros.robot_model import RobotModel
from redres_ros.simulation.colours import law_colour
from redres_ros.simulation.drawing import NORMS, legend_below, save, time_panels
from redres_ros.simulation.recording import Recording
from redres_ros.types import Points

_SHOWN = ('joint_acceleration_norm', 'joint_velocity_norm', 'null_velocity_norm')
_LEAST_SCALE = 0.1  # of a norm's axis, so that rounding does not fill the picture
_HEADROOM = 1.15  # of an axis, above the largest value of the run that is shown
_MARGIN = 0.015  # of the time axis, so that a step at either end is seen
_BEFORE_STOP = 0.2  # [s] at the end of a run that was stopped, which does not set the scale
_GAP = 0.05  # [s] without a row, over which a curve is broken
_TITLE_WIDTH = 110  # letters
_MOST_POINTS = 2000  # of a curve

_BESIDE = 0.07  # [m] from a point to its label, away from the middle of all points
_ARROW = 0.08  # [m]
_LARGEST_ARROW = 0.05  # of the length of the path
_THINNEST = 0.35  # of the longest axis that each axis is shown with
_ZOOM = 0.85  # leaves space for the labels of the axes


@dataclass(frozen=True)
class Remarks:
    """Remarks beside the curves of a motion.

    Attributes:
        beside: Ideal motions by law, drawn dashed for comparison.
        stopped: Why the robot was stopped, marked at the end of the curves.
        switches: (time [s], law before, law after).
        law: Law in force at the start; empty for one without a colour of its own.
    """

    beside: Mapping[str, Recording]
    stopped: str = ''
    switches: tuple[tuple[float, str, str], ...] = ()
    law: str = ''


def draw_motion(
    recording: Recording,
    model: RobotModel,
    task: WaypointTask,
    title: str,
    path: Path,
    remarks: Remarks,
) -> None:
    """One page: the paths of tip and elbow on the left, norms over time on the right; and the
    errors of a task with orientations. The motion has at least one row. Raises FileError.
    """
    figure = Figure(figsize=(13.0, 7.5), layout='constrained')
    figure.suptitle('\n'.join([title, *_lines(remarks)]), fontsize='medium')
    parts: Any = figure.subfigures(1, 2, width_ratios=(1.0, 1.3))
    left, right = parts
    draw_paths(left.add_subplot(projection='3d'), recording, model, task)
    rows = len(_SHOWN) + int(recording.pose)
    panels = list(right.subplots(rows, 1, sharex=True))
    for ax, norm in zip(panels, _SHOWN, strict=False):
        draw_norm(ax, norm, recording, remarks)
        _mark_events(ax, recording, remarks)
    if recording.pose:
        _draw_errors(panels[-1], recording)
    for t, before, after in remarks.switches:
        _label_line(panels[-1], t, 0.97, f'{before} ', ha='right', rotation=90, va='top')
        _label_line(panels[-1], t, 0.97, f' {after}', ha='left', rotation=90, va='top')
    panels[-1].set_xlabel('time [s]')
    end = max(recording['t'][-1], recording.T)
    panels[-1].set_xlim(-_MARGIN * end, (1.0 + _MARGIN) * end)
    legend_below(panels[-1], panels[0], ncols=4, fontsize='small')
    save(figure, path)


def draw_contact(
    forces: np.ndarray, recording: Recording, model: RobotModel, title: str, path: Path
) -> None:
    """The force on the tip, and how far tip and elbow moved.

    Args:
        forces: Times [s], and forces of the environment on the tip along its axes [N], (N, 4).
        recording: Recording of the motion.
        model: The arm.
        title: What was run.
        path: Path of the picture.
    """
    figure, (force, distance) = time_panels(2, title, (9.0, 5.5))
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
    save(figure, path)


def draw_norm(ax: Axes, norm: str, recording: Recording, remarks: Remarks) -> None:
    """One of NORMS over time, in the colour of the law, with the same norm of other motions.

    The recording sets the scale; peaks beyond it are cut off and labelled. What the robot stopped
    may be far beyond the rest, and does not set the scale.
    """
    beside = remarks.beside
    for name, other in beside.items():
        label = f'{name}, ideal arm'
        ax.plot(*_curve(other, norm), label=label, color=law_colour(name), ls='--', lw=1.0)
    _plot_by_law(ax, norm, recording, remarks)
    ax.set_ylabel(NORMS[norm], fontsize='small')
    top = _largest(recording, norm)
    if remarks.stopped:
        earlier = recording[norm][recording['t'] < recording['t'][-1] - _BEFORE_STOP]
        top = min(top, 2.0 * float(earlier.max())) if len(earlier) else top
    if top < _LEAST_SCALE:
        top = max([_LEAST_SCALE, *(_largest(other, norm) for other in beside.values())])
    top *= _HEADROOM
    ax.set_ylim(0.0, top)
    for other in (recording, *beside.values()):
        _label_hidden_peak(ax, other, norm, top)
    ax.grid(alpha=0.3)


def _plot_by_law(ax: Axes, norm: str, recording: Recording, remarks: Remarks) -> None:
    """The curve of this run, each part of it in the colour of the law in force."""
    t, values = _curve(recording, norm)
    laws = [(-np.inf, remarks.law), *((t, after) for t, _, after in remarks.switches)]
    ends = [start for start, _ in laws[1:]] + [np.inf]
    for (start, law), end in zip(laws, ends, strict=True):
        shown = np.where((t < start) | (t > end), np.nan, values)
        label = 'this run' if start < 0.0 else f'_{law}'  # an underscore: not in the legend
        ax.plot(t, shown, color=law_colour(law), lw=1.2, label=label)


def _draw_errors(ax: Axes, recording: Recording) -> None:
    """Position and orientation errors of the tip."""
    for column, color, label in (
        ('task_error', 'black', 'position [mm]'),
        ('orientation_error', 'tab:orange', 'orientation [mrad]'),
    ):
        t, error = _curve(recording, column)
        ax.plot(t, 1e3 * error, color=color, lw=1.2, label=label)
    ax.set_ylabel('error', fontsize='small')
    ax.set_ylim(bottom=0.0)
    ax.grid(alpha=0.3)
    ax.legend(fontsize='x-small', loc='upper right')


def _lines(remarks: Remarks) -> list[str]:
    """Remarks as text, one line each."""
    lines = []
    for number, (t, before, after) in enumerate(remarks.switches, 1):
        lines.append(f'{number}: at {t:.2f} s from {before} to {after}')
    if remarks.stopped:
        reason = remarks.stopped.replace('^2', '²')
        lines += textwrap.wrap(f'stopped at the red line: {reason}', _TITLE_WIDTH)
    return lines


def _mark_events(ax: Axes, recording: Recording, remarks: Remarks) -> None:
    """Switches by their numbers, and the stop."""
    for number, (t, _, _) in enumerate(remarks.switches, 1):
        ax.axvline(t, color='tab:green', ls='--', lw=1.0)
        _label_line(ax, t, 1.01, str(number), ha='center')
    if remarks.stopped:
        ax.axvline(recording['t'][-1], color='tab:red', lw=1.5, label='stopped', zorder=0)


def _label_line(ax: Axes, t: float, height: float, text: str, **style: Any) -> None:
    """A text at a time [s] and a height, from 0 at the bottom to 1 at the top."""
    across = ax.get_xaxis_transform()
    ax.text(t, height, text, color='tab:green', transform=across, fontsize='small', **style)


def _label_hidden_peak(ax: Axes, other: Recording, norm: str, top: float) -> None:
    """Label the peak of a curve where it leaves the picture."""
    beyond = other['t'][other[norm] > top]
    if not len(beyond):
        return
    peak, t = other.peak(norm)
    is_early = beyond[0] < 0.3 * other['t'][-1]
    ax.text(
        beyond[-1] if is_early else beyond[0],
        0.96,
        f'  up to {peak:.3g} at {t:.2f} s  ',
        ha='left' if is_early else 'right',
        transform=ax.get_xaxis_transform(),
        color='0.4',
        fontsize='small',
        va='top',
        clip_on=True,
    ).set_in_layout(False)


def _largest(recording: Recording, norm: str) -> float:
    return recording.peak(norm)[0] if len(recording.data) else 0.0


def _curve(recording: Recording, norm: str) -> tuple[np.ndarray, np.ndarray]:
    """Times and values, with a NaN wherever nothing was recorded for a while."""
    t = recording['t']
    breaks = np.flatnonzero(np.diff(t) > _GAP) + 1
    return np.insert(t, breaks, np.nan), np.insert(recording[norm], breaks, np.nan)


def draw_paths(ax: Any, recording: Recording, model: RobotModel, task: WaypointTask) -> None:
    """The path of the tip in black and of the elbow in blue, with the task's points in red, in
    three dimensions.

    The start is a filled circle, and arrows point where the motion goes.
    """
    tip = recording.vectors('x')  # (N, 3)
    elbow = np.array(
        [model.position(q, model.arm.elbow_frame) for q in recording.vectors('q1')[::10]]
    )  # (N / 10, 3)
    if len(tip):
        ax.plot(*tip.T, color='black', label='tip')
        ax.plot(*elbow.T, color='tab:blue', label='elbow')
        _draw_arrows(ax, tip, 'black')
        _draw_arrows(ax, elbow, 'tab:blue')
        ax.plot(*elbow[:1].T, 'o', color='tab:blue', ms=6)
        ax.plot(*tip[:1].T, 'o', color='black', ms=7, label='start')
    ax.plot(*task.waypoints.T, 's', color='tab:red', ms=4, label='points of the task')
    outwards = task.waypoints - task.waypoints.mean(axis=0)  # (N, 3)
    lengths = np.maximum(np.linalg.norm(outwards, axis=1, keepdims=True), _BESIDE)
    places = task.waypoints + _BESIDE * outwards / lengths  # of the labels
    for point, names in _names_by_point(task.waypoints).items():
        style = {'color': 'tab:red', 'ha': 'center', 'va': 'center'}
        ax.text(*places[point], ', '.join(names), **style)
    ax.set(xlabel='x [m]', ylabel='y [m]', zlabel='z [m]', title='paths of tip and elbow')
    _scale_alike(ax)
    ax.view_init(elev=18.0, azim=-35.0)
    ax.legend(loc='upper center', bbox_to_anchor=(0.5, -0.08), ncols=4, fontsize='small')


def _names_by_point(points: Points) -> dict[int, list[str]]:
    """What the points are called, by the first of those that are in one place."""
    names: dict[int, list[str]] = {}
    for number, point in enumerate(points):
        first = int(np.argmin(np.linalg.norm(points - point, axis=1)))
        names.setdefault(first, []).append(f'$x_{number}$')
    return names


def _draw_arrows(ax: Any, path: Points, color: str) -> None:
    """Arrow heads along a path."""
    steps = np.linalg.norm(np.diff(path, axis=0), axis=1)
    lengths = np.concatenate(([0.0], np.cumsum(steps)))  # (N,)
    size = min(_ARROW, _LARGEST_ARROW * float(lengths[-1]))
    for fraction in (0.15, 0.5, 0.85):
        at = int(np.searchsorted(lengths, fraction * lengths[-1]))
        ahead = min(int(np.searchsorted(lengths, lengths[at] + size / 4.0)), len(path) - 1)
        direction = path[ahead] - path[at]
        direction *= size / max(float(np.linalg.norm(direction)), 1e-9)
        ax.quiver(*path[at], *direction, color=color, arrow_length_ratio=0.6, lw=1.5)


def _scale_alike(ax: Any) -> None:
    """Make a metre equally long on every axis, with as many ticks as fit."""
    limits = np.array((ax.get_xlim(), ax.get_ylim(), ax.get_zlim()))  # (3, 2)
    spans = np.maximum(np.ptp(limits, axis=1), _THINNEST * np.ptp(limits, axis=1).max())
    middles = limits.mean(axis=1)
    for set_limits, middle, span in zip(
        (ax.set_xlim, ax.set_ylim, ax.set_zlim), middles, spans, strict=True
    ):
        set_limits(middle - span / 2.0, middle + span / 2.0)
    ax.set_box_aspect(spans, zoom=_ZOOM)
    ax.zaxis.labelpad = 8.0
    for axis, span in zip((ax.xaxis, ax.yaxis, ax.zaxis), spans, strict=True):
        axis.set_major_locator(MaxNLocator(max(round(4.0 * span / spans.max()), 2)))
        axis.set_tick_params(labelsize='small')
