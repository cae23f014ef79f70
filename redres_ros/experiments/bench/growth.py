"""How the tick grows with the joints of the arm, the rows of the task and the number of tasks."""

import tempfile
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

from redres_ros.controller import Controller
from redres_ros.experiments.bench.goals import Goal
from redres_ros.experiments.bench.timing import Times, measure
from redres_ros.experiments.plots import save
from redres_ros.laws import make_law
from redres_ros.resolution import resolve
from redres_ros.robot_model import TASK_SPACES, RobotModel

JOINTS = (7, 10, 15, 20, 25, 30)
TASKS = (1, 2, 3, 4, 5)  # of three rows each, stacked in one Jacobian: there are no priorities
LAWS = ('minimum_acceleration', 'dynamically_consistent')

_T = 1.0 / 500.0  # [s]
_INPUTS = 64  # joint positions, over and over again
_REACH = 1.2  # [m] of every arm, whatever its joints


@dataclass(frozen=True)
class GrowthResult:
    """Times of a tick by (law, rows of the task) and joints, and of `resolve` by weight and tasks at most joints."""

    ticks: Mapping[tuple[str, int], Mapping[int, Times]]
    stacked: Mapping[str, Mapping[int, Times]]

    def goals(self) -> list[Goal]:
        """None were set."""
        return []

    def table(self) -> str:
        """Medians: one line a law and number of rows, then one a weight."""
        lines = [_line('tick by joints, median [us]', JOINTS)]
        lines += [_line(f'{law}, {rows} rows', _medians(times)) for (law, rows), times in self.ticks.items()]
        lines += ['', _line(f'resolve by stacked tasks of 3 rows, n = {JOINTS[-1]}', TASKS)]
        lines += [_line(weight, _medians(times)) for weight, times in self.stacked.items()]
        return '\n'.join(lines)

    def figures(self) -> dict[str, object]:
        """For the file of results."""
        ticks = {f'{law}, {rows} rows': {f'{n} joints': t.figures() for n, t in times.items()}
                 for (law, rows), times in self.ticks.items()}
        stacked = {f'resolve, {weight}, {JOINTS[-1]} joints': {f'{tasks} tasks': t.figures()
                                                               for tasks, t in times.items()}
                   for weight, times in self.stacked.items()}
        return {**ticks, **stacked}

    def draw(self, path: Path) -> None:
        """Both kinds of growth side by side. Raises FileError."""
        figure = Figure(figsize=(11.0, 4.6), layout='constrained')
        figure.suptitle('How a tick grows (medians)')
        left, right = figure.subplots(1, 2)
        for (law, rows), times in self.ticks.items():
            _curve(left, times, f'{law}, {rows} rows')
        left.set(xlabel='joints', ylabel=r'Controller.update [$\mu$s]', title='a serial arm')
        for weight, times in self.stacked.items():
            _curve(right, times, weight)
        right.set(xlabel='tasks of three rows, stacked', ylabel=r'resolve [$\mu$s]', title=f'{JOINTS[-1]} joints',
                  xticks=TASKS)
        for ax in (left, right):
            ax.set_ylim(bottom=0.0)
            ax.grid(alpha=0.3)
            ax.legend(fontsize='small')
        save(figure, path)


def measure_growth(rounds: int, progress: Callable[[float], None] | None = None) -> GrowthResult:
    """Everything in turn, `rounds` blocks each."""
    ticks = {(law, rows, n): _tick(n, space, law)
             for space, rows in TASK_SPACES.items() for law in LAWS for n in JOINTS}
    stacked = {(weight, tasks): _resolve(tasks, weight == 'W = M') for weight in ('W = I', 'W = M') for tasks in TASKS}
    times = measure({**ticks, **stacked}, rounds, progress)
    return GrowthResult(
        {(law, rows): {n: times[law, rows, n] for n in JOINTS} for law, rows, _ in ticks},
        {weight: {tasks: times[weight, tasks] for tasks in TASKS} for weight, _ in stacked})


def serial_arm(joints: int, task_space: str) -> RobotModel:
    """An arm whose axes are vertical and horizontal in turn, with equal links."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / 'serial.urdf'
        path.write_text(_urdf(joints), encoding='utf-8')
        return RobotModel.from_urdf(path, f'link_{joints}', task_space)


def _urdf(joints: int) -> str:
    length = _REACH / joints
    inertial = (f'<inertial><origin xyz="0 0 {length / 2!r}"/><mass value="1"/>'
                '<inertia ixx="0.01" iyy="0.01" izz="0.01" ixy="0" ixz="0" iyz="0"/></inertial>')
    parts = ['<link name="link_0"/>']
    for number in range(1, joints + 1):
        axis = '0 1 0' if number % 2 == 0 else '0 0 1'
        parts.append(
            f'<link name="link_{number}">{inertial}</link><joint name="joint_{number}" type="revolute">'
            f'<parent link="link_{number - 1}"/><child link="link_{number}"/><origin xyz="0 0 {length!r}"/>'
            f'<axis xyz="{axis}"/><limit lower="-3" upper="3" velocity="2" effort="100"/></joint>')
    return f'<robot name="serial">{"".join(parts)}</robot>'


def _tick(joints: int, task_space: str, law: str) -> Callable[[int], object]:
    model, random = serial_arm(joints, task_space), np.random.default_rng(0)
    controller = Controller(model, make_law(law), _T)
    q = list(random.uniform(-1.0, 1.0, (_INPUTS, joints)))
    dx = list(random.uniform(-0.1, 0.1, (_INPUTS, model.m)))
    return lambda k: controller.update(q[k % _INPUTS], dx[k % _INPUTS])


def _resolve(tasks: int, weighted: bool) -> Callable[[int], object]:
    n, random = JOINTS[-1], np.random.default_rng(0)
    J, dx, b = random.normal(size=(3 * tasks, n)), random.normal(size=3 * tasks), random.normal(size=n)
    model = serial_arm(n, 'position')
    W = model.state(random.uniform(-1.0, 1.0, n), np.zeros(n)).M if weighted else None
    return lambda k: resolve(J, dx, b, W)


def _medians(times: Mapping[int, Times]) -> list[str]:
    return [f'{1e6 * t.median:.1f}' for t in times.values()]


def _line(label: str, cells: Sequence[object]) -> str:
    return f'{label:<46}' + ''.join(f'{cell:>9}' for cell in cells)


def _curve(ax: object, times: Mapping[int, Times], label: str) -> None:
    ax.plot(list(times), [1e6 * t.median for t in times.values()], 'o-', ms=3, lw=1.4, label=label)
