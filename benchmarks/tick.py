"""One tick of every law beside other libraries and Pinocchio's own calls: the paper's arm and task.

    python benchmarks/tick.py [--rounds N]

All are called in turn, in blocks whose order changes, so that a slow moment of the machine affects
all alike. Prints a table for docs/real_time.md: without limits, with limits that are idle, and with
limits that act (5 % of the arm's velocities and accelerations). Needs the extra bench.
"""

import argparse
import gc
import random
import time
from collections.abc import Callable, Iterator

import numpy as np
from operators import BlindOperator
from peers import Peer, Setting, Target, installed, pinocchio_calls

from redres_ros import LAWS, Controller, RobotModel, load_task, make_law
from redres_ros.planning.planner import Planner
from redres_ros.policy import SCALING

T = 0.002  # [s]
TICKS = 1500  # of the recorded part of the motion: from rest to rest
BLOCK = 10  # calls of one candidate before it is the next one's turn
COLD = 2  # of these, not counted: the caches still hold the candidate before
LIMITS = ('position', 'velocity', 'acceleration')
SCALES = {'no limits': None, 'limits idle': 1.0, 'limits acting': 0.05}
SAME = 1e-3  # [rad/s] a peer farther than this from the least velocity has not solved the problem

Key = tuple[str, str]  # group and name


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument('--rounds', type=int, default=300, help='blocks of each; default 300')
    options = parser.parse_args()
    model = RobotModel.named('lwr4_paper')
    rows = list(recorded(model))
    calls = ours(model, rows) | others(model, rows)
    times = measure(calls, options.rounds)
    print('| group | tick | median | p99 | by embodik | by computeAllTerms |')
    print('|---|---|---|---|---|---|')
    floor = np.median(times['Pinocchio', 'computeAllTerms'])
    for (group, name), each in times.items():
        median = np.median(each)
        peer = times.get((group, 'embodik'))
        ratio = f'{median / np.median(peer):.2f}' if peer is not None else ''
        print(
            f'| {group} | {name} | {1e6 * median:.1f} µs | {1e6 * np.quantile(each, 0.99):.0f} µs '
            f'| {ratio} | {median / floor:.1f} |'
        )


def recorded(model: RobotModel) -> Iterator[tuple[np.ndarray, np.ndarray, Target]]:
    """q, dq before it and target of each tick of the paper's task under minimum acceleration."""
    task = load_task('rectangle')
    planner = Planner(task)
    controller = Controller(model, make_law('minimum_acceleration'), T)
    q = task.start
    dq = np.zeros(model.n)
    for k in range(TICKS):
        x, R = model.tip(q)
        dx = planner.reference(x, k * T).dx
        yield q, dq, Target(x + T * dx, R, dx)
        command = controller.update(q, dx)
        q = command.q_ref
        dq = command.dq


def ours(model: RobotModel, rows: list) -> dict[Key, Callable[[int], object]]:
    """Every law without limits; the least velocity with limits, and with a second task."""

    def call(law: str, **settings: object) -> Callable[[int], object]:
        controller = Controller(model, make_law(law), T, **settings)
        return lambda k: controller.update(rows[k % TICKS][0], rows[k % TICKS][2].dx)

    calls: dict[Key, Callable[[int], object]] = {}
    for law in LAWS:
        calls['no limits', law] = call(law)
    looks_ahead = Controller(model, make_law('minimum_acceleration', horizon=2.0), T)
    path = Planner(load_task('rectangle')).preview(0.0, TICKS * T + 2.0, step=0.05)
    previews = [path.after(k * T) for k in range(TICKS)]

    def ahead(k: int) -> None:
        q, _, target = rows[k % TICKS]
        looks_ahead.update(q, target.dx, ahead=previews[k % TICKS])

    calls['no limits', 'minimum_acceleration, 2 s ahead'] = ahead
    calls['no limits', 'two priorities'] = call(
        'minimum_velocity', secondary_tasks=('orientation',)
    )
    for group, limits, scale in (
        ('limits idle', LIMITS, 1.0),
        ('limits idle', (*LIMITS, 'torque'), 1.0),
        ('limits acting', LIMITS, SCALES['limits acting']),
    ):
        name = 'minimum_velocity' + (', torque limits too' if 'torque' in limits else '')
        calls[group, name] = call(
            'minimum_velocity', integrate_from='measurement', limits=limits, limit_scale=scale
        )
    for scaling in SCALING:
        calls['FR3, pose, limits acting', f'scaling {scaling}'] = steered(scaling)
    return calls


def steered(scaling: str) -> Callable[[int], object]:
    """An FR3 under random twists, of which its limits allow a part."""
    model = RobotModel.named('fr3')
    start = np.array(model.arm.start)
    operator = BlindOperator(T, 0)
    twists = [operator.twist(k * T, *model.tip(start)) for k in range(TICKS)]
    settings = {'task': 'pose', 'limits': LIMITS, 'limit_scale': SCALES['limits acting']}
    controller = Controller(model, 'minimum_velocity', T, scaling=scaling, **settings)
    return lambda k: controller.update(start, twists[k % TICKS])


def others(model: RobotModel, rows: list) -> dict[Key, Callable[[int], object]]:
    """The peers and Pinocchio's calls; complains about a peer that solves another problem."""
    calls: dict[Key, Callable[[int], object]] = {}
    for group, scale in SCALES.items():
        for name, make in installed().items():
            peer = make(Setting(model.arm, T, is_pose=False, limit_scale=scale))
            calls[group, name] = lambda k, peer=peer: peer(*rows[k % TICKS])
            if group != 'limits acting' and (off := deviation(peer, model, rows)) > SAME:
                print(f'{group}, {name}: {off:.1g} rad/s from the least velocity')
    for name, floor in pinocchio_calls(model.arm).items():
        calls['Pinocchio', name] = lambda k, floor=floor: floor(*rows[k % TICKS][:2])
    return calls


def deviation(peer: Peer, model: RobotModel, rows: list) -> float:
    """Largest distance between a peer's velocities and the least ones, Eq. (2) [rad/s]."""
    controller = Controller(model, make_law('minimum_velocity'), T)
    return max(
        np.abs(peer(q, dq, target) - controller.update(q, target.dx).dq).max()
        for q, dq, target in rows
    )


def measure(calls: dict[Key, Callable[[int], object]], rounds: int) -> dict[Key, np.ndarray]:
    """The times of the calls [s], block by block in turn; a first round is not counted."""
    samples: dict[Key, list[int]] = {key: [] for key in calls}
    order = list(calls)
    shuffle = random.Random(0).shuffle
    clock = time.perf_counter_ns
    gc.collect()
    gc.disable()  # it would be charged to the candidate that runs
    for turn in range(-1, rounds):
        shuffle(order)
        for key in order:
            for number in range(BLOCK):
                begin = clock()
                calls[key](max(turn, 0) * BLOCK + number)
                end = clock()
                if turn >= 0 and number >= COLD:
                    samples[key].append(end - begin)
    gc.enable()
    return {key: 1e-9 * np.array(each) for key, each in samples.items()}


if __name__ == '__main__':
    main()
