"""A preference of your own, in a file that every command and node can load.

Try it with: redres simulate --plugin examples/own_preference.py --prefer elbow_forward=4
Nodes load it with the parameter plugins, as [/home/me/own_preference.py].
"""

from dataclasses import dataclass

import numpy as np

from redres_ros import Preference, RobotState


@dataclass(frozen=True)
class ElbowForward(Preference):
    """The elbow towards the base's x: ddq_N = k dx_elbow/dq."""

    def acceleration(self, state: RobotState) -> np.ndarray:
        return self.gain * state.jacobian(state.model.elbow_frame)[0]
