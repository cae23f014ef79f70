"""Laws side by side on one task: `compare` and `plot`."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path

from matplotlib.figure import Figure
from rich.console import Console

from redres_ros.controller import Controller
from redres_ros.errors import ArrayError
from redres_ros.laws import Law, make_law
from redres_ros.limits import Limit
from redres_ros.parameter import as_tuple
from redres_ros.planning.waypoints import WaypointTask, load_task
from redres_ros.robot_model import RobotModel
from redres_ros.simulation.closed_loop import run
from redres_ros.simulation.plots import draw_norms, save
from redres_ros.simulation.recording import Effort, Recording
from redres_ros.simulation.report import comparison_tables, label

_WIDTH = 160  # columns of a table


@dataclass(frozen=True)
class Comparison:
    """Laws on one task, by their labels; `print` shows tables."""

    recordings: dict[str, Recording]
    efforts: dict[str, Effort]
    title: str

    def __str__(self) -> str:
        console = Console(width=_WIDTH, no_color=True)
        with console.capture() as capture:
            for table in comparison_tables(self.efforts, self.title):
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
        figure = draw_norms(what.recordings, what.title)
    elif isinstance(what, Recording):
        figure = draw_norms({'motion': what}, what.ending)
    elif what:
        figure = draw_norms(what, '')
    else:
        raise ArrayError('there is no motion to draw; expected at least one')
    if path is not None:
        save(figure, Path(path))
    return figure
