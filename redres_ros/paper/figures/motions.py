"""Figures 3, 6, 9, 11, 14: the paths of tip and elbow, and pictures of the arm."""

import textwrap

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure, SubFigure
from matplotlib.ticker import MaxNLocator

from redres_ros.paper.experiment import Experiment
from redres_ros.paper.runs import MOTIONS, Runs, title
from redres_ros.planning.waypoints import WaypointTask
from redres_ros.robot_model import RobotModel
from redres_ros.simulation.drawing import legend_below
from redres_ros.simulation.plots import draw_paths
from redres_ros.simulation.recording import Recording
from redres_ros.simulation.render import AZIMUTH, ELEVATION, Film, RenderError, render

PICTURES = (2, 3)  # rows and columns of pictures, evenly spaced in time


def draw(number: int, name: str, runs: Runs) -> Figure:
    """The motion of one run.

    Args:
        number: Number of the figure.
        name: Name of the run.
        runs: Their results.
    """
    result = runs[name]
    recording = result
    model = runs.model
    if isinstance(result, Experiment):
        recording = result.recording
        model = runs.experiment_model
    task = MOTIONS[name].task(runs)
    figure = Figure(figsize=(13.0, 7.0), layout='constrained')
    ending = recording.ending.replace('rad/s^2', 'rad/s²')
    figure.suptitle(f'{title(number, name)}\n{ending}')
    left, right = np.asarray(figure.subfigures(1, 2, width_ratios=(1.0, 1.35)))
    ax = left.add_subplot(projection='3d')
    draw_paths(ax, recording, model, task)
    ax.view_init(elev=-ELEVATION, azim=AZIMUTH - 180.0)  # as the camera sees it
    for axis in (ax.xaxis, ax.yaxis):
        axis.set_major_locator(MaxNLocator(2))
    legend_below(ax, ax)
    ax.set_title('(a) path of the tip (black) and of the elbow (blue)')
    _draw_pictures(right, recording, model, task)
    return figure


def _draw_pictures(
    place: SubFigure, recording: Recording, model: RobotModel, task: WaypointTask
) -> None:
    """(b): pictures of the arm along its path, or the reason why there are none."""
    ticks = np.linspace(0, len(recording.data) - 1, PICTURES[0] * PICTURES[1]).round().astype(int)
    place.suptitle('(b) the arm on its path', fontsize='large')
    try:
        pictures = render(model.arm, Film.of(recording, model, task, ticks))
    except RenderError as error:
        _note(place.add_subplot(), f'No pictures: {error}')
        return
    for ax, picture, t in zip(
        place.subplots(*PICTURES).flat, pictures, recording['t'][ticks], strict=True
    ):
        ax.imshow(picture)
        ax.set_title(f't = {t:.2f} s', fontsize='medium')
        ax.set_axis_off()


def _note(ax: Axes, text: str) -> None:
    ax.set_axis_off()
    ax.text(0.5, 0.5, textwrap.fill(text, 60), ha='center', va='center', color='tab:red')
