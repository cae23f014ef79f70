"""One tick of every law and of its parts, beside peers and Pinocchio's own calls, on the paper's
arm and task.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from redres_ros.bench.goals import Goal
from redres_ros.bench.peers import Peer, floors, missing_peers, peers
from redres_ros.bench.timing import Times, measure
from redres_ros.controller import Controller
from redres_ros.laws import LAWS, make_law
from redres_ros.planner import Planner
from redres_ros.resolution import resolve
from redres_ros.robot_model import RobotModel, RobotState
from redres_ros.waypoints import load_task

T = 1.0 / 500.0  # [s]
TICKS = 500  # of the recorded stretch, over and over again
FLOOR = 'computeAllTerms'  # the one that the goals refer to
PEER_GOAL = 4.0
WEIGHTED_PEER_GOAL = 3.0
FLOOR_GOAL = 4.0
# [rad/s] a peer that is farther from the least velocities has not solved the problem, and does not
# count
SAME = 1e-3


class Stretch(NamedTuple):
    """A recorded part of a motion, k = 0 ... N - 1: q, dq_prev (N, n) [rad], [rad/s]; dx, x_d (N,
    3) [m/s], [m].
    """

    q: np.ndarray
    dq_prev: np.ndarray
    dx: np.ndarray
    x_d: np.ndarray


@dataclass(frozen=True)
class TickResult:
    """Times by name: of the laws, of parts of a tick, of Pinocchio's calls, of peers; and which
    peers are missing.

    deviations: how far each peer's velocities are at most from the least ones, Eq. (2) [rad/s].
    """

    laws: dict[str, Times]
    parts: dict[str, Times]
    floors: dict[str, Times]
    peers: dict[str, Times]
    deviations: dict[str, float]
    missing: tuple[str, ...]

    @property
    def fastest_peer(self) -> str:
        """Name of the fastest one that solves the same problem; empty without any."""
        same = [name for name in self.peers if self.deviations[name] < SAME]
        return min(same, key=lambda name: self.peers[name].median, default='')

    def goals(self) -> list[Goal]:
        """Each law against the fastest peer and against the floor."""
        goals = []
        for name, times in self.laws.items():
            if self.fastest_peer:
                got = self.peers[self.fastest_peer].median / times.median
                bound = WEIGHTED_PEER_GOAL if _is_weighted(name) else PEER_GOAL
                goals.append(
                    Goal(
                        f'{name}: times faster than {self.fastest_peer}', got, bound, at_most=False
                    )
                )
            got = times.median / self.floors[FLOOR].median
            goals.append(Goal(f'{name}: times the floor, {FLOOR}', got, FLOOR_GOAL))
        return goals

    def table(self) -> str:
        """Median and p99 of everything, beside the floor and the fastest peer."""
        floor = self.floors[FLOOR].median
        peer = self.peers[self.fastest_peer].median if self.fastest_peer else float('nan')
        lines = [
            f'{"one tick":<36}{"median [us]":>13}{"p99 [us]":>11}{"of the floor":>14}{"peer / it":>11}'
        ]
        for head, group in self._groups().items():
            lines.append(f'-- {head}')
            lines += [
                f'{name:<36}{1e6 * times.median:13.1f}{1e6 * times.p99:11.1f}{times.median / floor:14.2f}'
                f'{_cell(peer / times.median)}{self._remark(name)}'
                for name, times in group.items()
            ]
        return '\n'.join(
            [*lines, f'floor: {FLOOR}; peer: the fastest, {self.fastest_peer or "none installed"}']
        )

    def figures(self) -> dict[str, object]:
        """For the file of results."""
        groups = {
            head: {name: times.figures() for name, times in group.items()}
            for head, group in self._groups().items()
        }
        return {
            'T_s': T,
            **groups,
            'fastest_peer': self.fastest_peer,
            'peers_off_rad_per_s': self.deviations,
            'missing_peers': list(self.missing),
        }

    def _remark(self, name: str) -> str:
        deviation = self.deviations.get(name, 0.0)
        return f'  {deviation:.2g} rad/s off, does not count' if deviation >= SAME else ''

    def _groups(self) -> dict[str, dict[str, Times]]:
        return {
            'laws': self.laws,
            'parts': self.parts,
            'pinocchio': self.floors,
            'peers': self.peers,
        }


def measure_tick(rounds: int, progress: Callable[[float], None] | None = None) -> TickResult:
    """Everything in turn, `rounds` blocks each."""
    task = load_task('rectangle')
    model = RobotModel.named(task.robot)
    stretch = recorded(model)
    others = peers(model.arm, T)
    groups = {
        'laws': {name: _tick(Controller(model, make_law(name), T), stretch) for name in LAWS},
        'parts': _parts(model, stretch),
        'floors': {name: _of_state(call, stretch) for name, call in floors(model.arm)},
        'peers': {name: _of_target(call, stretch) for name, call in others.items()},
    }
    calls = {
        (group, name): call for group, members in groups.items() for name, call in members.items()
    }
    times = measure(calls, rounds, progress)
    split = {
        group: {name: times[group, name] for name in members} for group, members in groups.items()
    }
    deviations = {name: _deviation(peer, model, stretch) for name, peer in others.items()}
    return TickResult(**split, deviations=deviations, missing=missing_peers())


def recorded(model: RobotModel, ticks: int = TICKS) -> Stretch:
    """The beginning of the paper's task under minimum acceleration."""
    task = load_task('rectangle')
    planner = Planner(task)
    controller = Controller(model, make_law('minimum_acceleration'), T)
    q = task.start
    rows = []
    dq = np.zeros(model.n)
    for k in range(ticks):
        x = model.tip(q)[0]
        dx = planner.reference(x, k * T).dx
        rows.append((q, dq, dx, x + T * dx))
        command = controller.update(q, dx)
        q = command.q_ref
        dq = command.dq
    return Stretch(*(np.array(column) for column in zip(*rows, strict=True)))


