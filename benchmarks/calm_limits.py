"""How calmly joints move where limits act: the rectangle there and back at 0.4 of the limits.

    python benchmarks/calm_limits.py [--limit-scale X] [--law NAME]

One row a law: with the greedy path, which asks for its full speed in every tick, and with the one
that is braked and resumed slowly. Turns of the wrist are changes of the sign of A5's acceleration,
among the ticks in which it is above half of what is allowed.
"""

import argparse
import sys
from dataclasses import replace

import numpy as np

from redres_ros import LAWS, Controller, RobotModel, load_task, run
from redres_ros.simulation.recording import Recording

T = 0.002  # [s]
LIMITS = ('position', 'velocity', 'acceleration')
WRIST = 4  # joint A5
FULL = 0.99  # of the allowed acceleration, counts as all of it
HARD = 0.5  # of it, counts as a turn


def main() -> int:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument('--limit-scale', type=float, default=0.4, help='of the limits; default 0.4')
    parser.add_argument('--law', choices=LAWS, help='default: all')
    options = parser.parse_args()
    print('| law | path | time [s] | least s | ticks at full acceleration | turns of the wrist |')
    print('|---|---|---|---|---|---|')
    for law in [options.law] if options.law else LAWS:
        for greedy in (True, False):
            print(row(law, greedy, options.limit_scale), flush=True)
    return 0


def row(law: str, greedy: bool, limit_scale: float) -> str:
    """One motion, as a row of the table.

    Args:
        law: Its name.
        greedy: As of run().
        limit_scale: Fraction of the limits.
    """
    task = load_task('rectangle')
    task = replace(task, waypoints=np.vstack((task.waypoints, task.waypoints[2::-1])))
    model = RobotModel.named(task.robot)
    controller = Controller(model, law, T, limits=LIMITS, limit_scale=limit_scale)
    recording = run(controller, task, greedy=greedy)
    usage = accelerations(recording) / (limit_scale * np.array(model.arm.acceleration_limit))
    full = int((np.abs(usage) > FULL).any(axis=1).sum())
    path = 'greedy' if greedy else 'braked'
    least = recording['task_scaling'].min()
    time = f'{recording["t"][-1]:.2f}' if recording.finished else recording.ending
    return f'| `{law}` | {path} | {time} | {least:.2f} | {full} | {turns(usage[:, WRIST])} |'


def accelerations(recording: Recording) -> np.ndarray:
    """Of the joints, (ticks - 1, n) [rad/s^2]."""
    changes: np.ndarray = np.diff(recording.vectors('dq1'), axis=0) / recording.T
    return changes


def turns(usage: np.ndarray) -> int:
    """How often an acceleration, (ticks,) as a fraction of what is allowed, changes its sign."""
    signs = np.sign(usage[np.abs(usage) > HARD])
    return int((np.diff(signs) != 0.0).sum())


if __name__ == '__main__':
    sys.exit(main())
