"""The paper's figures: all there, readable, the same every time, with or without a renderer."""

import re
from dataclasses import replace
from pathlib import Path

import matplotlib.image
import numpy as np
import pytest
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from redres_ros.errors import FileError
from redres_ros.paper import figures as figures_module
from redres_ros.paper.equivalence import PERIODS, Convergence, velocity_difference
from redres_ros.paper.experiment import Experiment
from redres_ros.paper.figures import FIGURES, draw_all, motions
from redres_ros.paper.figures.limits import torque_usage
from redres_ros.paper.figures.norms import torque_norm
from redres_ros.paper.runs import RUNS, TORQUE_SCALE, Runs
from redres_ros.paper.savgol import MeasuredMotion
from redres_ros.planning.waypoints import WaypointTask
from redres_ros.robots import Arm, find_arm
from redres_ros.simulation import render as rendering
from redres_ros.simulation.effort import acceleration_usage
from redres_ros.simulation.render import Film, RenderError, render

pytestmark = pytest.mark.nightly

FRAMES = motions.PICTURES[0] * motions.PICTURES[1]
WITH_UNITS = (
    *('[s]', '[ms]', '[m]', '[mm]', '[rad]', '[rad/s]', '[rad/s$^2$]', '[Nm]'),
    *('[-]', '[fraction of the limit]'),
)


PAGE = Path(__file__).parents[1] / 'docs' / 'the_paper.md'


def shortened(task: WaypointTask) -> WaypointTask:
    """Half of the first segment, so that a run takes a second instead of nine."""
    return replace(
        task,
        waypoints=np.array((task.waypoints[0], task.waypoints[:2].mean(axis=0))),
        segment_time=1.5,
    )


def grey_pictures(arm: Arm, film: Film) -> np.ndarray:
    return np.full((len(film.q), 6, 5, 3), 200, dtype=np.uint8)


@pytest.fixture(scope='module')
def runs() -> Runs:
    usual = Runs()
    runs = Runs(shortened(usual.task), shortened(usual.reversed_task))
    periods = np.array(PERIODS)
    for law in ('minimum_acceleration', 'minimum_weighted_torque', 'dynamically_consistent'):
        runs[f'convergence_{law}'] = Convergence(periods, periods, periods)
    return runs


class Drawn(dict[int, Figure]):
    """The figures, each drawn when a test first asks for it."""

    def __init__(self, runs: Runs) -> None:
        self._runs = runs

    def __missing__(self, number: int) -> Figure:
        with pytest.MonkeyPatch.context() as patch:
            patch.setattr(motions, 'render', grey_pictures)
            self[number] = FIGURES[number](self._runs)
        return self[number]


@pytest.fixture(scope='module')
def figures(runs: Runs) -> Drawn:
    return Drawn(runs)


def plots(figure: Figure) -> list[Axes]:
    """The axes that are no pictures."""
    return [ax for ax in figure.axes if ax.axison]


every_figure = pytest.mark.parametrize('number', FIGURES)


def test_every_figure_of_the_paper_is_there():
    assert set(range(1, 17)) <= set(FIGURES)


@every_figure
def test_a_figure_has_a_title_with_its_number(figures, number):
    titles = [
        *(text.get_text() for text in figures[number].texts),
        *(ax.get_title() for ax in figures[number].axes),
    ]
    assert any(title.startswith(f'Figure {number}. ') for title in titles)


@every_figure
def test_every_axis_is_labelled_with_its_unit(figures, number):
    for ax in plots(figures[number]):
        axes = [ax.yaxis, ax.zaxis] if hasattr(ax, 'zaxis') else [ax.yaxis]
        lowest = ax.get_subplotspec().is_last_row()  # panels above it share its time axis
        for axis in [ax.xaxis, *axes] if lowest else axes:
            assert axis.get_label_text().endswith(WITH_UNITS)


@every_figure
def test_where_there_are_several_curves_a_legend_distinguishes_them(figures, number):
    panels = plots(figures[number])
    labels = {
        str(line.get_label())
        for ax in panels
        for line in ax.lines
        if not str(line.get_label()).startswith('_')
    }
    if len(labels) > 1:
        legends = filter(None, (ax.get_legend() for ax in panels))
        shown = {text.get_text() for legend in legends for text in legend.get_texts()}
        assert labels <= shown


