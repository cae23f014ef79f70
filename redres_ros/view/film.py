"""A film of a recorded motion beside its norms, or of several side by side above one figure."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from redres_ros.files.text import writing
from redres_ros.planning.waypoints import WaypointTask
from redres_ros.robot_model import RobotModel
from redres_ros.simulation.colours import AXES, law_colour
from redres_ros.simulation.recording import Recording
from redres_ros.simulation.render import Film, render

_RATE = {'.mp4': 20.0, '.webp': 12.5, '.gif': 12.5}  # pictures a second
_FRACTION = {'.mp4': 1.0, '.webp': 0.75, '.gif': 0.6}  # of the size in which the arm is drawn
_QUALITY = 55  # of a webp, 0 to 100
_LAST = 1.5  # [s] for which the last picture stays
_DOTS = 100.0  # a matplotlib inch
_COMING = '#d9dde3'
_CURSOR = np.array((214, 39, 40), dtype=np.uint8)
_NORMS = ('joint_velocity_norm', 'joint_acceleration_norm', 'task_scaling')  # of one motion
_COMPARED_HEIGHT = 0.4  # of the plot of several motions, for that of the arm
_BANNER = 44  # height [pixels]
_STOPPED = '#d62728'


@dataclass(frozen=True)
class FilmedMotion:
    """A motion in a film.

    Attributes:
        recording: The motion.
        title: Above its plots, or above its arm.
        law: Law whose colour the curves have.
    """

    recording: Recording
    title: str
    law: str


def write_film(
    motions: Sequence[FilmedMotion],
    model: RobotModel,
    task: WaypointTask,
    path: Path,
    compared: str = 'joint_acceleration_norm',
) -> None:
    """Write a film in real time.

    Args:
        motions: One, or several that are shown side by side.
        model: Model of the arm that moved.
        task: Its task.
        path: Path of the file; its ending is .mp4, .webp or .gif.
        compared: The column that is plotted below several motions.

    Raises:
        RenderError: No picture of the arm can be drawn here.
        FileError: The file cannot be written.
    """
    end = max(motion.recording['t'][-1] for motion in motions)
    start = min(motion.recording['t'][0] for motion in motions)
    times = np.arange(start, end + _LAST, 1.0 / _RATE[path.suffix])
    films = [
        Film.of(motion.recording, model, task, motion.recording.rows_at(times))
        for motion in motions
    ]
    arms = [render(model.arm, film) for film in films]
    if len(motions) == 1:
        frames = _one(motions[0], arms[0], times)
    else:
        frames = _several(motions, arms, times, compared)
    pictures = (_scaled(frame, _FRACTION[path.suffix]) for frame in frames)
    with writing(path):
        if path.suffix == '.mp4':
            _write_video(path, pictures)
        else:
            _write_animation(path, list(pictures))


def _one(motion: FilmedMotion, arm: np.ndarray, times: np.ndarray) -> Iterator[np.ndarray]:
    """The arm with its plots on the right."""
    plots = _Plots([motion], _NORMS, arm.shape[1:3], motion.title)
    for shot, t in zip(arm, times, strict=True):
        yield np.concatenate((shot, plots.at(t)), axis=1)


def _several(
    motions: Sequence[FilmedMotion], arms: Sequence[np.ndarray], times: np.ndarray, compared: str
) -> Iterator[np.ndarray]:
    """The arms beside each other, under what became of each, with one plot below."""
    height, width = arms[0].shape[1:3]
    size = (round(_COMPARED_HEIGHT * height), len(arms) * width)
    plots = _Plots(motions, (compared,), size)
    banners = [_Banner(motion, width) for motion in motions]
    for shots, t in zip(zip(*arms, strict=True), times, strict=True):
        columns = [
            np.concatenate((banner.at(t), shot), axis=0)
            for banner, shot in zip(banners, shots, strict=True)
        ]
        yield np.concatenate((np.concatenate(columns, axis=1), plots.at(t)), axis=0)


class _Banner:
    """The title of a motion, and how it ended once it has."""

    def __init__(self, motion: FilmedMotion, width: int) -> None:
        recording = motion.recording
        ending = recording.ending.partition(':')[0]
        self._end = recording['t'][-1]
        self._moving = _text(motion.title, width, law_colour(motion.law))
        colour = law_colour(motion.law) if recording.finished else _STOPPED
        self._ended = _text(f'{motion.title}: {ending}', width, colour)

    def at(self, t: float) -> np.ndarray:
        """The picture (height, width, 3) at the time t [s]."""
        return self._moving if t < self._end else self._ended


def _text(text: str, width: int, colour: str) -> np.ndarray:
    """White letters on a colour, (height, width, 3)."""
    figure = Figure(figsize=(width / _DOTS, _BANNER / _DOTS), dpi=_DOTS, facecolor=colour)
    figure.text(0.5, 0.48, text, color='white', ha='center', va='center', fontsize=10.5)
    return _drawn(figure)


def _drawn(figure: Figure) -> np.ndarray:
    """The pixels (height, width, 3) of a figure."""
    canvas = FigureCanvasAgg(figure)
    canvas.draw()
    return np.asarray(canvas.buffer_rgba())[:, :, :3].copy()


class _Plots:
    """The plots, whose curves grow: all of them are drawn twice, as the future and as the past."""

    def __init__(
        self,
        motions: Sequence[FilmedMotion],
        norms: Sequence[str],
        size: tuple[int, int],
        title: str = '',
    ) -> None:
        self._start = min(motion.recording['t'][0] for motion in motions)
        self._end = max(motion.recording['t'][-1] for motion in motions)
        self._coming, _ = self._draw(motions, norms, size, title, _COMING)
        self._past, corners = self._draw(motions, norms, size, title)
        self._columns = corners[:, 0]
        self._pixel_rows = (size[0] - corners[:, 1]).astype(int)  # counted from above

    def at(self, t: float) -> np.ndarray:
        """The picture (height, width, 3) at the time t [s]."""
        first, last = self._columns
        top, bottom = self._pixel_rows
        fraction = (min(t, self._end) - self._start) / max(self._end - self._start, 1e-9)
        column = round(first + fraction * (last - first))
        picture = self._coming.copy()
        picture[:, :column] = self._past[:, :column]
        cursor = picture[top:bottom, column : column + 2]
        cursor[:] = _CURSOR // 2 + cursor // 2
        return picture

    def _draw(
        self,
        motions: Sequence[FilmedMotion],
        norms: Sequence[str],
        size: tuple[int, int],
        title: str,
        colour: str = '',
    ) -> tuple[np.ndarray, np.ndarray]:
        """The plots (height, width, 3), and two of their corners (2, 2) [pixels from below].

        One is where time begins, above all plots, the other where it ends, below them.
        """
        height, width = size
        figure = Figure(figsize=(width / _DOTS, height / _DOTS), dpi=_DOTS, layout='constrained')
        if title:
            figure.suptitle(title, fontsize=9.5, wrap=True)
        panels = list(np.atleast_1d(figure.subplots(len(norms), 1, sharex=True)))
        for ax, norm in zip(panels, norms, strict=True):
            self._draw_norm(ax, norm, motions, colour)
        panels[-1].set_xlabel('time [s]', fontsize=8)
        picture = _drawn(figure)
        top = panels[0].get_window_extent().y1
        begin, end = panels[-1].transData.transform(((self._start, 0.0), (self._end, 0.0)))
        return picture, np.array(((begin[0], top), (end[0], end[1])))

    def _draw_norm(self, ax: Axes, norm: str, motions: Sequence[FilmedMotion], colour: str) -> None:
        """One norm of every motion, in a colour or, if there is none, in that of its law."""
        highest = AXES[norm].least
        for motion in motions:
            values = motion.recording[norm]
            highest = max(highest, 1.05 * float(values.max()))
            color = colour or law_colour(motion.law)
            ax.plot(motion.recording['t'], values, color=color, lw=1.6)
        ax.set_title(AXES[norm].title, fontsize=8.5, loc='left')
        ax.set_xlim(self._start, max(self._end, self._start + motions[0].recording.T))
        ax.set_ylim(0.0, highest)
        ax.tick_params(labelsize=7.5)
        ax.grid(alpha=0.25)


def _scaled(picture: np.ndarray, fraction: float) -> np.ndarray:
    """A picture of another size, with even edges as films need them."""
    from PIL import Image

    height, width = (2 * round(fraction * edge / 2) for edge in picture.shape[:2])
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
