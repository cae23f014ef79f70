"""Whether slow ticks are slow every time: then they are our work, otherwise the machine's.

A motion of `redres bench` is run again and again, and the least time of each of its ticks counts.

    python benchmarks/slow_ticks.py [--rounds N]

prints one row a candidate: median, p99 and worst of all ticks as they came, and of those least
times.
"""

import argparse
import time

import numpy as np

from redres_ros import Controller, RobotModel
from redres_ros.bench.tick import Stretch, controllers, recorded

WARM_UP = 3  # rounds


def times(controller: Controller, stretch: Stretch, rounds: int) -> np.ndarray:
    """Of each tick in each round, (rounds, ticks) [us].

    Args:
        controller: What is timed.
        stretch: Its states and task velocities.
        rounds: How often.
    """
    found = np.empty((rounds, len(stretch.q)))
    for turn in range(-WARM_UP, rounds):
        for k, (q, dx) in enumerate(zip(stretch.q, stretch.dx, strict=True)):
            begin = time.perf_counter()
            controller.update(q, dx)
            end = time.perf_counter()
            if turn >= 0:
                found[turn, k] = 1e6 * (end - begin)
    return found


def row(found: np.ndarray) -> str:
    """Median, p99 and worst."""
    return f'{np.median(found):.1f} | {np.quantile(found, 0.99):.1f} | {found.max():.1f}'


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument('--rounds', type=int, default=50)
    options = parser.parse_args()
    model = RobotModel.named('lwr4_paper')
    stretch = recorded(model)
    print('| tick | median [us] | p99 | worst | least times: median | p99 | worst |')
    print('|---|---|---|---|---|---|---|')
    for name, controller in controllers(model).items():
        found = times(controller, stretch, options.rounds)
        print(f'| {name} | {row(found)} | {row(found.min(axis=0))} |', flush=True)


if __name__ == '__main__':
    main()