@every_figure
def test_no_curve_is_empty(figures, number):
    for ax in plots(figures[number]):
        for line in ax.lines:
            assert np.isfinite(np.asarray(line.get_ydata(), dtype=np.float64)).any()


@pytest.mark.parametrize('number', [3, 6, 9, 11, 14])
def test_a_motion_is_shown_as_paths_and_as_a_row_of_pictures(figures, number):
    paths = [ax for ax in figures[number].axes if ax.name == '3d']
    pictures = [ax for ax in figures[number].axes if ax.images]
    assert (len(paths), len(pictures)) == (1, FRAMES)


PANELS = {1: 1, 4: 3, 5: 1, 7: 2, 8: 1, 10: 2, 12: 2, 13: 1, 15: 2, 16: 1, 17: 3, 18: 3}


@pytest.mark.parametrize(('number', 'panels'), PANELS.items())
def test_the_panels_are_those_of_the_paper(figures, number, panels):
    assert len(figures[number].axes) == panels


def test_a_stop_is_marked_and_reported(runs, figures, monkeypatch):
    tried = runs['measured_2']
    cut = replace(tried.recording, finished=False, ending='stopped after 1.000 s: protective stop')
    stopped = Runs()
    stopped['measured_2'] = Experiment(cut, 'protective stop', tried.q)
    monkeypatch.setattr(motions, 'render', grey_pictures)
    assert 'protective stop' in FIGURES[9](stopped).texts[0].get_text()
    legend = FIGURES[10](stopped).axes[-1].get_legend()
    labels = [text.get_text() for text in legend.get_texts()]
    assert 'stopped at 1.50 s' in labels


def test_the_files_are_named_for_their_numbers_and_progress_is_reported(
    runs, tmp_path, monkeypatch
):
    monkeypatch.setattr(figures_module, 'FIGURES', {n: FIGURES[n] for n in (1, 2, 19)})
    shares: list[float] = []
    files = draw_all(tmp_path / 'new', shares.append, runs)
    assert [path.name for path in files.values()] == [
        'figure_01.png',
        'figure_02.png',
        'figure_19.png',
    ]
    assert all(min(matplotlib.image.imread(path).shape[:2]) > 500 for path in files.values())
    assert shares == sorted(shares)
    assert shares[-1] == 1.0


def test_a_place_that_cannot_be_written_is_an_error_of_ours(runs, monkeypatch):
    monkeypatch.setattr(figures_module, 'FIGURES', {2: FIGURES[2]})
    with pytest.raises(FileError, match='/proc/nowhere'):
        draw_all(Path('/proc/nowhere'), lambda share: None, runs)


def test_a_run_is_kept(runs):
    assert runs['simulated_23'] is runs['simulated_23']


# --- what is drawn --------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ('law', 'scheme'),
    [('simulated_23', 'simulated_22'), ('simulated_35', 'simulated_29')],
)
def test_laws_and_schemes_differ_by_rounding_in_simulations(runs, law, scheme):
    dq_I, dq_II = (runs[name].vectors('dq1') for name in (law, scheme))
    # the law divides nothing by T, the scheme does: 1e-16 / 1e-3 a tick
    assert velocity_difference(dq_I, dq_II).max() < 1e-10


@pytest.mark.parametrize(
    ('law', 'scheme'),
    [('measured_23_at_once', 'measured_22'), ('measured_35_at_once', 'measured_29')],
)
def test_laws_and_schemes_differ_by_their_sensors_in_experiments(runs, law, scheme):
    found = runs.difference(law, scheme)
    assert 0.0 < found.measured.max() < 0.02 * found.dq.max()
    # What the paper plots is at most the sum of what it consists of.
    parts = found.commanded + found.filtered + found.servo
    assert (found.total <= parts + 1e-12).all()


def test_everything_that_is_run_is_run_once_and_kept(monkeypatch):
    runs = Runs()
    monkeypatch.setattr(Runs, '__missing__', lambda self, name: name)
    runs.prepare(lambda share: None)
    assert runs == {name: name for name in RUNS}


def test_an_unknown_run_is_an_error(runs):
    with pytest.raises(KeyError, match='measured_99'):
        runs['measured_99']


def test_differences_are_taken_as_long_as_there_are_both():
    found = velocity_difference(np.zeros((5, 7)), np.ones((3, 7)))
    assert found == pytest.approx(np.full(3, np.sqrt(7.0)))


