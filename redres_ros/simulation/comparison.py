"""Laws side by side on one task: `compare`, and tables and plots of what each demands."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure
from rich.console import Console
from rich.table import Table

from redres_ros.controller import Controller
from redres_ros.errors import ArrayError
from redres_ros.laws import Law, law_name, make_law
from redres_ros.limits import Limit
from redres_ros.parameter import as_tuple
from redres_ros.planning.waypoints import WaypointTask, load_task
from redres_ros.robot_model import RobotModel
from redres_ros.simulation.closed_loop import run
from redres_ros.simulation.colours import line_styles
from redres_ros.simulation.drawing import NORMS, in_symbols, legend_below, save, time_panels
from redres_ros.simulation.effort import Effort, acceleration_usage, velocity_usage
from redres_ros.simulation.recording import Recording
from redres_ros.simulation.report import PEAKS, table

_WIDTH = 160  # columns of a table

# A norm is drawn on a logarithmic scale if its largest peak is so many times the median one
_WIDE = 10.0
_SHOWN = 1e4  # the range of such a scale

_HIGHEST = 3.0  # fraction of a limit that is shown
_ABOVE = 1.1  # of the highest curve, or of the limit, the axis ends

_ALIKE = 1.05  # ratio of two peaks that hardly differ

_WHOLE = {  # figures of Effort, and their heads
    'squared_acceleration': 'int ddq^2 [rad^2/s^3]',
    'squared_torque': 'int tau^2 [Nm^2 s]',
    'kinetic_energy': 'int energy [J s]',
    'elbow': 'elbow path [m]',
}


@dataclass(frozen=True)
class Comparison:
    """Laws on one task, by their labels; `print` shows tables."""

    recordings: dict[str, Recording]
    efforts: dict[str, Effort]
    title: str

    def __str__(self) -> str:
        console = Console(width=_WIDTH, no_color=True)
        with console.capture() as capture:
            for table in tables(self.efforts, self.title):
                console.print(table)
        return capture.get()


def compare(
    laws: str | Iterable[str | Law],
    task: str | Path | WaypointTask = 'rectangle',
    *,
    T: float = 0.002,
    limits: str | Iterable[str | Limit] = (),
    model: RobotModel | None = None,
) -> Comparison:
    """Laws side by side on one task, in the ideal loop. Raises RedresError.

    Args:
        laws: Names in LAWS, or laws with gains of their own.
        task: A name in config/tasks, a path of a YAML file, or a task.
        T: Sampling time [s].
        limits: Names in LIMITS, or limits, that are kept.
        model: The arm; None: that of the task.
    """
    if not isinstance(task, WaypointTask):
        task = load_task(str(task))
    model = model or RobotModel.named(task.robot)
    limits = as_tuple(limits)
    recordings = {}
    for each in as_tuple(laws):
        law = make_law(each) if isinstance(each, str) else each
        controller = Controller(model, law, T, limits=limits)
        recordings[label(law)] = run(controller, task, greedy=False)
    if not recordings:
        raise ArrayError('laws is empty; expected at least one')
    efforts = {name: Effort.of(recording, model) for name, recording in recordings.items()}
    return Comparison(recordings, efforts, f'{task.robot}, T = {1e3 * T:g} ms')


def plot(
    what: Comparison | Recording | Mapping[str, Recording], path: str | Path | None = None
) -> Figure:
    """The norms of motions over time: acceleration, velocity, null-space part and torque.

    Args:
        what: A comparison, one recording, or several by name.
        path: Where to write it; None: nowhere, as in a notebook, which shows what is returned.

    Raises:
        ArrayError: There is no motion.
        FileError: The file cannot be written.
    """
    if isinstance(what, Comparison):
        figure = picture(what.recordings, what.title)
    elif isinstance(what, Recording):
        figure = picture({'motion': what}, what.ending)
    elif what:
        figure = picture(what, '')
    else:
        raise ArrayError('there is no motion to draw; expected at least one')
    if path is not None:
        save(figure, Path(path))
    return figure


def label(law: Law) -> str:
    """The label of a law in tables and plots, such as 'minimum_acceleration, k_d = 5 1/s'."""
    if not law.has_memory:
        return law_name(law)
    return f'{law_name(law)}, k_d = {plain(law.damping)} 1/s'


def plain(number: float) -> str:
    """The shortest text that identifies the number."""
    return repr(float(number)).removesuffix('.0')


def tables(efforts: Mapping[str, Effort], title: str) -> tuple[Table, Table]:
    """The worst moments, with the arm's limits, and the whole motion; one row a law."""
    marked = {name: _marked(efforts, name) for name in (*PEAKS, *_WHOLE)}
    worst = []
    whole = []
    for law, effort in efforts.items():
        within = f'no: {effort.violation}' if effort.violation else 'yes'
        worst.append([law, *(marked[name][law] for name in PEAKS), within])
        whole.append([law, *(marked[name][law] for name in _WHOLE)])
    notes = filter(None, ('* least', conclusion(efforts)))
    unfinished = [f'{law}: {each.ending}' for law, each in efforts.items() if not each.finished]
    return (
        table(['law', *PEAKS.values(), 'within the limits?'], worst, title=title),
        table(['law', *_WHOLE.values()], whole, note='\n'.join([*notes, *unfinished])),
    )


