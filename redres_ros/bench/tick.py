"""One tick of every law beside peers and Pinocchio's own calls, on the paper's arm and task."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np
from rich.table import Table

from redres_ros.bench.peers import Peer, floors, missing_peers, peers
from redres_ros.bench.timing import Times, measure
from redres_ros.controller import Controller
from redres_ros.laws import LAWS, make_law
from redres_ros.planning.planner import Planner
from redres_ros.planning.waypoints import load_task
from redres_ros.robot_model import RobotModel
from redres_ros.simulation.report import table

T = 1.0 / 500.0  # [s]
TICKS = 1500  # of the recorded stretch, over and over again: from rest to rest, without a jump
FLOOR = 'computeAllTerms'  # with which the laws are compared
_JOINT_LIMITS = ('position', 'velocity', 'acceleration')
LIMITED = {  # limits, and the fraction of velocities and accelerations that they allow
    'limits idle': (_JOINT_LIMITS, 1.0),
    'torque limits idle': ((*_JOINT_LIMITS, 'torque'), 1.0),
    'limits acting': (_JOINT_LIMITS, 0.05),
}
# [rad/s] a peer that is farther from the least velocities has not solved the problem, and does not
# count
SAME = 1e-3


@dataclass(frozen=True)
class Stretch:
    """A recorded part of a motion, k = 0 ... N - 1.

    Attributes:
        q: Joint positions, (N, n) [rad].
        dq_prev: Joint velocities before, (N, n) [rad/s].
        dx: Wanted velocities of the tip, (N, 3) [m/s].
        x_d: Where these lead within a tick, (N, 3) [m].
    """

    q: np.ndarray
    dq_prev: np.ndarray
    dx: np.ndarray
    x_d: np.ndarray


@dataclass(frozen=True)
class TickResult:
    """Times by name.

    Attributes:
        laws: Times of our laws.
        floors: Times of Pinocchio's calls.
        peers: Times of other libraries.
        deviations: How far each peer's velocities are from those of `minimum_velocity`, at most
            [rad/s].
        missing: Peers that are not installed.
    """

    laws: Mapping[str, Times]
    floors: Mapping[str, Times]
    peers: Mapping[str, Times]
    deviations: Mapping[str, float]
    missing: tuple[str, ...]

    @property
    def fastest_peer(self) -> str:
        """Name of the fastest one that solves the same problem; empty without any."""
        same = [name for name in self.peers if self.deviations[name] < SAME]
        return min(same, key=lambda name: self.peers[name].median, default='')

    def table(self) -> Table:
        """Median and p99 of everything, beside the floor and the fastest peer."""
        rows: list[tuple[str, ...]] = []
        for head, group in self._groups().items():
            rows.append((head,))
            rows += [(name, *self._cells(name, times)) for name, times in group.items()]
        peer = self.fastest_peer or 'none is installed'
        return table(
            ('', 'median [us]', 'p99 [us]', 'by the floor', 'by the peer', 'off [rad/s]'),
            rows,
            title='Tick: one call of Controller.update, and what others take',
            note=f'floor: {FLOOR}; peer: the fastest that solves the same problem, {peer}',
        )

    def figures(self) -> dict[str, object]:
        """For the file of results."""
        figures: dict[str, object] = {'T_s': T}
        for head, group in self._groups().items():
            figures[head] = {name: times.figures() for name, times in group.items()}
        return {
            **figures,
            'fastest_peer': self.fastest_peer,
            'peers_off_rad_per_s': dict(self.deviations),
            'missing_peers': list(self.missing),
        }

    def _groups(self) -> dict[str, Mapping[str, Times]]:
        return {'laws': self.laws, 'pinocchio': self.floors, 'peers': self.peers}

    def _cells(self, name: str, times: Times) -> list[str]:
        cells = [f'{1e6 * times.median:.1f}', f'{1e6 * times.p99:.1f}']
        cells.append(f'{times.median / self.floors[FLOOR].median:.2f}')
        if self.fastest_peer:
            cells.append(f'{times.median / self.peers[self.fastest_peer].median:.2f}')
        else:
            cells.append('')
        if name in self.deviations:
            deviation = self.deviations[name]
            remark = ', not the same' if deviation >= SAME else ''
            cells.append(f'{deviation:.1g}{remark}')
        return cells


def measure_tick(rounds: int, progress: Callable[[float], None]) -> TickResult:
    """Time everything in turn.

    Args:
        rounds: Blocks of calls of each.
        progress: Called with the fraction done, 0 to 1.
    """
    model = RobotModel.named(load_task('rectangle').robot)
    stretch = recorded(model)
    laws = controllers(model)
    _, scale = LIMITED['limits acting']
    others = peers(model.arm, T, scale)
    bare = floors(model.arm)
    calls: dict[tuple[str, str], Callable[[int], object]] = {}
    for name, controller in laws.items():
        calls['laws', name] = _over(controller.update, stretch.q, stretch.dx)
    for name, floor in bare.items():
        calls['floors', name] = _over(floor, stretch.q, stretch.dq_prev)
    for name, peer in others.items():
        calls['peers', name] = _over(peer, stretch.q, stretch.x_d, stretch.dx)
    # First, because a peer with acceleration limits remembers the last velocity of a round.
    deviations = {name: deviation(peer, model, stretch) for name, peer in others.items()}
    times = measure(calls, rounds, progress)
    return TickResult(
        laws={name: times['laws', name] for name in laws},
        floors={name: times['floors', name] for name in bare},
        peers={name: times['peers', name] for name in others},
        deviations=deviations,
        missing=missing_peers(),
    )


def controllers(model: RobotModel) -> dict[str, Controller]:
    """Every law; and one of them with limits, idle and acting, and with a second task."""
    controllers = {name: Controller(model, make_law(name), T) for name in LAWS}
    for name, (limits, scale) in LIMITED.items():
        controllers[f'minimum_velocity, {name}'] = Controller(
            model,
            make_law('minimum_velocity'),
            T,
            integrate_from='measurement',
            limits=limits,
            limit_scale=scale,
        )
    controllers['minimum_velocity, two priorities'] = Controller(
        model, make_law('minimum_velocity'), T, secondary_tasks=('orientation',)
    )
    return controllers


def recorded(model: RobotModel, ticks: int = TICKS) -> Stretch:
    """The beginning of the paper's task under minimum acceleration.

    Args:
        model: Model of the arm.
        ticks: How many.
    """
    task = load_task('rectangle')
    planner = Planner(task)
    controller = Controller(model, make_law('minimum_acceleration'), T)
    q = task.start
    dq = np.zeros(model.n)
    rows = []
    for k in range(ticks):
        x = model.tip(q)[0]
        dx = planner.reference(x, k * T).dx
        rows.append((q, dq, dx, x + T * dx))
        command = controller.update(q, dx)
        q = command.q_ref
        dq = command.dq
    return Stretch(*(np.array(column) for column in zip(*rows, strict=True)))


def deviation(peer: Peer, model: RobotModel, stretch: Stretch) -> float:
    """Largest distance between a peer's velocities and the least ones, Eq. (2), on the stretch
    [rad/s].

    Args:
        peer: Another library's inverse kinematics.
        model: Model of the arm.
        stretch: States and task velocities.
    """
    largest = 0.0
    controller = Controller(model, make_law('minimum_velocity'), T)
    for q, dx, x_d in zip(stretch.q, stretch.dx, stretch.x_d, strict=True):
        least = controller.update(q, dx).dq
        largest = max(largest, float(np.abs(peer(q, x_d, dx) - least).max()))
    return largest


def _over(call: Callable[..., object], *columns: np.ndarray) -> Callable[[int], object]:
    """A call with the rows of arrays, cyclically."""
    rows = list(zip(*columns, strict=True))
    return lambda k: call(*rows[k % len(rows)])
