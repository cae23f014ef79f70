"""The page about one motion: readable whatever the motion was."""

from pathlib import Path

import numpy as np
import pytest
from matplotlib.figure import Figure

from redres_ros import RobotModel, WaypointTask
from redres_ros.errors import FileError
from redres_ros.simulation import plots
from redres_ros.simulation.colours import law_colour, line_styles
from redres_ros.simulation.plots import (
    Remarks,
    draw_motion,
    save,
)
from redres_ros.simulation.recording import Recording, columns

T = 0.01  # [s]


def motion(t: np.ndarray, acceleration: np.ndarray, model: RobotModel) -> Recording:
    """An arm that stands still, with these norms."""
    rows = np.zeros((len(t), len(columns(7))))
    rows[:, 0] = t
    rows[:, columns(7).index('joint_acceleration_norm')] = acceleration
    rows[:, columns(7).index('x')] = np.linspace(0.5, 0.6, len(t))
    return Recording(rows, 7, T, True, '')


@pytest.fixture
def page(monkeypatch: pytest.MonkeyPatch) -> list[Figure]:
    """What is drawn, in place of files."""
    drawn: list[Figure] = []
    monkeypatch.setattr(plots, 'save', lambda figure, path: drawn.append(figure))
    return drawn


def draw(recording: Recording, model: RobotModel, task: WaypointTask, **remarks: object) -> None:
    draw_motion(recording, model, task, 'title', Path('unused.png'), Remarks({}, **remarks))


def norms(page: list[Figure]) -> list:
    """The three panels beside the paths."""
    return [ax for ax in page[0].axes if ax.name != '3d']


def test_what_the_robot_stopped_does_not_hide_the_rest(
    page: list[Figure], model: RobotModel, task: WaypointTask
) -> None:
    t = T * np.arange(800)
    acceleration = np.where(t < 7.9, 5.0, 46.0)
    draw(motion(t, acceleration, model), model, task, stopped='protective stop')
    panel = norms(page)[0]
    assert 5.0 < panel.get_ylim()[1] < 15.0
    assert any('up to 46' in text.get_text() for text in panel.texts)


def test_a_repeated_task_is_shown_from_its_first_round_to_its_last(
    page: list[Figure], model: RobotModel, task: WaypointTask
) -> None:
    rounds = np.concatenate([start + T * np.arange(300) for start in (0.0, 60.0, 590.0)])
    draw(motion(rounds, np.ones(900), model), model, task)
    panel = norms(page)[0]
    (curve,) = panel.lines
    shown = np.asarray(curve.get_xdata())
    assert (np.nanmin(shown), np.nanmax(shown)) == (rounds[0], rounds[-1])
    assert np.isnan(shown).sum() == 2  # no line across the time between two rounds
    low, high = panel.get_xlim()
    assert low < 0.0  # what happens at the very start is not on the axis
    assert high > rounds[-1]


def test_a_task_with_orientations_shows_how_well_they_are_kept(
    page: list[Figure], model: RobotModel, task: WaypointTask
) -> None:
    names = columns(7, pose=True)
    rows = np.zeros((100, len(names)))
    rows[:, names.index('t')] = T * np.arange(100)
    rows[:, names.index('orientation_error')] = 0.002
    draw(Recording(rows, 7, T, True, '', pose=True), model, task)
    *_, panel = norms(page)
    (curve,) = (line for line in panel.lines if line.get_label() == 'orientation [mrad]')
    assert np.asarray(curve.get_ydata()) == pytest.approx(2.0)


def test_motions_under_one_law_share_its_colour_and_differ_in_their_lines() -> None:
    styles = line_styles(['minimum_torque, k_d = 5 1/s', 'minimum_torque, k_d = 9 1/s'])
    assert {style['color'] for style in styles.values()} == {law_colour('minimum_torque')}
    assert len({style['ls'] for style in styles.values()}) == 2


def test_a_switch_is_named_and_the_curve_changes_its_colour_with_the_law(
    page: list[Figure], model: RobotModel, task: WaypointTask
) -> None:
    t = T * np.arange(800)
    switch = (4.0, 'minimum_velocity', 'minimum_torque')
    draw(motion(t, np.ones(800), model), model, task, law=switch[1], switches=(switch,))
    assert 'from minimum_velocity to minimum_torque' in page[0].get_suptitle()
    first, second = norms(page)[0].lines[:2]
    assert first.get_color() == law_colour('minimum_velocity')
    assert second.get_color() == law_colour('minimum_torque')
    assert not np.isfinite(first.get_ydata()[t > 4.0]).any()
    assert not np.isfinite(second.get_ydata()[t < 4.0]).any()


def test_a_picture_that_cannot_be_written_is_refused(tmp_path: Path) -> None:
    with pytest.raises(FileError, match="Format 'xyz' is not supported"):
        save(Figure(), tmp_path / 'picture.xyz')
