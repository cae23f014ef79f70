"""Minutes of an FR3 at its full limits and 1 kHz: how often the robot stops it by a reflex.

    python benchmarks/reflexes.py [--seconds S] [--law NAME] [--lost FRACTION]

Each law runs the square, the pose task, and a pose under an operator who steers to goals and under
one who sends random twists, who share the seconds that remain. The robot is the fake one with the
profile `fci`; of what is commanded, a fraction gets lost at random. Exit status 1 tells of a
reflex. Needs the extra test.
"""

import argparse
import sys
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from redres_ros import LAWS, RobotModel
from redres_ros.simulation.operators import BlindOperator, GoalOperator

sys.path.insert(0, str(Path(__file__).parents[1] / 'test'))

from test_reflexes import T, followed, full_limits, planned, steered


def main() -> int:
    """Print one line for each motion, and their sum."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument('--seconds', type=float, default=100.0, help='of each law; default 100')
    parser.add_argument('--law', choices=LAWS, help='default: all')
    parser.add_argument('--lost', type=float, default=0.0, help='of the commands; default 0')
    options = parser.parse_args()
    seconds = 0.0
    reflexes = 0
    for law in [options.law] if options.law else LAWS:
        for name, motion in motions(law, options.lost, options.seconds):
            client = followed(motion, options.lost)
            executed = T * len(client.states)
            seconds += executed
            reflexes += bool(client.session.reason)
            print(f'{law}, {name}: {executed:.1f} s {client.session.reason}', flush=True)
    print(f'{seconds:.0f} s, {options.lost:.0%} of the commands lost: {reflexes} reflexes')
    return int(reflexes > 0)


def motions(
    law: str, lost: float, seconds: float
) -> Iterator[tuple[str, np.ndarray | Iterator[np.ndarray]]]:
    """Names and commands of the motions of a law.

    Args:
        law: Its name.
        lost: Fraction of the commands that get lost.
        seconds: Of all of them [s].
    """
    for task in ('position', 'pose'):
        recording = planned(law, task, lost)
        commands = recording.vectors('q1')
        seconds -= T * len(commands)
        yield f'{task} task, which {recording.ending}', commands
    goal = GoalOperator(RobotModel.named('fr3'), T, seed=0)
    for operator in (goal, BlindOperator(T, seed=0)):
        controller = full_limits(law, 'pose', lost)
        yield type(operator).__name__, steered(controller, operator, seconds / 2.0)


if __name__ == '__main__':
    sys.exit(main())
