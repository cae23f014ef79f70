"""Teleoperation by simulated operators: how often the arm is stuck, and how smoothly it moves.

    python benchmarks/teleoperation.py [--seconds S] [--seeds N] [--arm NAME ...]
        [--controller NAME ...] [--position] [--prefer NAME ...]

The arm is ideal: it is where it was commanded to be one tick ago. All figures come from its joint
positions and from the twists, so they are computed alike for every controller, and they do not
depend on the machine. Prints a table for docs/teleoperation.md; peers need the extra bench.
"""

import argparse
import multiprocessing
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from itertools import pairwise, product

import numpy as np
import pinocchio as pin
from operators import BlindOperator, GoalOperator, Operator
from peers import Setting, Target, installed

from redres_ros import Controller, RobotModel
from redres_ros.loop.command_loop import CommandLoop
from redres_ros.loop.velocity_input import LoopSettings

T = 0.004  # [s]
OURS = {'redres_ros': 'components', 'redres_ros, scaling task': 'task'}
WINDOW = 0.1  # [s] over which the end effector's speed is a mean
RADIUS = 0.25  # [m] at which a turn counts as a speed
ASKED = 0.02  # [m/s] of a twist that commands motion
STUCK = 0.005  # [m/s] of an end effector that does not follow it
FOLLOWED = 0.5  # of the commanded speed, in its direction
NEAR_END = np.radians(3.0)  # of a joint's range
HEADS = (
    'operator, arm',
    'controller',
    'moving',
    'stuck',
    'drift [deg/min]',
    'longest [s]',
    'near an end',
    'acceleration / limit',
    'jerk [rad/s^3]',
    'goals reached / given up',
)

Follower = Callable[[np.ndarray, np.ndarray, np.ndarray], np.ndarray]
"""(q, dq, dx) -> q in the next tick; dx (6,) [m/s], [rad/s]."""


@dataclass(frozen=True)
class Motion:
    """What happened in one run, tick by tick: q (N, n), x (N, 3), R (N, 3, 3), twists (N, 6)."""

    q: np.ndarray
    x: np.ndarray
    R: np.ndarray
    dx: np.ndarray


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument('--seconds', type=float, default=120.0, help='of each run; default 120')
    parser.add_argument('--seeds', type=int, default=3, help='runs of each kind; default 3')
    parser.add_argument('--arm', nargs='+', default=('fr3', 'iiwa7'))
    parser.add_argument('--controller', nargs='+', default=(*OURS, *installed()))
    parser.add_argument('--position', action='store_true', help='goals without orientation')
    parser.add_argument('--prefer', nargs='+', default=(), help='preferences of redres_ros')
    options = parser.parse_args()
    print('|', ' | '.join(HEADS), '|')
    print('|---' * len(HEADS) + '|')
    cases = list(
        product(
            ('goal', 'translate', 'blind'), options.arm, options.controller, range(options.seeds)
        )
    )
    run = partial(
        run_case,
        seconds=options.seconds,
        position_only=options.position,
        preferences=tuple(options.prefer),
    )
    with multiprocessing.Pool() as pool:
        results = pool.map(run, cases, chunksize=1)
    for first in range(0, len(cases), options.seeds):
        operator, arm, controller, _ = cases[first]
        cells = joined(results[first : first + options.seeds])
        print(f'| {operator}, {arm} | {controller} | {" | ".join(cells)} |')


def run_case(
    case: tuple[str, str, str, int],
    seconds: float,
    position_only: bool,
    preferences: tuple[str, ...],
) -> dict[str, float]:
    """The figures of one operator, arm, controller and seed."""
    kind, arm, controller, seed = case
    model = RobotModel.named(arm)
    operator: Operator = BlindOperator(T, seed, translates=kind == 'translate')
    if kind == 'goal':
        operator = GoalOperator(model, T, seed, position_only=position_only)
    if controller in OURS:
        task = 'position' if position_only else 'pose'
        follow = our_follower(model, task, OURS[controller], preferences)
    else:
        follow = peer_follower(model, controller, position_only)
    return figures(teleoperate(operator, model, follow, seconds), model, operator)


def our_follower(
    model: RobotModel, task: str, scaling: str, preferences: tuple[str, ...] = ()
) -> Follower:
    """What the node `controller` does, in simulated time."""
    controller = Controller(
        model,
        'minimum_acceleration',
        T,
        task=task,
        limits=('position', 'velocity', 'acceleration'),
        limit_gains={'acceleration.reach': 0.02},  # as the nodes have it
        scaling=scaling,
        preferences=preferences,
    )
    loop = CommandLoop(controller, LoopSettings(scaling=scaling))
    k = 0

    def follow(q: np.ndarray, dq: np.ndarray, dx: np.ndarray) -> np.ndarray:
        nonlocal k
        k += 1
        loop.enter_velocity(0, dx[: controller.m], k * T)
        response = loop.step(round(1e9 * k * T), q, k * T)
        return q if response is None else response.command.q_ref

    return follow


