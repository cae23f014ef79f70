"""Teleoperation by simulated operators: how often the arm is stuck, and how calm it is.

The arm is ideal: it is where it was commanded to be one tick ago. All figures come from its joint
positions and from what was asked, so they are computed alike for every controller. Times are those
of the simulated robot: the figures do not depend on the machine.
"""

from collections.abc import Callable, Iterable, Mapping
from dataclasses import asdict, dataclass
from itertools import pairwise

import numpy as np
from rich.table import Table

from redres_ros.bench.peers import TwistPeer, missing_peers, twist_peers
from redres_ros.controller import Controller
from redres_ros.loop.command_loop import CommandLoop
from redres_ros.loop.settings import LoopSettings
from redres_ros.preferences import Preference
from redres_ros.robot_model import RobotModel
from redres_ros.rotation import rotation_vector
from redres_ros.simulation.operators import BlindOperator, GoalOperator, Operator
from redres_ros.simulation.parallel import in_parallel
from redres_ros.simulation.report import table

T = 1.0 / 250.0  # [s]
ARMS = ('fr3', 'iiwa7')
OPERATORS = ('goal', 'blind')
OURS = {
    'redres_ros': 'components',
    'redres_ros, scaling task': 'task',
}
LIMITS = ('position', 'velocity', 'acceleration')
LAW = 'minimum_acceleration'
REACH = 0.02  # as the nodes have it

_WINDOW = 0.1  # [s] over which the tip's speed is a mean
_RADIUS = 0.25  # [m] at which a turn counts as a speed
_ASKED = 0.02  # [m/s] of a twist that asks for motion
_STUCK = 0.005  # [m/s] of a tip that does not follow it
_FOLLOWED = 0.5  # of the asked speed, in its direction, with which the tip is moving
_NEAR_END = np.radians(3.0)  # of a joint's range


@dataclass(frozen=True)
class OperatorFigures:
    """OperatorFigures of some time under an operator.

    Attributes:
        moving: Fraction of the time in which the tip executes half of what is asked, or more.
        stuck: Fraction of it in which motion is asked for and the tip does not move.
        longest_stuck: [s].
        near_end: Fraction of it in which a joint is beside an end of its range.
        drift: Turn of the tip while only translation is asked for [rad/s].
        acceleration: The largest, relative to its limit.
        jerk: RMS of all joints [rad/s^3].
        reached: Goals.
        given_up: Goals.
    """

    moving: float
    stuck: float
    longest_stuck: float
    near_end: float
    drift: float
    acceleration: float
    jerk: float
    reached: int
    given_up: int

    @classmethod
    def joined(cls, parts: 'list[OperatorFigures]') -> 'OperatorFigures':
        """Those of several runs of one length."""

        def mean(name: str) -> float:
            return float(np.mean([getattr(part, name) for part in parts]))

        return cls(
            moving=mean('moving'),
            stuck=mean('stuck'),
            longest_stuck=max(part.longest_stuck for part in parts),
            near_end=mean('near_end'),
            drift=mean('drift'),
            acceleration=max(part.acceleration for part in parts),
            jerk=float(np.sqrt(np.mean([part.jerk**2 for part in parts]))),
            reached=sum(part.reached for part in parts),
            given_up=sum(part.given_up for part in parts),
        )


@dataclass(frozen=True)
class SteeredMotion:
    """What happened in one run, tick by tick.

    Attributes:
        q: (N, n) [rad].
        x: Positions of the tip, (N, 3) [m].
        R: Its orientations, (N, 3, 3).
        asked: Twists, (N, 6) [m/s], [rad/s].
    """

    q: np.ndarray
    x: np.ndarray
    R: np.ndarray
    asked: np.ndarray