def _marked(efforts: Mapping[str, Effort], name: str) -> dict[str, str]:
    """One figure of every law as text, the least of them with a star."""
    values = {law: getattr(effort, name) for law, effort in efforts.items()}
    shown = {law: f'{value:.4g}' for law, value in values.items()}
    least = shown[min(values, key=values.__getitem__)]
    return {law: f'{text}{"*" if text == least else " "}' for law, text in shown.items()}


def conclusion(efforts: Mapping[str, Effort]) -> str:
    """The conclusion of a comparison of efforts by law, in a line; empty for a single law."""
    peaks = {law: effort.acceleration for law, effort in efforts.items() if effort.finished}
    if len(peaks) < 2:
        return ''
    best = min(peaks, key=peaks.__getitem__)
    worst = max(peaks, key=peaks.__getitem__)
    if peaks[worst] < _ALIKE * peaks[best]:
        return (
            'The peaks of acceleration hardly differ: on this task the law does not matter. '
            'It may where a path passes a singularity in motion.'
        )
    ratio = peaks[worst] / peaks[best]
    return f'The largest acceleration with {worst} is {ratio:.2g} times that with {best}.'


def picture(recordings: Mapping[str, Recording], title: str) -> Figure:
    """The norms of all laws over time, one panel a norm."""
    figure, axes = time_panels(len(NORMS), title, (11.0, 9.0))
    styles = line_styles(list(recordings))
    for ax, (norm, label) in zip(axes, NORMS.items(), strict=True):
        for name, recording in recordings.items():
            ax.plot(recording['t'], recording[norm], label=in_symbols(name), **styles[name])
        ax.set_ylabel(label, fontsize='small')
        peaks = [recording.peak(norm)[0] for recording in recordings.values()]
        if max(peaks) > _WIDE * np.median(peaks):
            ax.set_yscale('log')
            ax.set_ylim(bottom=max(peaks) / _SHOWN)
    legend_below(axes[-1], axes[0], fontsize='small')
    return figure


def draw_limit_usage(
    recordings: Mapping[str, Recording], model: RobotModel, allowed: float, title: str
) -> Figure:
    """Velocity and acceleration as fractions of the limits, and the task scaling, over time.

    Args:
        recordings: Recordings by law.
        model: The arm, with its limits.
        allowed: Fraction of them that the motions may use, `limit_scale`.
        title: Above the panels.
    """
    figure, (velocity, acceleration, scaling) = time_panels(3, title, (11.0, 8.0))
    styles = line_styles(list(recordings))
    for name, recording in recordings.items():
        t = recording['t']
        style = styles[name]
        velocity.plot(t, velocity_usage(recording, model), label=in_symbols(name), **style)
        acceleration.plot(t, acceleration_usage(recording, model), **style)
        scaling.plot(t, recording['task_scaling'], **style)
    for ax, quantity in ((velocity, 'velocity'), (acceleration, 'acceleration')):
        ax.axhline(allowed, color='tab:red', ls='--', lw=1.0, label='allowed')
        highest = max(float(np.max(line.get_ydata())) for line in ax.get_lines())
        ax.set_ylim(0.0, min(_ABOVE * highest, _HIGHEST))
        note = f'\n(up to {highest:.3g})' if highest > _HIGHEST else ''
        ax.set_ylabel(f"largest {quantity}\n[fraction of a joint's limit]{note}", fontsize='small')
    scaling.set_ylim(0.0, 1.05)
    scaling.set_ylabel('task scaling $s$:\nfraction of the task velocity', fontsize='small')
    legend_below(scaling, velocity, fontsize='small')
    return figure