def test_an_arm_at_rest_needs_the_torque_of_gravity(runs):
    model = runs.experiment_model
    q = runs.task.start
    rest = MeasuredMotion(np.zeros(1), q[None], np.zeros((1, 7)), np.zeros((1, 7)))
    assert torque_norm(rest, model) == pytest.approx(
        [np.linalg.norm(model.state(q, np.zeros(7)).n)]
    )


def test_accelerating_takes_the_inertia_times_the_acceleration_on_top(runs):
    model = runs.experiment_model
    q = runs.task.start
    ddq = np.arange(1.0, 8.0)
    state = model.state(q, np.zeros(7))
    moved = MeasuredMotion(np.zeros(1), q[None], np.zeros((1, 7)), ddq[None])
    assert torque_norm(moved, model) == pytest.approx([np.linalg.norm(state.M @ ddq + state.n)])


@pytest.mark.parametrize(
    ('name', 'share', 'allowed'),
    [
        ('within_limits', acceleration_usage, 1.0),
        ('within_torques', torque_usage, TORQUE_SCALE),
    ],
)
def test_what_is_drawn_as_kept_within_limits_is(runs, name, share, allowed):
    recording = runs[name].recording
    assert share(recording, runs.experiment_model).max() <= allowed * (1.0 + 1e-6)


# --- pictures -------------------------------------------------------------------------------------


def film(runs: Runs) -> Film:
    recording = runs['simulated_23']
    return Film.of(recording, runs.model, runs.task, np.array([0, len(recording.data) - 1]))


def test_a_film_begins_without_paths_and_ends_with_all_of_them(runs):
    assert film(runs).traced == pytest.approx([0.0, 1.0])


def test_pictures_show_the_arm_move_and_are_the_same_every_time(runs):
    try:
        # without paths, which would hide different parts of the arm
        first, second = (
            render(find_arm('lwr4_paper'), replace(film(runs), traced=np.zeros(2)))
            for _ in range(2)
        )
    except RenderError as error:
        pytest.skip(str(error))
    assert first.dtype == np.uint8
    assert (first == second).all()
    red, green, blue = np.moveaxis(first.astype(int), -1, 0)
    orange = (red > 150) & (red - blue > 100) & (green < 170)  # (2, height, width) the arm's colour
    assert (orange.mean(axis=(1, 2)) > 0.01).all()
    assert (orange[0] != orange[1]).any()
    assert np.median(first) > 200  # light, not the black of an empty picture


def test_pictures_show_the_paths_grow(runs):
    try:
        still = replace(film(runs), q=np.tile(runs.task.start, (2, 1)))
        before, after = render(find_arm('lwr4_paper'), still).astype(int)
    except RenderError as error:
        pytest.skip(str(error))
    assert (before != after).any()


def test_without_a_renderer_the_figure_says_why(runs, monkeypatch):
    monkeypatch.delenv('MUJOCO_GL', raising=False)
    monkeypatch.setattr(rendering, 'BACKENDS', ('disable', 'no_such_library'))
    texts = [
        text.get_text().replace('\n', ' ') for ax in FIGURES[3](runs).axes for text in ax.texts
    ]
    (note,) = (text for text in texts if text.startswith('No pictures'))
    assert re.search('disable: .*no_such_library: .*libegl1', note)


def test_a_library_that_takes_its_process_along_is_survived(runs, monkeypatch):
    monkeypatch.setattr(rendering.sys, 'executable', '/bin/false')
    with pytest.raises(RenderError, match='ended with status 1'):
        render(find_arm('lwr4_paper'), film(runs))


def test_the_choice_of_the_environment_is_respected(runs, monkeypatch):
    monkeypatch.setenv('MUJOCO_GL', 'disable')
    with pytest.raises(RenderError, match=r'\(disable: [^;]*\);'):
        render(find_arm('lwr4_paper'), film(runs))


def test_the_page_of_the_paper_shows_every_figure_once() -> None:
    shown = re.findall(r'\]\((paper/figure_(\d+)\.webp)\)', PAGE.read_text(encoding='utf-8'))
    assert [int(number) for _, number in shown] == sorted(FIGURES)
    assert all((PAGE.parent / file).is_file() for file, _ in shown)