@dataclass(frozen=True)
class TeleoperationResult:
    """OperatorFigures by operator, arm and controller."""

    runs: Mapping[tuple[str, str, str], OperatorFigures]
    missing: tuple[str, ...]
    duration: float  # of each run [s]
    seeds: int

    def table(self) -> Table:
        """One line for each run."""
        rows: list[tuple[str, ...]] = []
        head = ''
        for (operator, arm, name), figures in self.runs.items():
            if head != f'{operator}, {arm}':
                head = f'{operator}, {arm}'
                rows.append((head,))
            rows.append((name, *cells(figures)))
        return table(
            ('', *HEADS),
            rows,
            title='Teleoperation: minutes of simulated operators',
            note=f'{self.duration:g} s with each of {self.seeds} seeds',
        )

    def figures(self) -> dict[str, object]:
        """For the file of results."""
        named = {', '.join(run): asdict(figures) for run, figures in self.runs.items()}
        return {
            'T_s': T,
            'duration_s': self.duration,
            'seeds': self.seeds,
            'runs': named,
            'missing_peers': list(self.missing),
        }


HEADS = (
    'moving',
    'stuck',
    'longest [s]',
    'near an end',
    'drift [deg/min]',
    'acceleration / limit',
    'jerk [rad/s^3]',
    'goals reached / given up',
)


def cells(figures: OperatorFigures) -> list[str]:
    """The figures of a run in the order of HEADS."""
    goals = figures.reached + figures.given_up
    return [
        f'{figures.moving:.0%}',
        f'{figures.stuck:.1%}',
        f'{figures.longest_stuck:.1f}',
        f'{figures.near_end:.0%}',
        f'{60.0 * np.degrees(figures.drift):.2f}' if goals else '',
        f'{figures.acceleration:.3f}',
        f'{figures.jerk:.0f}',
        f'{figures.reached} / {figures.given_up}' if goals else '',
    ]


def measure_teleoperation(
    duration: float, seeds: int, progress: Callable[[float], None]
) -> TeleoperationResult:
    """Let every operator steer every arm by every controller.

    Args:
        duration: Of each run [s].
        seeds: How many runs there are of each kind.
        progress: Called with the fraction done, 0 to 1.
    """
    names = [*OURS, *twist_peers()]
    cases = [
        (operator, arm, name, seed, duration)
        for operator in OPERATORS
        for arm in ARMS
        for name in names
        for seed in range(seeds)
    ]
    parts: dict[tuple[str, str, str], list[OperatorFigures]] = {}
    for case, found in zip(cases, in_parallel(_figures_of, cases, progress), strict=True):
        parts.setdefault(case[:3], []).append(found)
    runs = {run: OperatorFigures.joined(found) for run, found in parts.items()}
    return TeleoperationResult(runs, missing_peers(), duration, seeds)


def _figures_of(
    case: tuple[str, str, str, int, float], progress: Callable[[float], None]
) -> OperatorFigures:
    name, arm, controller, seed, duration = case
    model = RobotModel.named(arm)
    operator = make_operator(name, model, seed)
    motion = steered(operator, model, make_follower(controller, model), duration, progress)
    return figures_of(motion, model, operator)


def make_operator(name: str, model: RobotModel, seed: int) -> Operator:
    """An operator of OPERATORS.

    Args:
        name: Name of the operator.
        model: The arm.
        seed: Random seed.
    """
    return BlindOperator(T, seed) if name == 'blind' else GoalOperator(model, T, seed)


Follower = TwistPeer
"""(q, dq, dx) -> q at the next tick; all (n,) [rad], [rad/s], and dx (6,) [m/s], [rad/s]."""


def make_follower(name: str, model: RobotModel) -> Follower:
    """The controller of that name: one of ours, or a peer.

    Args:
        name: In OURS, or of a peer.
        model: The arm.
    """
    if name in OURS:
        return our_follower(model, OURS[name])
    return twist_peers()[name](model.arm, T)


def our_follower(
    model: RobotModel,
    scaling: str,
    preferences: Iterable[str | Preference] = (),
    task: str = 'pose',
) -> Follower:
    """What redres_controller does, in simulated time.

    Args:
        model: The arm.
        scaling: What limits scale.
        preferences: In the null space.
        task: 'pose', or 'position': then the turns of a twist are left out.
    """
    controller = Controller(
        model,
        LAW,
        T,
        task=task,
        limits=LIMITS,
        limit_gains={'acceleration.reach': REACH},
        scaling=scaling,
        preferences=preferences,
    )
    loop = CommandLoop(controller, LoopSettings(scaling=scaling))
    k = 0

    def follow(q: np.ndarray, dq: np.ndarray, dx: np.ndarray) -> np.ndarray:
        nonlocal k
        k += 1
        loop.enter_twist(0, dx[: controller.m], k * T)
        response = loop.enter_state(round(1e9 * k * T), q, k * T)
        return q if response is None else response.command.q_ref

    return follow


