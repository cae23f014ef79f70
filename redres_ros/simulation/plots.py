"""Pictures of motions. Draws to files, without a display."""

import textwrap
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from redres_ros.planning.waypoints import WaypointTask
from redres_ros.robot_model import RobotModel
from redres_ros.simulation.colours import law_colour
from redres_ros.simulation.drawing import legend_below, save, time_panels
from redres_ros.simulation.paths import draw_paths
from redres_ros.simulation.recording import Recording

NORMS = {
    'joint_acceleration_norm': r'acceleration $\Vert\ddot q\Vert$ [rad/s$^2$]',
    'joint_velocity_norm': r'velocity $\Vert\dot q\Vert$ [rad/s]',
    'null_velocity_norm': r'null-space part $\Vert P\dot q\Vert$ [rad/s]',
    'joint_torque_norm': r'torque $\Vert\tau\Vert$ [Nm]',
}

_SHOWN = ('joint_acceleration_norm', 'joint_velocity_norm', 'null_velocity_norm')
_LEAST_SCALE = 0.1  # of a norm's axis, so that rounding does not fill the picture
_HEADROOM = 1.15  # of an axis, above the largest value of the run that is shown
_MARGIN = 0.015  # of the time axis, so that a step at either end is seen
_BEFORE_STOP = 0.2  # [s] at the end of a run that was stopped, which does not set the scale
_GAP = 0.05  # [s] without a row, over which a curve is broken
_TITLE_WIDTH = 110  # letters
_MOST_POINTS = 2000  # of a curve


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

    @property
    def laws(self) -> list[tuple[float, str]]:
        """(time [s], law in force from then on)."""
        return [(-np.inf, self.law), *((t, after) for t, _, after in self.switches)]


def draw_motion(
    recording: Recording,
    model: RobotModel,
    task: WaypointTask,
    title: str,
    path: Path,
    remarks: Remarks,
) -> None:
    """One page: the paths of tip and elbow on the left, norms over time on the right; and the
    errors of a task with orientations.

    Args:
        recording: The motion, of at least one row.
        model: Model of the arm that moved.
        task: Its task.
        title: Above the page.
        path: Path of the file, a .png, .pdf or .svg.
        remarks: What else is marked.

    Raises:
        FileError: The file cannot be written.
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
    _name_switches(panels[-1], remarks)
    panels[-1].set_xlabel('time [s]')
    end = max(recording['t'][-1], recording.T)
    panels[-1].set_xlim(-_MARGIN * end, (1.0 + _MARGIN) * end)
    legend_below(panels[-1], panels[0], ncols=4, fontsize='small')
    save(figure, path)


def draw_contact(
    forces: np.ndarray, recording: Recording, model: RobotModel, title: str, path: Path
) -> None:
    """Draw the force on the tip, and how far tip and elbow moved, into a file.

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
    """One norm over time, in the colour of the law, with the same norm of other motions.

    Args:
        ax: Where.
        norm: One of NORMS.
        recording: The motion that sets the scale; peaks beyond it are cut off and labelled. What
            the robot stopped may be far beyond the rest, and does not set the scale.
        remarks: Laws, other motions, and a stop.
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
    laws = remarks.laws
    for place, (start, law) in enumerate(laws):
        shown = values if place == 0 else np.where(t < start, np.nan, values)
        if place + 1 < len(laws):
            shown = np.where(t > laws[place + 1][0], np.nan, shown)
        label = 'this run' if place == 0 else f'_{law}'  # an underscore: not in the legend
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
    across = ax.get_xaxis_transform()  # x in seconds, y from 0 at the bottom to 1 at the top
    for number, (t, _, _) in enumerate(remarks.switches, 1):
        ax.axvline(t, color='tab:green', ls='--', lw=1.0)
        ax.text(
            t, 1.01, str(number), color='tab:green', transform=across, ha='center', fontsize='small'
        )
    if remarks.stopped:
        ax.axvline(recording['t'][-1], color='tab:red', lw=1.5, label='stopped', zorder=0)


def _name_switches(ax: Axes, remarks: Remarks) -> None:
    """The law before each switch on the left of its line, and the one after it on the right."""
    across = ax.get_xaxis_transform()
    style: dict[str, Any] = {
        'transform': across,
        'color': 'tab:green',
        'fontsize': 'x-small',
        'rotation': 90,
        'va': 'top',
    }
    for t, before, after in remarks.switches:
        ax.text(t, 0.97, f'{before} ', ha='right', **style)
        ax.text(t, 0.97, f' {after}', ha='left', **style)


def _label_hidden_peak(ax: Axes, other: Recording, norm: str, top: float) -> None:
    """Label the peak of a curve where it leaves the picture."""
    peak, t = other.peak(norm)
    beyond = other['t'][other[norm] > top]
    if not len(beyond):
        return
    place = {'x': beyond[0], 'ha': 'right'}
    if beyond[0] < 0.3 * other['t'][-1]:
        place = {'x': beyond[-1], 'ha': 'left'}
    ax.text(
        y=0.96,
        s=f'  up to {peak:.3g} at {t:.2f} s  ',
        transform=ax.get_xaxis_transform(),
        color='0.4',
        fontsize='small',
        va='top',
        clip_on=True,
        **place,
    ).set_in_layout(False)


def _largest(recording: Recording, norm: str) -> float:
    return recording.peak(norm)[0] if len(recording.data) else 0.0


def _curve(recording: Recording, norm: str) -> tuple[np.ndarray, np.ndarray]:
    """Times and values, with a NaN wherever nothing was recorded for a while."""
    t = recording['t']
    breaks = np.flatnonzero(np.diff(t) > _GAP) + 1
    return np.insert(t, breaks, np.nan), np.insert(recording[norm], breaks, np.nan)
