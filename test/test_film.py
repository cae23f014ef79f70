"""Films and pages of a recorded motion."""

from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

pytest.importorskip('mujoco', reason='needs the extra fake')

from redres_ros import Controller, RobotModel, load_task, make_law
from redres_ros.cli import main
from redres_ros.robots import Arm
from redres_ros.simulation.closed_loop import run
from redres_ros.simulation.render import Film
from redres_ros.view import film

pytestmark = pytest.mark.slow

SIZE = (300, 240)


@pytest.fixture(scope='module')
def motion() -> SimpleNamespace:
    model = RobotModel.named('planar4r')
    task = load_task('planar4r_hexagon')
    whole = run(Controller(model, make_law('minimum_velocity'), 0.02), task)
    recording = replace(whole, data=whole.data[:80])
    filmed = film.FilmedMotion(recording, 'a title', 'minimum_velocity')
    return SimpleNamespace(model=model, task=task, recording=recording, filmed=filmed)


@pytest.fixture
def shown(monkeypatch: pytest.MonkeyPatch) -> list[Film]:
    """What is asked to be drawn, without a graphics library."""
    films: list[Film] = []

    def render(arm: Arm, wanted: Film) -> np.ndarray:
        films.append(wanted)
        greys = np.linspace(0, 250, len(wanted.q)).astype(np.uint8)
        return np.broadcast_to(greys[:, None, None, None], (len(wanted.q), *SIZE, 3))

    monkeypatch.setattr(film, 'render', render)
    return films


def test_a_film_shows_the_motion_from_its_start_to_its_end(
    motion: SimpleNamespace, shown: list[Film], tmp_path: Path
) -> None:
    image = pytest.importorskip('PIL.Image')
    path = tmp_path / 'film.webp'
    film.write_film([motion.filmed], motion.model, motion.task, path)
    q = motion.recording.vectors('q1')
    assert (shown[0].q[0] == q[0]).all() and (shown[0].q[-1] == q[-1]).all()
    assert shown[0].traced[0] == 0.0 and shown[0].traced[-1] == 1.0
    written = image.open(path)
    assert written.size == (2 * round(0.75 * SIZE[1]), 2 * round(0.75 * SIZE[0] / 2))
    assert written.n_frames > 10


def test_a_film_is_as_long_as_the_motion(
    motion: SimpleNamespace, shown: list[Film], tmp_path: Path
) -> None:
    ffmpeg = pytest.importorskip('imageio_ffmpeg')
    path = tmp_path / 'film.mp4'
    film.write_film([motion.filmed], motion.model, motion.task, path)
    frames, seconds = ffmpeg.count_frames_and_secs(str(path))
    assert frames == len(shown[0].q)
    assert motion.recording['t'][-1] < seconds < motion.recording['t'][-1] + 3.0


def test_curves_grow_with_time(motion: SimpleNamespace) -> None:
    t = motion.recording['t']
    plots = film._Plots([motion.filmed], ('joint_velocity_norm',), (300, 240))
    first, half, last = (plots.at(t[row]) for row in (0, len(t) // 2, -1))
    assert (half[:, :100] == last[:, :100]).all()
    assert (half[:, -60:] == first[:, -60:])[:, :50].all()
    assert (first != last).any()


def test_motions_side_by_side_end_each_at_its_own_time(
    motion: SimpleNamespace, shown: list[Film], tmp_path: Path
) -> None:
    image = pytest.importorskip('PIL.Image')
    short = replace(motion.recording, data=motion.recording.data[:40])
    other = film.FilmedMotion(short, 'another', 'minimum_torque')
    path = tmp_path / 'film.webp'
    film.write_film([motion.filmed, other], motion.model, motion.task, path)
    assert len(shown[0].q) == len(shown[1].q)  # pictures
    assert (shown[1].q[-1] == short.vectors('q1')[-1]).all()
    width, height = image.open(path).size
    assert width == 2 * round(0.75 * 2 * SIZE[1] / 2)
    assert height > SIZE[0]


def test_a_page_replays_the_motion_without_asking_anybody(
    motion: SimpleNamespace, tmp_path: Path
) -> None:
    pytest.importorskip('viser', reason='needs the extra view')
    from redres_ros.view.saved import write_page

    path = tmp_path / 'page.html'
    write_page(motion.recording, motion.model, motion.task, 'a title', path)
    page = path.read_text()
    assert "content=\"default-src 'none'" in page and '__VISER_EMBED_DATA__="' in page
    assert page.index('Content-Security-Policy') < page.index('<script')


@pytest.mark.parametrize(
    ('option', 'said'),
    [
        (['--save', 'film.avi'], 'ends in one of .mp4, .webp, .gif, .html, .mcap'),
        (['--save', '/dev/null/film.mp4'], 'cannot write /dev/null/film.mp4'),
        (['--save', 'film.gif', '/dev/null/page.html'], 'cannot write /dev/null/page.html'),
        (['--save', 'a.mcap', 'b.mcap'], 'the messages go to a.mcap already'),
        (['--save', '/dev/null/page.html'], 'cannot write /dev/null/page.html'),
    ],
)
def test_a_file_that_cannot_be_made_is_refused_before_anything_runs(
    option: list[str],
    said: str,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.chdir(tmp_path)
    assert main(['demo', *option]) == 1
    assert said in capsys.readouterr().err
