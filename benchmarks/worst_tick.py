"""How much longer the worst tick takes than the usual one, where limits act.

Each tick of the paper's task is computed anew many times from the same state, and its least time
counts, so that what the machine does beside it does not. What is left is the work: how far the
search for the optimum has to go.

    python benchmarks/worst_tick.py [--repetitions N]

prints one row a law: ticks in which limits act, the median of their times, and the worst over it.
"""

import argparse
import copy
import time

import numpy as np

from redres_ros import LAWS, Controller, RobotModel, load_task, make_law
from redres_ros.planning.planner import Planner

T = 0.002  # [s]
LIMITS = ('position', 'velocity', 'acceleration')
SCALES = (1.0, 0.5)
TICKS = 6000


def times(law: str, scale: float, repetitions: int) -> np.ndarray:
    """The least time of each tick in which limits act, (ticks,) [s].

    Args:
        law: In the table of laws.
        scale: Of the limits.
        repetitions: Of each tick.
    """
    task = load_task('rectangle')
    model = RobotModel.named(task.robot)
    controller = Controller(model, make_law(law), T, limits=LIMITS, limit_scale=scale)
    planner = Planner(task)
    q = task.start
    late = 0.0
    found = []
    for k in range(TICKS):
        reference = planner.reference(model.tip(q)[0], k * T - late)
        if reference.finished:
            break
        before = copy.copy(controller)
        active_set = controller.policy.limits.active_set.copy()
        command = controller.update(q, reference.dx)
        if command.active_limits:
            found.append(least_time(before, active_set, q, reference.dx, repetitions))
        late += (1.0 - command.s) * T
        q = command.q_ref
    return np.array(found)


def least_time(
    controller: Controller, active_set: np.ndarray, q: np.ndarray, dx: np.ndarray, repetitions: int
) -> float:
    """Of one and the same tick [s].

    Args:
        controller: As it was before the tick; it stays so.
        active_set: Which limits the search of the tick before held.
        q: (n,) [rad].
        dx: (3,) [m/s].
        repetitions: How often it is computed.
    """
    least = np.inf
    for _ in range(repetitions):
        again = copy.copy(controller)
        controller.policy.limits.active_set[:] = active_set
        begin = time.perf_counter()
        again.update(q, dx)
        least = min(least, time.perf_counter() - begin)
    return least


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument('--repetitions', type=int, default=20)
    options = parser.parse_args()
    print('| law | limits | acting ticks | median [us] | 99 of 100 | worst | worst / median |')
    print('|---|---|---|---|---|---|---|')
    for law in LAWS:
        for scale in SCALES:
            found = 1e6 * times(law, scale, options.repetitions)
            if not len(found):
                continue
            middle = float(np.median(found))
            worst = float(found.max())
            usual = f'{middle:.1f} | {np.quantile(found, 0.99):.1f}'
            print(f'| {law} | {scale:g} | {len(found)} | {usual} | {worst:.1f} | ', end='')
            print(f'{worst / middle:.2f} |', flush=True)


if __name__ == '__main__':
    main()
