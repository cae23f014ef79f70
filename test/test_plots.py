"""The page about one motion: readable whatever the motion was."""

from pathlib import Path

import numpy as np
import pytest
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from redres_ros import RobotModel, WaypointTask
from redres_ros.errors import FileError
from redres_ros.simulation.colours import law_colour
from redres_ros.simulation.plots import draw_motion, draw_norms, save
from redres_ros.simulation.recording import Recording, columns

T = 0.01  # [s]


def motion(t: np.ndarray, acceleration: np.ndarray, model: RobotModel) -> Recording:
    """An arm that stands still, with these norms."""
    rows = np.zeros((len(t), len(columns(7))))
    rows[:, 0] = t
    rows[:, columns(7).index('joint_acceleration_norm')] = acceleration
    rows[:, columns(7).index('x')] = np.linspace(0.5, 0.6, len(t))
    return Recording(rows, 7, T, True, '')


def drawn(
    recording: Recording, model: RobotModel, task: WaypointTask, stopped: str = ''
) -> list[Axes]:
    """The panels beside the paths."""
    figure = draw_motion(recording, model, task, 'title', 'minimum_torque', stopped)
    return [ax for ax in figure.axes if ax.name != '3d']


def test_what_the_robot_stopped_does_not_hide_the_rest(
    model: RobotModel, task: WaypointTask
) -> None:
    t = T * np.arange(800)
    acceleration = np.where(t < 7.9, 5.0, 46.0)
    panel = drawn(motion(t, acceleration, model), model, task, 'protective stop')[0]
    assert 5.0 < panel.get_ylim()[1] < 15.0
    assert any('up to 46' in text.get_text() for text in panel.texts)


def test_what_happens_at_the_start_or_the_end_is_not_on_the_axis(
    model: RobotModel, task: WaypointTask
) -> None:
    t = T * np.arange(300)
    low, high = drawn(motion(t, np.ones(300), model), model, task)[0].get_xlim()
    assert low < t[0]
    assert high > t[-1]


def test_a_task_with_orientations_shows_how_well_they_are_kept(
    model: RobotModel, task: WaypointTask
) -> None:
    names = columns(7, pose=True)
    rows = np.zeros((100, len(names)))
    rows[:, names.index('t')] = T * np.arange(100)
    rows[:, names.index('orientation_error')] = 0.002
    *_, panel = drawn(Recording(rows, 7, T, True, '', pose=True), model, task)
    (curve,) = (line for line in panel.lines if line.get_label() == 'orientation [mrad]')
    assert np.asarray(curve.get_ydata()) == pytest.approx(2.0)


def test_motions_under_one_law_share_its_colour_and_differ_in_their_lines(
    model: RobotModel,
) -> None:
    still = motion(T * np.arange(3), np.zeros(3), model)
    names = ('minimum_torque, k_d = 5 1/s', 'minimum_torque, k_d = 9 1/s')
    lines = draw_norms(dict.fromkeys(names, still), '').axes[0].lines
    assert {line.get_color() for line in lines} == {law_colour('minimum_torque')}
    assert len({line.get_linestyle() for line in lines}) == 2


def test_a_picture_that_cannot_be_written_is_refused(tmp_path: Path) -> None:
    with pytest.raises(FileError, match="Format 'xyz' is not supported"):
        save(Figure(), tmp_path / 'picture.xyz')
