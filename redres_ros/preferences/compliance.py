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
    """Yielding to torques from outside: ddq_N = k M^-p tau_ext; nothing while none are measured.

    If the law's weight W is M^p, a force f on the tip moves nothing in the null space, dq = Z z:
    Z' W M^-p J' f = (J Z)' f = 0.
    """

    measurement: ClassVar[str] = 'external_torques'
    gain: float = param(1.0, 'k; with p = 0 in [rad/(s^2 Nm)], with p = 1 in [1]', 0.0, 1e4)
    inertia_power: int = param(0, "p of M^-p: that of the law's weight W = I, M or M M [1]", 0, 2)

    def acceleration(self, state: RobotState) -> np.ndarray:
        torques = state.measurements.get(self.measurement)
        if torques is None:
            return np.zeros(len(state.q))
        if torques.shape != state.q.shape:
            raise ArrayError(
                f'{self.measurement} has the shape {torques.shape}; expected {state.q.size} values'
            )
        ddq_N: np.ndarray = self.gain * torques
        for _ in range(self.inertia_power):
            ddq_N = np.linalg.solve(state.M, ddq_N)
        return ddq_N