def _tick(controller: Controller, stretch: Stretch) -> Callable[[int], object]:
    q = list(stretch.q)
    dx = list(stretch.dx)
    N = len(stretch.q)
    return lambda k: controller.update(q[k % N], dx[k % N])


def _parts(model: RobotModel, stretch: Stretch) -> dict[str, Callable[[int], object]]:
    """What a tick is made of, each on its own; the planner's part belongs to another node."""
    q = list(stretch.q)
    dq = list(stretch.dq_prev)
    dx = list(stretch.dx)
    N = len(stretch.q)
    states = [model.state(position, velocity) for position, velocity in zip(q, dq, strict=True)]
    for state in states:  # a state may have been told only what it was asked
        _dynamics(state)
    torque = make_law('dynamically_consistent')
    planner = Planner(load_task('rectangle'))
    return {
        'kinematics': lambda k: model.state(q[k % N], dq[k % N]).J,
        'kinematics and dynamics': lambda k: _dynamics(model.state(q[k % N], dq[k % N])),
        'bias with M^-1 n': lambda k: torque.bias(states[k % N], T),
        'resolve, W = I': lambda k: resolve(states[k % N].J, dx[k % N], dq[k % N]),
        'resolve, W = M': lambda k: resolve(states[k % N].J, dx[k % N], dq[k % N], states[k % N].M),
        'planner, tip': lambda k: model.tip(q[k % N]),
        'planner, reference': lambda k: planner.reference(states[k % N].x, k % N * T),
    }


def _cell(ratio: float) -> str:
    return f'{"-":>11}' if math.isnan(ratio) else f'{ratio:11.2f}'


def _dynamics(state: RobotState) -> tuple[np.ndarray, ...]:
    return state.J, state.M, state.n


def _of_state(
    call: Callable[[np.ndarray, np.ndarray], object], stretch: Stretch
) -> Callable[[int], object]:
    q = list(stretch.q)
    dq = list(stretch.dq_prev)
    N = len(stretch.q)
    return lambda k: call(q[k % N], dq[k % N])


def _of_target(peer: Peer, stretch: Stretch) -> Callable[[int], object]:
    q = list(stretch.q)
    x_d = list(stretch.x_d)
    N = len(stretch.q)
    return lambda k: peer(q[k % N], x_d[k % N])


def _deviation(peer: Peer, model: RobotModel, stretch: Stretch) -> float:
    """Largest distance between a peer's velocities and the least ones on the stretch [rad/s]."""
    least = [
        resolve(model.state(q, dq).J, dx, np.zeros(model.n))
        for q, dq, dx, _ in zip(*stretch, strict=True)
    ]
    theirs = [peer(q, x_d) for q, _, _, x_d in zip(*stretch, strict=True)]
    return float(np.abs(np.array(least) - np.array(theirs)).max())


def _is_weighted(law: str) -> bool:
    """Whether the law has a weight of its own."""
    return LAWS[law].weight is not LAWS['minimum_velocity'].weight
