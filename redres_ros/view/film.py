"""A film of a recorded motion: the arm on the left, its norms over time on the right."""

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from redres_ros.errors import FileError, RedresError
from redres_ros.planning.waypoints import WaypointTask
from redres_ros.robot_model import RobotModel
from redres_ros.simulation.recording import Recording
from redres_ros.simulation.render import Film, render

FORMATS = ('.mp4', '.webp', '.gif')

_RATE = {'.mp4': 20.0, '.webp': 12.5, '.gif': 12.5}  # pictures a second
_SHARE = {'.mp4': 1.0, '.webp': 0.75, '.gif': 0.6}  # of the size in which the arm is drawn
_QUALITY = 55  # of a webp, 0 to 100
_LAST = 1.5  # [s] for which the last picture stays
_DOTS = 100.0  # a matplotlib inch
_PAST = '#1f77b4'
_COMING = '#d9dde3'
_CURSOR = np.array((214, 39, 40), dtype=np.uint8)
_WAY = 100  # points of a way at most
_PLOTTED = {
    'joint_velocity_norm': 'joint velocity, norm [rad/s]',
    'joint_acceleration_norm': 'joint acceleration, norm [rad/s²]',
    'task_scaling': 'task scaling s',
}
_AT_LEAST = {'joint_velocity_norm': 1.0, 'joint_acceleration_norm': 10.0, 'task_scaling': 1.1}


class FilmError(RedresError):
    """A film that cannot be made."""


def check_film(path: Path) -> None:
    """Raise FilmError for a format that is not known."""
    if path.suffix not in FORMATS:
        raise FilmError(f'the film {path}; expected a name that ends in {", ".join(FORMATS)}')


def write_film(
    recording: Recording, model: RobotModel, task: WaypointTask, title: str, path: Path
) -> None:
    """Write a film in real time.

    Args:
        recording: The motion.
        model: Of the arm that moved.
        task: What it was to do.
        title: Above the plots.
        path: Of the file; its ending is one of FORMATS.

    Raises:
        FilmError: For another ending.
        RenderError: No picture of the arm can be drawn here.
        FileError: The file cannot be written.
    """
    check_film(path)
    ticks = _ticks(recording, _RATE[path.suffix])
    arm = render(model.arm, _scene(recording, model, task, ticks))
    plots = _Plots(recording, title, arm.shape[1:3])
    share = _SHARE[path.suffix]
    pictures = (
        _scaled(np.concatenate((shot, plots.at(tick)), axis=1), share)
        for shot, tick in zip(arm, ticks, strict=True)
    )
    try:
        if path.suffix == '.mp4':
            _write_video(path, pictures)
        else:
            _write_animation(path, list(pictures))
    except OSError as error:
        raise FileError(f'cannot write {path}: {error.strerror or error}') from None


def _ticks(recording: Recording, rate: float) -> np.ndarray:
    """The row of each picture, (N,); the last one stays for a while."""
    t = recording['t']
    times = np.arange(t[0], t[-1] + _LAST, 1.0 / rate)
    rows: np.ndarray = np.minimum(np.searchsorted(t, times), len(t) - 1)
    return rows


def _scene(recording: Recording, model: RobotModel, task: WaypointTask, ticks: np.ndarray) -> Film:
    q = recording.vectors('q1')
    rows = np.linspace(0, len(q) - 1, min(_WAY, len(q))).astype(int)
    elbow = np.zeros((0, 3))
    if model.arm.elbow_frame:
        elbow = np.array([model.position(q[row], model.arm.elbow_frame) for row in rows])
    return Film(
        q=q[ticks],
        traced=ticks / max(len(q) - 1, 1),
        tip=recording.vectors('x')[rows],
        elbow=elbow,
        points=task.waypoints,
    )