def peer_follower(model: RobotModel, name: str, position_only: bool) -> Follower:
    """A peer with all limits that it has."""
    peer = installed()[name](Setting(model.arm, T, is_pose=not position_only, limit_scale=1.0))

    def follow(q: np.ndarray, dq: np.ndarray, dx: np.ndarray) -> np.ndarray:
        x, R = model.tip(q)
        twist = dx[:3] if position_only else dx
        return q + T * peer(q, dq, Target(x + T * dx[:3], pin.exp3(T * dx[3:]) @ R, twist))

    return follow


def teleoperate(operator: Operator, model: RobotModel, follow: Follower, seconds: float) -> Motion:
    """The motion of an arm under an operator, from the arm's start."""
    q = np.array(model.arm.start)
    dq = np.zeros(model.n)
    ticks = []
    for k in range(round(seconds / T)):
        x, R = model.tip(q)
        dx = operator.twist(k * T, x, R)
        ticks.append((q, x, R, dx))
        q_next = follow(q, dq, dx)
        dq = (q_next - q) / T
        q = q_next
    return Motion(*(np.array(column) for column in zip(*ticks, strict=True)))


def figures(motion: Motion, model: RobotModel, operator: Operator) -> dict[str, float]:
    """The figures of one motion."""
    ddq = np.diff(motion.q, n=2, axis=0) / T**2
    ends = np.minimum(motion.q - model.q_min, model.q_max - motion.q).min(axis=1)
    step = round(WINDOW / T)
    weights = np.repeat((1.0, RADIUS), 3)
    commanded = weights * motion.dx[:-step:step]
    executed = weights * mean_twists(motion, step)
    asks = np.linalg.norm(commanded, axis=1) > ASKED
    followed = np.sum(commanded * executed, axis=1) > FOLLOWED * np.sum(commanded**2, axis=1)
    stuck = asks & (np.linalg.norm(executed, axis=1) < STUCK)
    begins, ends_of_stuck = runs(stuck)
    return {
        'moving': float(np.mean(followed[asks])),
        'stuck': float(np.mean(stuck)),
        'longest': WINDOW * float((ends_of_stuck - begins).max(initial=0)),
        'near_end': float(np.mean(ends < NEAR_END)),
        'drift': drift(motion),
        'acceleration': float(np.abs(ddq / np.array(model.arm.acceleration_limit)).max()),
        'jerk': float(np.sqrt(np.mean((np.diff(ddq, axis=0) / T) ** 2))),
        'reached': operator.reached,
        'given_up': operator.given_up,
    }


def joined(parts: list[dict[str, float]]) -> list[str]:
    """The cells of a row: the figures of several runs of one length."""
    each = {name: np.array([part[name] for part in parts]) for name in parts[0]}
    goals = int(each['reached'].sum() + each['given_up'].sum())
    return [
        f'{each["moving"].mean():.0%}',
        f'{each["stuck"].mean():.1%}',
        '' if np.isnan(each['drift']).any() else f'{60.0 * np.degrees(each["drift"].mean()):.2f}',
        f'{each["longest"].max():.1f}',
        f'{each["near_end"].mean():.0%}',
        f'{each["acceleration"].max():.3f}',
        f'{np.sqrt(np.mean(each["jerk"] ** 2)):.0f}',
        f'{each["reached"].sum():.0f} / {each["given_up"].sum():.0f}' if goals else '',
    ]


def mean_twists(motion: Motion, step: int) -> np.ndarray:
    """Of the end effector, over each window of so many ticks, (N, 6) [m/s], [rad/s]."""
    v = np.diff(motion.x[::step], axis=0)
    turns = [pin.log3(after @ before.T) for before, after in pairwise(motion.R[::step])]
    return np.hstack((v, turns)) / (step * T)


def runs(flags: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Where each run of set flags begins and ends."""
    edges = np.flatnonzero(np.diff(np.concatenate(([0], flags, [0]))))
    return edges[::2], edges[1::2]


def drift(motion: Motion) -> float:
    """Turn of the end effector while only translation is commanded, by its duration [rad/s]; NaN if
    it never is.
    """
    only_translation = ~(np.abs(motion.dx[:, 3:]) > 1e-3).any(axis=1)
    turned = 0.0
    for begin, end in zip(*runs(only_translation), strict=True):
        turn = pin.log3(motion.R[end - 1] @ motion.R[begin].T)
        turned += float(np.linalg.norm(turn))
    duration = T * np.count_nonzero(only_translation)
    return turned / duration if duration > 1.0 else np.nan


if __name__ == '__main__':
    main()
