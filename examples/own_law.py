"""Write a law of your own: a weight W and a bias b, and nothing else.

This one lets the arm move with its wrist rather than with its shoulder: the first joints weigh
more. Run it with: python examples/own_law.py
As a plugin: redres simulate --plugin examples/own_law.py --law wrist_first
"""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from redres_ros import Controller, Law, RobotModel, RobotState, load_task, make_law, param, run


@dataclass(frozen=True)
class WristFirst(Law):
    """Least velocity, where a joint weighs `ratio` times as much as the next one."""

    has_memory: ClassVar[bool] = False  # the last velocity does not matter
    ratio: float = param(2.0, 'weight of a joint, relative to the next [-]', 1.0, 10.0)

    def bias(self, state: RobotState, T: float) -> np.ndarray:
        return np.zeros(len(state.q))  # best of all: no motion

    def weight(self, state: RobotState) -> np.ndarray:
        places = np.arange(len(state.q))
        return np.diag(self.ratio ** -places.astype(float))


if __name__ == '__main__':  # and not where it is loaded as a plugin
    task = load_task('rectangle')
    model = RobotModel.named(task.robot)
    for law in (make_law('minimum_velocity'), WristFirst(ratio=3.0)):
        controller = Controller(model, law, T=0.002)
        recording = run(controller, task)
        shoulder = abs(recording['dq1']).max()
        print(f'{type(law).__name__:<16} fastest motion of the first joint {shoulder:.3f} rad/s')