class _Plots:
    """The plots, whose curves grow: all of them are drawn twice, as the future and as the past."""

    def __init__(self, recording: Recording, title: str, size: tuple[int, int]) -> None:
        self._t = recording['t']
        self._coming, corners = _draw(recording, title, size, _COMING)
        self._past, _ = _draw(recording, title, size, _PAST)
        self._columns = corners[:, 0]
        self._rows = (size[0] - corners[:, 1]).astype(int)  # of pixels, counted from above

    def at(self, tick: int) -> np.ndarray:
        """The picture (height, width, 3) at a row of the recording."""
        first, last = self._columns
        top, bottom = self._rows
        share = (self._t[tick] - self._t[0]) / max(self._t[-1] - self._t[0], 1e-9)
        column = round(first + share * (last - first))
        picture = self._coming.copy()
        picture[:, :column] = self._past[:, :column]
        cursor = picture[top:bottom, column : column + 2]
        cursor[:] = _CURSOR // 2 + cursor // 2
        return picture


def _draw(
    recording: Recording, title: str, size: tuple[int, int], colour: str
) -> tuple[np.ndarray, np.ndarray]:
    """The plots (height, width, 3), and two of their corners (2, 2) [pixels from below].

    One is where time begins, above all plots, the other where it ends, below them.
    """
    height, width = size
    figure = Figure(figsize=(width / _DOTS, height / _DOTS), dpi=_DOTS)
    figure.subplots_adjust(left=0.13, right=0.95, top=0.86, bottom=0.09, hspace=0.42)
    figure.text(0.5, 0.955, title, ha='center', va='center', fontsize=9.5, wrap=True)
    panels: Any = figure.subplots(len(_PLOTTED), 1, sharex=True)
    for ax, (name, label) in zip(panels, _PLOTTED.items(), strict=True):
        _draw_curve(ax, recording, name, label, colour)
    panels[-1].set_xlabel('time [s]', fontsize=8)
    canvas = FigureCanvasAgg(figure)
    canvas.draw()
    t = recording['t']
    top = panels[0].get_window_extent().y1
    begin, end = panels[-1].transData.transform(((t[0], 0.0), (t[-1], 0.0)))
    corners = np.array(((begin[0], top), (end[0], end[1])))
    return np.asarray(canvas.buffer_rgba())[:, :, :3].copy(), corners


def _draw_curve(ax: Axes, recording: Recording, name: str, label: str, colour: str) -> None:
    t = recording['t']
    values = recording[name]
    ax.plot(t, values, color=colour, lw=1.6)
    ax.set_title(label, fontsize=8.5, loc='left')
    ax.set_xlim(t[0], max(t[-1], t[0] + recording.T))
    ax.set_ylim(0.0, max(_AT_LEAST[name], 1.05 * float(values.max())))
    ax.tick_params(labelsize=7.5)
    ax.grid(alpha=0.25)


def _scaled(picture: np.ndarray, share: float) -> np.ndarray:
    """A picture of another size, with even edges as films need them."""
    from PIL import Image

    height, width = (2 * round(share * edge / 2) for edge in picture.shape[:2])
    image = Image.fromarray(picture)
    return np.asarray(image.resize((width, height), Image.Resampling.LANCZOS))


def _write_video(path: Path, pictures: Iterator[np.ndarray]) -> None:
    import imageio_ffmpeg

    first = next(pictures)
    height, width = first.shape[:2]
    writer = imageio_ffmpeg.write_frames(
        str(path), (width, height), fps=_RATE['.mp4'], macro_block_size=2, quality=7
    )
    writer.send(None)
    writer.send(np.ascontiguousarray(first))
    for picture in pictures:
        writer.send(np.ascontiguousarray(picture))
    writer.close()


def _write_animation(path: Path, pictures: list[np.ndarray]) -> None:
    from PIL import Image

    images = [Image.fromarray(picture) for picture in pictures]
    images[0].save(
        path,
        save_all=True,
        append_images=images[1:],
        duration=round(1000.0 / _RATE[path.suffix]),
        loop=0,
        quality=_QUALITY,
        method=4,
    )
