"""Pictures of motions. Draws to files; needs no display."""

from collections.abc import Mapping
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from redres_ros.errors import FileError
from redres_ros.robot_model import RobotModel
from redres_ros.simulation.recording import Recording
from redres_ros.waypoints import WaypointTask

NORMS = {
    'joint_acceleration_norm': r'acceleration $\Vert\ddot q\Vert$ [rad/s$^2$]',
    'joint_velocity_norm': r'velocity $\Vert\dot q\Vert$ [rad/s]',
    'null_velocity_norm': r'null-space part $\Vert P\dot q\Vert$ [rad/s]',
    'joint_torque_norm': r'torque $\Vert\tau\Vert$ [Nm]',
}

_BESIDE = 0.06  # [m] from a point to its label, away from the middle of all points
_LEAST_SCALE = 0.1  # of a norm's axis, so that rounding does not fill the picture


def draw_motion(
    recording: Recording,
    model: RobotModel,
    task: WaypointTask,
    title: str,
    path: Path,
    *,
    beside: Mapping[str, Recording] | None = None,
    stopped: str = '',
) -> None:
    """One page: the way of tip and elbow on the left, norms over time on the right.

    beside: ideal motions by name, drawn in grey under the norms for comparison; stopped: why the
    robot was stopped, written under the title and marked at the end of the curves. Raises
    FileError.
    """
    figure = Figure(figsize=(11.0, 7.0), layout='constrained')
    figure.suptitle(f'{title}\nstopped at the red line: {stopped}' if stopped else title)
    grid = figure.add_gridspec(3, 2, width_ratios=(1.0, 1.5))
    draw_paths(figure.add_subplot(grid[:, 0], projection='3d'), recording, model, task)
    axes: list[Axes] = []
    for place, norm in enumerate(
        ('joint_acceleration_norm', 'joint_velocity_norm', 'null_velocity_norm')
    ):
        axes.append(figure.add_subplot(grid[place, 1], sharex=axes[0] if axes else None))
        draw_norm(axes[-1], norm, recording, beside or {})
        if stopped and len(recording.data):
            axes[-1].axvline(recording['t'][-1], color='tab:red', ls='--', lw=1.0)
    axes[0].legend(loc='upper left', fontsize='small')
    axes[-1].set_xlabel('time [s]')
    save(figure, path)


def draw_paths(ax: Axes, recording: Recording, model: RobotModel, task: WaypointTask) -> None:
    """The tip in black and the elbow in blue, with the task's points, as the paper's figures show
    them.
    """
    elbow = np.array(
        [model.position(q, model.arm.elbow_frame) for q in recording.vectors('q1')[::10]]
    )
    ax.plot(*recording.vectors('x').T, color='black', label='tip')
    if len(elbow):
        ax.plot(*elbow.T, color='tab:blue', label='elbow')
    ax.plot(*task.waypoints.T, 'o', color='tab:red', ms=4, label='points of the task')
    outwards = task.waypoints - task.waypoints.mean(axis=0)  # (N, 3)
    labels = task.waypoints + _BESIDE * outwards / np.maximum(
        np.linalg.norm(outwards, axis=1, keepdims=True), _BESIDE
    )
    for number, label in enumerate(labels):
        ax.text(*label, f'$x_{number}$', color='tab:red', ha='center', va='center')
    for axis, name in ((ax.xaxis, 'x'), (ax.yaxis, 'y'), (ax.zaxis, 'z')):
        axis.set_major_locator(MaxNLocator(4 if name == 'z' else 3))
        axis.set_tick_params(labelsize='small')
    ax.set(xlabel='x [m]', ylabel='y [m]', zlabel='z [m]', title='way of tip and elbow')
    ax.set_aspect('equal')
    ax.view_init(elev=18.0, azim=-35.0)
    ax.legend(loc='upper center', bbox_to_anchor=(0.5, -0.1), ncols=3, fontsize='small')


def draw_norm(ax: Axes, norm: str, recording: Recording, beside: Mapping[str, Recording]) -> None:
    """One norm over time, in front of the same norm of other motions."""
    for name, other in beside.items():
        ax.plot(other['t'], other[norm], label=f'{name}, ideal arm', color='0.6', lw=1.0)
    ax.plot(recording['t'], recording[norm], color='tab:blue', lw=1.2, label='this run')
    ax.set_ylabel(NORMS[norm], fontsize='small')
    ax.set_ylim(0.0, max(ax.get_ylim()[1], _LEAST_SCALE))
    ax.grid(alpha=0.3)


def save(figure: Figure, path: Path) -> None:
    """Write a figure as a file. Raises FileError."""
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        figure.savefig(path, dpi=130)
    except OSError as error:
        raise FileError(f'cannot write {path}: {error.strerror}') from None
