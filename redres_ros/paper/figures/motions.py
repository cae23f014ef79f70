"""Figures 3, 6, 9, 11, 14: the way of tip and elbow, and the arm on its way."""

import textwrap

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure, SubFigure
from matplotlib.ticker import MaxNLocator

from redres_ros.paper.figures.naming import law, title
from redres_ros.paper.figures.runs import (
    EXPERIMENT_DAMPING,
    EXPERIMENT_T,
    SIMULATION_DAMPING,
    SIMULATION_T,
    Runs,
)
from redres_ros.planning.waypoints import WaypointTask
from redres_ros.robot_model import RobotModel
from redres_ros.simulation.paths import draw_paths
from redres_ros.simulation.recording import Recording
from redres_ros.simulation.render import AZIMUTH, ELEVATION, Film, RenderError, render

PICTURES = (2, 3)  # rows and columns of pictures, evenly spaced in time

_EVERY = 10  # ticks between the points of a path


def figure_3(runs: Runs) -> Figure:
    """Simulation with law (23)."""
    text = law('minimum_acceleration', '23', SIMULATION_T, SIMULATION_DAMPING)
    return _draw(title(3, 'Simulation', text), runs.ideal_damped, runs.model, runs.task)


def figure_6(runs: Runs) -> Figure:
    """Simulation with law (35)."""
    text = law('dynamically_consistent', '35', SIMULATION_T, 1.0 / SIMULATION_T)
    return _draw(title(6, 'Simulation', text), runs.ideal_35, runs.model, runs.task)


def figure_9(runs: Runs) -> Figure:
    """Experiment with law (2), which the robot stops."""
    heading = title(9, 'Experiment', law('minimum_velocity', '2', EXPERIMENT_T))
    recording = runs.experiment_minimum_velocity.recording
    return _draw(heading, recording, runs.experiment_model, runs.task)


def figure_11(runs: Runs) -> Figure:
    """Experiment with law (23)."""
    text = law('minimum_acceleration', '23', EXPERIMENT_T, EXPERIMENT_DAMPING)
    recording = runs.experiment_damped.recording
    return _draw(title(11, 'Experiment', text), recording, runs.experiment_model, runs.task)


def figure_14(runs: Runs) -> Figure:
    """Experiment with law (35), points in reverse order."""
    text = law('dynamically_consistent', '35', EXPERIMENT_T, 1.0 / EXPERIMENT_T)
    heading = title(14, 'Experiment', f'{text}, points in reverse order')
    recording = runs.experiment_35.recording
    return _draw(heading, recording, runs.experiment_model, runs.reversed_task)


def _draw(heading: str, recording: Recording, model: RobotModel, task: WaypointTask) -> Figure:
    figure = Figure(figsize=(13.0, 7.0), layout='constrained')
    figure.suptitle(f'{heading}\n{_ending(recording)}')
    left, right = np.asarray(figure.subfigures(1, 2, width_ratios=(1.0, 1.35)))
    ax = left.add_subplot(projection='3d')
    draw_paths(ax, recording, model, task)
    ax.view_init(elev=-ELEVATION, azim=AZIMUTH - 180.0)  # as the camera sees it
    for axis in (ax.xaxis, ax.yaxis):
        axis.set_major_locator(MaxNLocator(2))
    ax.get_legend().remove()
    left.legend(*ax.get_legend_handles_labels(), loc='outside lower center', ncols=2)
    ax.set_title('(a) way of the tip (black) and of the elbow (blue)')
    _draw_pictures(right, recording, model, task)
    return figure


def _draw_pictures(
    place: SubFigure, recording: Recording, model: RobotModel, task: WaypointTask
) -> None:
    """(b): pictures of the arm along its way, or the reason why there are none."""
    ticks = np.linspace(0, len(recording.data) - 1, PICTURES[0] * PICTURES[1]).round().astype(int)
    place.suptitle('(b) the arm on its way', fontsize='large')
    try:
        pictures = render(model.arm, _film(recording, ticks, model, task))
    except RenderError as error:
        _note(place.add_subplot(), f'No pictures: {error}')
        return
    for ax, picture, t in zip(
        place.subplots(*PICTURES).flat, pictures, recording['t'][ticks], strict=True
    ):
        ax.imshow(picture)
        ax.set_title(f't = {t:.2f} s', fontsize='medium')
        ax.set_axis_off()


def _ending(recording: Recording) -> str:
    return recording.ending.replace('rad/s^2', 'rad/s²')


def _film(recording: Recording, ticks: np.ndarray, model: RobotModel, task: WaypointTask) -> Film:
    q = recording.vectors('q1')
    elbow = np.array([model.position(at, model.arm.elbow_frame) for at in q[::_EVERY]])
    return Film(
        q[ticks], ticks / max(ticks[-1], 1), recording.vectors('x')[::_EVERY], elbow, task.waypoints
    )


def _note(ax: Axes, text: str) -> None:
    ax.set_axis_off()
    ax.text(0.5, 0.5, textwrap.fill(text, 60), ha='center', va='center', color='tab:red')
