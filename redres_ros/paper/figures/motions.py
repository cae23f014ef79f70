"""Figures 3, 6, 9, 11, 14: the paths of tip and elbow, and pictures of the arm."""

import numpy as np
from matplotlib.figure import Figure, SubFigure
from matplotlib.ticker import MaxNLocator

from redres_ros.paper.experiment import Experiment
from redres_ros.paper.runs import MOTIONS, Runs, title
from redres_ros.robot_model import RobotModel
from redres_ros.simulation.drawing import legend_below
from redres_ros.simulation.plots import draw_paths
from redres_ros.simulation.recording import Recording

PICTURES = (2, 3)  # rows and columns of pictures, evenly spaced in time
_ELEVATION = 14.0  # [deg] of the camera
_AZIMUTH = -152.0  # [deg]
_SPAN = ((-0.9, 0.5), (-0.7, 0.7), (-0.3, 1.1))  # [m] of a picture


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
    draw_paths(ax, recording, model, MOTIONS[name].task(runs))
    ax.view_init(elev=_ELEVATION, azim=_AZIMUTH)
    for axis in (ax.xaxis, ax.yaxis):
        axis.set_major_locator(MaxNLocator(2))
    legend_below(ax, ax)
    ax.set_title('(a) path of the tip (black) and of the elbow (blue)')
    _draw_pictures(right, recording, model)
    return figure


def _draw_pictures(place: SubFigure, recording: Recording, model: RobotModel) -> None:
    """(b): the links of the arm along its path, with the path of the tip up to there."""
    rows, columns = PICTURES
    ticks = np.linspace(0, len(recording.data) - 1, rows * columns).round().astype(int)
    place.suptitle('(b) the arm on its path', fontsize='large')
    axes = np.asarray(place.subplots(rows, columns, subplot_kw={'projection': '3d'}))
    for ax, tick in zip(axes.flat, ticks, strict=True):
        ax.plot(*_links(model, recording.vectors('q1')[tick]).T, 'o-', color='tab:orange', lw=4.0)
        ax.plot(*recording.vectors('x')[: tick + 1].T, color='black', lw=1.0)
        ax.set(xlim=_SPAN[0], ylim=_SPAN[1], zlim=_SPAN[2], box_aspect=(1.0, 1.0, 1.0))
        ax.set_title(f't = {recording["t"][tick]:.2f} s', fontsize='medium')
        ax.view_init(elev=_ELEVATION, azim=_AZIMUTH)
        ax.set_axis_off()


def _links(model: RobotModel, q: np.ndarray) -> np.ndarray:
    """Positions of the joints from the base on, and of the tip, (n + 2, 3) [m]."""
    joints = [model.position(q, f'link_{number}') for number in range(1, model.n + 1)]
    return np.array([np.zeros(3), *joints, model.tip(q)[0]])
