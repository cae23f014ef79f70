"""The six laws of the paper, each a choice of W and b; the last four use Eq. (6)."""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from redres_ros.kernels.closed_form import free_motion
from redres_ros.laws.law import Law
from redres_ros.parameter import param
from redres_ros.resolution import Square, Weight
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


@dataclass(frozen=True)
class MinimumKineticEnergy(Law):
    """Least kinetic energy 1/2 dq' M dq, Eq. (A.13) with W = M. It has no history, and damping
    has no effect.
    """

    has_memory: ClassVar[bool] = False

    def bias(self, state: RobotState, T: float) -> np.ndarray:
        return np.zeros(len(state.q))

    def weight(self, state: RobotState) -> Weight:
        return state.M


@dataclass(frozen=True)
class _TorqueLaw(Law):
    """The bias that the torque laws share: the velocity after one tick of zero torque and
    null-space damping. Gravity moves the null space, unless its torques are left out.
    """

    gravity: float = param(
        1.0, 'fraction of the weight in the torques; 0: the robot carries itself [-]', 0.0, 1.0
    )

    def bias(self, state: RobotState, T: float) -> np.ndarray:
        n = state.n
        if self.gravity < 1.0:
            n = n - (1.0 - self.gravity) * state.gravity
        b = np.empty(len(state.q))  # lambda dq_{k-1} - T M^-1 n, Eq. (27), (32), (A.14)
        free_motion(self.forgetting_factor(T), state.dq_prev, T, state.M, n, b)
        return b


@dataclass(frozen=True)
class MinimumWeightedTorque(_TorqueLaw):
    """Least torque in the norm of M^-2, Eq. (24)-(26) -> (27), with W = I."""


@dataclass(frozen=True)
class DynamicallyConsistent(_TorqueLaw):
    """Least torque in the norm of M^-1, Eq. (28)-(34) -> (32), with W = M; Eq. (35) is the special
    case damping = 1/T.
    """

    def weight(self, state: RobotState) -> Weight:
        return state.M


@dataclass(frozen=True)
class MinimumTorque(_TorqueLaw):
    """Least torque in the plain norm, Eq. (7) with (A.14): W = M^2."""

    def weight(self, state: RobotState) -> Weight:
        return Square(state.M)
