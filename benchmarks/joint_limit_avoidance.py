"""What the preference joint_limit_avoidance brings an operator who steers the tip to goals.

    python benchmarks/joint_limit_avoidance.py [--task position|pose] [--arm NAME ...]

One row an arm and seed, 120 simulated seconds without the preference and with it. A position task
has goals without orientation, and turns of the tip count for nothing.
"""

import argparse
import sys
from collections.abc import Callable
from dataclasses import replace

import numpy as np

from redres_ros import RobotModel
from redres_ros.bench.teleoperation import HEADS, T, cells, figures_of, our_follower, steered
from redres_ros.simulation.operators import GoalOperator, TipGoal
from redres_ros.simulation.parallel import in_parallel

ARMS = ('fr3', 'iiwa7', 'lwr4')
SEEDS = 3
DURATION = 120.0  # [s]
SETTINGS = ((), ('joint_limit_avoidance',))  # preferences of the two runs
SHOWN = ('near an end', 'stuck', 'longest [s]', 'goals reached / given up')  # of HEADS


class PositionOperator(GoalOperator):
    """A GoalOperator to whom orientations do not matter."""

    def _next_goal(self) -> TipGoal:
        return super()._next_goal()._replace(R=None)


def main() -> int:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument('--task', choices=('position', 'pose'), default='position')
    parser.add_argument('--arm', nargs='+', default=ARMS, help='names; default: %(default)s')
    options = parser.parse_args()
    runs = [(options.task, arm, seed) for arm in options.arm for seed in range(SEEDS)]
    print('| |', ' '.join(f'{head}, without | with |' for head in SHOWN))
    print('|---' * (1 + len(SHOWN) * len(SETTINGS)) + '|')
    for line in in_parallel(row, runs, lambda fraction: None):
        print(line)
    return 0


def row(run: tuple[str, str, int], progress: Callable[[float], None]) -> str:
    """One arm and seed, as a row of the table.

    Args:
        run: Task, arm and seed.
        progress: As of in_parallel().
    """
    task, arm, seed = run
    found: list[dict[str, str]] = []
    for preferences in SETTINGS:
        model = RobotModel.named(arm)
        operator = (PositionOperator if task == 'position' else GoalOperator)(model, T, seed)
        follow = our_follower(model, 'components', preferences, task)
        motion = steered(operator, model, follow, DURATION, progress)
        if task == 'position':
            motion = replace(motion, R=np.tile(np.eye(3), (len(motion.q), 1, 1)))
        figures = figures_of(motion, model, operator)
        found.append(dict(zip(HEADS, cells(figures), strict=True)))
    pairs = [' | '.join(each[head] for each in found) for head in SHOWN]
    return f'| {arm}, seed {seed} | {" | ".join(pairs)} |'


if __name__ == '__main__':
    sys.exit(main())
