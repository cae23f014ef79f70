"""A law and a preference of your own, in a file that every command and node can load.

Try it with: redres simulate --plugin examples/plugin.py --law wrist_first
Nodes load it with the parameter plugins, as [/home/me/plugin.py].
"""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from redres_ros import Law, Preference, RobotState, param


@dataclass(frozen=True)
class WristFirst(Law):
    """Least velocity, where a joint weighs `ratio` times as much as the next one."""

    remembers: ClassVar[bool] = False  # the last velocity does not matter
    ratio: float = param(2.0, 'weight of a joint, relative to the next [-]', 1.0, 10.0)

    def bias(self, state: RobotState, T: float) -> np.ndarray:
        return np.zeros(len(state.q))  # best of all: no motion

    def weight(self, state: RobotState) -> np.ndarray:
        places = np.arange(len(state.q))
        return np.diag(self.ratio ** -places.astype(float))


@dataclass(frozen=True)
class ElbowForward(Preference):
    """The elbow towards the base's x: ddq_N = k dx_elbow/dq."""

    def acceleration(self, state: RobotState) -> np.ndarray:
        return self.gain * state.jacobian(state.model.elbow_frame)[0]
