"""Figures 3, 6, 9, 11, 14: the paths of tip and elbow, and pictures of the arm."""

import numpy as np
from matplotlib.figure import Figure, SubFigure
from matplotlib.ticker import MaxNLocator

from redres_ros.paper.experiment import Experiment
from redres_ros.paper.runs import MOTIONS, Runs, title
from redres_ros.planning.waypoints import WaypointTask
from redres_ros.robot_model import RobotModel
from redres_ros.simulation.plots import draw_paths
from redres_ros.simulation.recording import Recording

PICTURES = (2, 3)  # rows and columns of pictures, evenly spaced in time
_ELEVATION = 14.0  # [deg] of the camera
_AZIMUTH = -152.0  # [deg]


def draw(number: int, name: str, runs: Runs) -> Figure:
    """The motion of one run."""
    result = runs[name]
    recording = result
    model = runs.model
    if isinstance(result, Experiment):
        recording = result.recording
        model = runs.experiment_model
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
    rows, columns = PICTURES
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
    azimuth = np.radians(_AZIMUTH)
    elevation = np.radians(_ELEVATION)
    right = np.array((-np.sin(azimuth), np.cos(azimuth), 0.0))
    back = np.array((np.cos(azimuth), np.sin(azimuth), 0.0))
    up = np.cos(elevation) * np.array((0.0, 0.0, 1.0)) - np.sin(elevation) * back
    return np.array((right, up)) @ points.T


def _links(model: RobotModel, q: np.ndarray) -> np.ndarray:
    """Positions of the joints from the base on, and of the tip, (n + 2, 3) [m]."""
    joints = [model.position(q, f'link_{number}') for number in range(1, model.n + 1)]
    return np.array([np.zeros(3), *joints, model.tip(q)[0]])