def steered(
    operator: Operator,
    model: RobotModel,
    follow: Follower,
    duration: float,
    progress: Callable[[float], None],
) -> SteeredMotion:
    """The motion of an arm under an operator.

    Args:
        operator: Sees the tip.
        model: The arm, which begins at its start.
        follow: The controller.
        duration: [s].
        progress: Called with the fraction done, 0 to 1.
    """
    q = np.array(model.arm.start)
    dq = np.zeros(model.n)
    ticks = []
    count = round(duration / T)
    for k in range(count):
        x, R = model.tip(q)
        dx = operator.twist(k * T, x, R)
        ticks.append((q, x, R, dx))
        q_next = follow(q, dq, dx)
        dq = (q_next - q) / T
        q = q_next
        if k % 500 == 0:
            progress(k / count)
    return SteeredMotion(*(np.array(column) for column in zip(*ticks, strict=True)))


def figures_of(motion: SteeredMotion, model: RobotModel, operator: Operator) -> OperatorFigures:
    """The figures of a motion.

    Args:
        motion: Tick by tick.
        model: The arm.
        operator: Who asked for it.
    """
    ddq = np.diff(motion.q, n=2, axis=0) / T**2
    jerk = np.diff(ddq, axis=0) / T
    ends = np.minimum(motion.q - model.q_min, model.q_max - motion.q).min(axis=1)
    step = round(_WINDOW / T)
    asked = _weighed(motion.asked[:-step:step])
    executed = _weighed(_mean_twists(motion, step))
    asks = np.linalg.norm(asked, axis=1) > _ASKED
    followed = np.sum(asked * executed, axis=1) > _FOLLOWED * np.sum(asked**2, axis=1)
    stuck = asks & (np.linalg.norm(executed, axis=1) < _STUCK)
    return OperatorFigures(
        moving=float(np.mean(followed[asks])),
        stuck=float(np.mean(stuck)),
        longest_stuck=_WINDOW * _longest(stuck),
        near_end=float(np.mean(ends < _NEAR_END)),
        drift=_drift(motion),
        acceleration=float(np.abs(ddq / np.array(model.arm.acceleration_limit)).max()),
        jerk=float(np.sqrt(np.mean(jerk**2))),
        reached=operator.reached,
        given_up=operator.given_up,
    )


def _mean_twists(motion: SteeredMotion, step: int) -> np.ndarray:
    """Of the tip, over each window of so many ticks, (N, 6) [m/s], [rad/s]."""
    v = np.diff(motion.x[::step], axis=0)
    R = motion.R[::step]
    turns = [rotation_vector(after @ before.T) for before, after in pairwise(R)]
    twists: np.ndarray = np.hstack((v, turns)) / (step * T)
    return twists


def _weighed(twists: np.ndarray) -> np.ndarray:
    """Twists (N, 6) with turns as speeds [m/s]."""
    return twists * np.repeat((1.0, _RADIUS), 3)


def _longest(flags: np.ndarray) -> int:
    """The number of flags in the longest row of them."""
    edges = np.flatnonzero(np.diff(np.concatenate(([0], flags, [0]))))
    return int(np.diff(edges)[::2].max(initial=0))


def _drift(motion: SteeredMotion) -> float:
    """The turn of the tip while only translation is asked for, by the time of that [rad/s]."""
    only_translation = ~(np.abs(motion.asked[:, 3:]) > 1e-3).any(axis=1)
    edges = np.flatnonzero(np.diff(np.concatenate(([0], only_translation, [0]))))
    turned = 0.0
    for begin, end in edges.reshape(-1, 2):
        turn = rotation_vector(motion.R[end - 1] @ motion.R[begin].T)
        turned += float(np.linalg.norm(turn))
    return turned / max(T * np.count_nonzero(only_translation), T)
