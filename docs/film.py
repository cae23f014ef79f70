"""Films docs/demo.webp: the paper's task, stopped under a greedy law, and looking ahead.

Run it with: python docs/film.py
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from PIL import Image
from render import render

from redres_ros import Controller, make_law, run
from redres_ros.paper.runs import MOTIONS, Runs
from redres_ros.simulation.colours import AXES, law_colour
from redres_ros.simulation.recording import Recording

COLUMN = 'joint_acceleration_norm'
RATE = 12.5  # pictures a second
FRACTION = 0.75  # of the size in which the arm is drawn
LAST = 1.5  # [s] for which the last picture stays
DOTS = 100.0  # a matplotlib inch
COMING = '#d9dde3'
STOPPED = '#d62728'
CURSOR = np.array((214, 39, 40), dtype=np.uint8)
PLOT_HEIGHT = 0.4  # of the arm's
BANNER = 44  # height [pixels]


@dataclass(frozen=True)
class FilmedMotion:
    """A motion, the title above its arm, and the law whose colour it has."""

    recording: Recording
    title: str
    law: str

    def banner(self, width: int, t: float) -> np.ndarray:
        """The title at the time t [s], and how the motion ended once it has."""
        text = self.title
        colour = law_colour(self.law)
        if t >= self.recording['t'][-1]:
            text += f': {self.recording.ending.partition(":")[0]}'
            colour = colour if self.recording.finished else STOPPED
        figure = Figure(figsize=(width / DOTS, BANNER / DOTS), dpi=DOTS, facecolor=colour)
        figure.text(0.5, 0.48, text, color='white', ha='center', va='center', fontsize=10.5)
        return drawn(figure)


def main() -> None:
    """Run the two experiments and film them, in real time, above a plot of a column of both."""
    runs = Runs()
    greedy = MOTIONS['measured_2'].law
    law = make_law('minimum_acceleration', horizon=2.0)
    ahead = run(Controller(runs.experiment_model, law, 0.002), runs.task)
    motions = [
        FilmedMotion(runs['measured_2'], greedy, greedy),
        FilmedMotion(ahead, 'minimum_acceleration, 2 s ahead', 'minimum_acceleration'),
    ]
    end = max(motion.recording['t'][-1] for motion in motions)
    times = np.arange(0.0, end + LAST, 1.0 / RATE)
    arms = []
    for motion in motions:
        last = len(motion.recording.data) - 1
        ticks = np.minimum(np.searchsorted(motion.recording['t'], times), last)
        arms.append(render(runs.experiment_model, motion.recording, runs.task, ticks))
    images = [scaled(picture) for picture in pictures(motions, arms, times, COLUMN)]
    images[0].save(
        Path(__file__).with_name('demo.webp'),
        save_all=True,
        append_images=images[1:],
        duration=round(1000.0 / RATE),
        loop=0,
        quality=55,
        method=4,
    )


def pictures(
    motions: Sequence[FilmedMotion], arms: Sequence[np.ndarray], times: np.ndarray, norm: str
) -> Iterator[np.ndarray]:
    """The arms beside each other, each under its title, above the plot up to that time."""
    height, width = arms[0].shape[1:3]
    size = (round(PLOT_HEIGHT * height), len(arms) * width)
    coming, _, _ = plot(motions, norm, size, COMING)
    past, first, last = plot(motions, norm, size)
    end = max(motion.recording['t'][-1] for motion in motions)
    for shots, t in zip(zip(*arms, strict=True), times, strict=True):
        column = round(first + min(t / end, 1.0) * (last - first))
        picture = coming.copy()
        picture[:, :column] = past[:, :column]
        picture[:, column : column + 2] = CURSOR
        columns = [
            np.concatenate((motion.banner(width, t), shot))
            for motion, shot in zip(motions, shots, strict=True)
        ]
        yield np.concatenate((np.concatenate(columns, axis=1), picture))


def plot(
    motions: Sequence[FilmedMotion], norm: str, size: tuple[int, int], colour: str = ''
) -> tuple[np.ndarray, float, float]:
    """The plot of all motions, and the columns of pixels at which time begins and ends."""
    height, width = size
    figure = Figure(figsize=(width / DOTS, height / DOTS), dpi=DOTS, layout='constrained')
    ax = figure.add_subplot()
    end = max(motion.recording['t'][-1] for motion in motions)
    for motion in motions:
        t = motion.recording['t']
        ax.plot(t, motion.recording[norm], color=colour or law_colour(motion.law), lw=1.6)
    ax.set_title(AXES[norm][0], fontsize=8.5, loc='left')
    ax.set_xlabel('time [s]', fontsize=8)
    ax.set(xlim=(0.0, end), ylim=(0.0, None))
    ax.tick_params(labelsize=7.5)
    ax.grid(alpha=0.25)
    picture = drawn(figure)
    (first, _), (last, _) = ax.transData.transform(((0.0, 0.0), (end, 0.0)))
    return picture, first, last


def drawn(figure: Figure) -> np.ndarray:
    """The pixels (height, width, 3) of a figure."""
    canvas = FigureCanvasAgg(figure)
    canvas.draw()
    return np.asarray(canvas.buffer_rgba())[:, :, :3].copy()


def scaled(picture: np.ndarray) -> Image.Image:
    """A picture of another size."""
    height, width = (round(FRACTION * edge) for edge in picture.shape[:2])
    return Image.fromarray(picture).resize((width, height), Image.Resampling.LANCZOS)


if __name__ == '__main__':
    main()
