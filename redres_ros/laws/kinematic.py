"""Laws that need no dynamics: least velocity (2) and least acceleration (15), (17), (23)."""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from redres_ros.laws.law import Law
from redres_ros.robot_model import RobotState


@dataclass(frozen=True)
class MinimumVelocity(Law):
    """Least joint velocity, Eq. (2) with dq_N = 0. It has no history, and damping has no
    effect.
    """

    has_memory: ClassVar[bool] = False

    def bias(self, state: RobotState, T: float) -> np.ndarray:
        return np.zeros(len(state.q))


@dataclass(frozen=True)
class MinimumAcceleration(Law):
    """Least joint acceleration, Eq. (15) and (17), with null-space damping, Eq. (22) -> (23)."""

    def bias(self, state: RobotState, T: float) -> np.ndarray:
        return self.forgetting_factor(T) * state.dq_prev  # lambda dq_{k-1}
