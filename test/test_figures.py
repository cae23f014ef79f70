"""The paper's figures: all there and readable."""

import re
from dataclasses import replace
from pathlib import Path

import matplotlib.image
import numpy as np
import pytest
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from redres_ros.paper import figures as drawing
from redres_ros.paper.experiment import MeasuredMotion, VelocityDifference
from redres_ros.paper.figures import FIGURES, draw_all
from redres_ros.paper.runs import Runs
from redres_ros.planning.waypoints import WaypointTask

pytestmark = pytest.mark.nightly

UNITS = ('[s]', '[m]', '[rad/s]', '[rad/s$^2$]', '[Nm]')
PAGE = Path(__file__).parents[1] / 'docs' / 'the_paper.md'


def shortened(task: WaypointTask) -> WaypointTask:
    """Half of the first segment, so that a run takes a second instead of nine."""
    half = np.array((task.waypoints[0], task.waypoints[:2].mean(axis=0)))
    return replace(task, waypoints=half, segment_time=1.5)


@pytest.fixture(scope='module')
def runs() -> Runs:
    usual = Runs()
    return Runs(shortened(usual.task), shortened(usual.reversed_task))


@pytest.fixture(scope='module')
def figures(runs: Runs) -> dict[int, Figure]:
    return {number: draw(runs) for number, draw in FIGURES.items()}


def plots(figure: Figure) -> list[Axes]:
    """The axes that are no pictures."""
    return [ax for ax in figure.axes if ax.axison]


def test_every_figure_of_the_paper_is_on_its_page_once():
    assert list(FIGURES) == list(range(3, 17))  # 1 and 2 are drawings
    shown = re.findall(r'\]\((paper/figure_(\d+)\.webp)\)', PAGE.read_text(encoding='utf-8'))
    assert [int(number) for _, number in shown] == sorted(FIGURES)
    assert all((PAGE.parent / file).is_file() for file, _ in shown)


@pytest.mark.parametrize('number', FIGURES)
def test_a_figure_has_a_number_units_and_no_empty_curve(figures, number):
    figure = figures[number]
    titles = [text.get_text() for text in figure.texts] + [ax.get_title() for ax in figure.axes]
    assert any(title.startswith(f'Figure {number}. ') for title in titles)
    for ax in plots(figure):
        axes = [ax.yaxis, ax.zaxis] if hasattr(ax, 'zaxis') else [ax.yaxis]
        lowest = ax.get_subplotspec().is_last_row()  # panels above it share its time axis
        for axis in [ax.xaxis, *axes] if lowest else axes:
            assert axis.get_label_text().endswith(UNITS)
        for line in ax.lines:
            assert np.isfinite(np.asarray(line.get_ydata(), dtype=np.float64)).any()


@pytest.mark.parametrize('number', FIGURES)
def test_a_legend_distinguishes_several_curves(figures, number):
    panels = plots(figures[number])
    lines = {str(line.get_label()) for ax in panels for line in ax.lines}
    labels = {label for label in lines if not label.startswith('_')}
    if len(labels) > 1:
        legends = filter(None, (ax.get_legend() for ax in panels))
        shown = {text.get_text() for legend in legends for text in legend.get_texts()}
        assert labels <= shown


def test_a_stop_is_marked_and_reported(runs):
    tried = runs['measured_2']
    reason = 'protective stop'
    stopped = Runs()
    stopped['measured_2'] = replace(tried, ending=f'stopped: {reason}', stop_reason=reason)
    assert 'protective stop' in FIGURES[9](stopped).texts[0].get_text()
    legend = FIGURES[10](stopped).axes[-1].get_legend()
    assert 'stopped at 1.50 s' in [text.get_text() for text in legend.get_texts()]


def test_the_files_are_named_for_their_numbers_and_progress_is_reported(
    runs, tmp_path, monkeypatch
):
    monkeypatch.setattr(drawing, 'FIGURES', {n: FIGURES[n] for n in (4, 10)})
    shares: list[float] = []
    files = draw_all(tmp_path / 'new', shares.append, runs)
    assert [path.name for path in files.values()] == ['figure_04.png', 'figure_10.png']
    assert all(min(matplotlib.image.imread(path).shape[:2]) > 500 for path in files.values())
    assert shares == sorted(shares)
    assert shares[-1] == 1.0


@pytest.mark.parametrize(
    ('law', 'scheme'),
    [('measured_23_at_once', 'measured_22'), ('measured_35_at_once', 'measured_29')],
)
def test_laws_and_schemes_differ_by_their_sensors_in_experiments(runs, law, scheme):
    found = VelocityDifference.between(runs[law], runs[scheme])
    assert 0.0 < found.measured.max() < 0.02 * found.dq.max()
    # What the paper plots is at most the sum of what it consists of.
    assert (found.total <= found.commanded + found.filtered + found.servo + 1e-12).all()


def test_the_torque_of_a_motion_is_inertia_times_acceleration_and_gravity(runs):
    model = runs.experiment_model
    q = runs.task.start
    ddq = np.arange(1.0, 8.0)
    state = model.state(q, np.zeros(7))
    moved = MeasuredMotion(np.zeros(1), q[None], np.zeros((1, 7)), ddq[None])
    tau = state.M @ ddq + state.n
    assert drawing._norm('joint_torque_norm', moved, model) == pytest.approx([np.linalg.norm(tau)])
