"""The paths of an arm's tip and elbow, in three dimensions."""

from typing import Any

import numpy as np
from matplotlib.ticker import MaxNLocator

from redres_ros.planning.waypoints import WaypointTask
from redres_ros.robot_model import RobotModel
from redres_ros.simulation.recording import Recording

_BESIDE = 0.07  # [m] from a point to its label, away from the middle of all points
_ARROW = 0.08  # [m]
_LARGEST_ARROW = 0.05  # of the length of the path
_THINNEST = 0.35  # of the longest axis that each axis is shown with
_ZOOM = 0.85  # leaves space for the labels of the axes


def draw_paths(ax: Any, recording: Recording, model: RobotModel, task: WaypointTask) -> None:
    """The path of the tip in black and of the elbow in blue, with the task's points in red.

    The start is a filled circle, and arrows point where the motion goes.

    Args:
        ax: A place with three dimensions.
        recording: The motion.
        model: Model of the arm that moved.
        task: Its task.
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


def _names_by_point(points: np.ndarray) -> dict[int, list[str]]:
    """What the points (N, 3) [m] are called, by the first of those that are in one place."""
    names: dict[int, list[str]] = {}
    for number, point in enumerate(points):
        first = int(np.argmin(np.linalg.norm(points - point, axis=1)))
        names.setdefault(first, []).append(f'$x_{number}$')
    return names


def _draw_arrows(ax: Any, path: np.ndarray, color: str) -> None:
    """Arrow heads along a path (N, 3) [m]."""
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
    ax.set(
        xlim=(middles[0] - spans[0] / 2.0, middles[0] + spans[0] / 2.0),
        ylim=(middles[1] - spans[1] / 2.0, middles[1] + spans[1] / 2.0),
        zlim=(middles[2] - spans[2] / 2.0, middles[2] + spans[2] / 2.0),
    )
    ax.set_box_aspect(spans, zoom=_ZOOM)
    ax.zaxis.labelpad = 8.0
    for axis, span in zip((ax.xaxis, ax.yaxis, ax.zaxis), spans, strict=True):
        axis.set_major_locator(MaxNLocator(max(round(4.0 * span / spans.max()), 2)))
        axis.set_tick_params(labelsize='small')
