"""A preference for what pushes: joints that yield within the null space."""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from redres_ros.errors import ArrayError
from redres_ros.parameter import param
from redres_ros.preferences.preference import Preference
from redres_ros.robot_model import RobotState


@dataclass(frozen=True)
class Compliance(Preference):
    """Yielding to torques from outside: ddq_N = k tau_ext; nothing while none are measured."""

    measurement: ClassVar[str] = 'external_torques'
    gain: float = param(1.0, 'k, acceleration for each Nm [rad/(s^2 Nm)]', 0.0, 1e4)

    def acceleration(self, state: RobotState) -> np.ndarray:
        torques = state.measurements.get(self.measurement)
        if torques is None:
            return np.zeros(len(state.q))
        if torques.shape != state.q.shape:
            raise ArrayError(
                f'{self.measurement} has the shape {torques.shape}; expected {state.q.size} values'
            )
        ddq_N: np.ndarray = self.gain * torques
        return ddq_N
