"""The six laws of the paper, each a weight W and a bias b of the same problem.

    minimise 1/2 (dq - b)' W (dq - b)   subject to   J dq = dx           Eq. (A.13)

| law                     | W    | b                                        | Eq.                |
|-------------------------|------|------------------------------------------|--------------------|
| minimum velocity        | I    | 0                                        | (2), dq_N = 0      |
| minimum acceleration    | I    | lambda dq_{k-1}                          | (15), (17), (23)   |
| minimum kinetic energy  | M    | 0                                        | (A.13)             |
| minimum weighted torque | I    | lambda dq_{k-1} - T M^-1 n               | (24)-(27)          |
| dynamically consistent  | M    | lambda dq_{k-1} - T M^-1 n               | (28)-(34), (32)    |
| minimum torque          | M M  | lambda dq_{k-1} - T M^-1 n               | (7), (A.14)        |

lambda = 1 - k_d T is the forgetting factor, Eq. (23), k_d the null-space damping of Eq. (21). With
damping = 1/T, lambda = 0, the dynamically consistent law is Eq. (35).
"""

from abc import ABC, abstractmethod
from dataclasses import dataclass
from functools import cache
from typing import Any, ClassVar

import numpy as np

from redres_ros.errors import RangeError
from redres_ros.kernels.closed_form import free_motion
from redres_ros.kernels.tick import multiply
from redres_ros.parameter import Checked, Table, param
from redres_ros.resolution import Square, Weight
from redres_ros.robot_model import RobotState
from redres_ros.types import JointVelocities, Seconds

HORIZON = 2.0  # [s] for which nodes look ahead where they know a path
_Objective = tuple[Weight, JointVelocities, Any]  # W, b, and the plan of a law that looks ahead


@dataclass(frozen=True)
class Law(Checked, ABC):
    """A law at the velocity level: a frozen dataclass whose `param` fields are its gains."""

    has_memory: ClassVar[bool] = True  # has the last velocity in its bias, and so takes preferences
    damping: float = param(10.0, 'null-space damping k_d [1/s]', 0.0, 1e5)

    @abstractmethod
    def bias(self, state: RobotState, T: Seconds) -> JointVelocities:
        """b."""

    def weight(self, state: RobotState) -> Weight:
        """W; None for the identity."""
        return None

    def objective(self, state: RobotState, T: Seconds) -> _Objective:
        """W and b, and what the next tick continues."""
        return self.weight(state), self.bias(state, T), None

    @property
    def horizon(self) -> Seconds:
        """How long a path it wants to know ahead; 0 for none."""
        return 0.0

    def forgetting_factor(self, T: Seconds) -> float:
        """lambda = 1 - k_d T, Eq. (23)."""
        return 1.0 - self.damping * T

    def check_damping(self, T: Seconds) -> None:
        """Raise RangeError unless 0 <= k_d <= 1/T: the rest oscillates or diverges (Appendix B)."""
        if not 0.0 <= self.damping * T <= 1.0 + 1e-12:
            allowed = f'0 <= k_d <= 1/T by Appendix B, with T = {T:g} s'
            raise RangeError('damping', self.damping, 0.0, 1.0 / T, allowed)


@cache  # an import takes 0.6 us again
def _look_ahead() -> Any:
    """The function, which is compiled: loaded only if in use."""
    from redres_ros.laws.look_ahead import look_ahead

    return look_ahead


@dataclass(frozen=True)
class MinimumVelocity(Law):
    """Least joint velocity, Eq. (2) with dq_N = 0. It has no history: damping has no effect."""

    has_memory: ClassVar[bool] = False

    def bias(self, state: RobotState, T: Seconds) -> JointVelocities:
        return np.zeros(len(state.q))


@dataclass(frozen=True)
class MinimumAcceleration(Law):
    """Least joint acceleration, Eq. (15), (17), (23); with a horizon, over all of it."""

    effort: ClassVar[bool] = False  # torques count, too
    horizon: float = param(
        0.0, 'for how long to look ahead along a path that is known; 0: not at all [s]', 0.0, 10.0
    )

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.horizon > 0.0:
            _look_ahead()  # which no tick may wait for

    def bias(self, state: RobotState, T: Seconds) -> JointVelocities:
        b = state.dq_prev.copy()
        multiply(self.forgetting_factor(T), b)  # in half of numpy's time
        return b  # lambda dq_{k-1}, Eq. (23)

    def objective(self, state: RobotState, T: Seconds) -> _Objective:
        ahead = state.ahead
        if ahead is not None and self.horizon > 0.0:
            planned = _look_ahead()(state, ahead, T, self.horizon, self.damping, effort=self.effort)
            if planned is not None:
                return planned
        return None, self.bias(state, T), None


@dataclass(frozen=True)
class MinimumEffortAhead(MinimumAcceleration):
    """Least torque beyond gravity, Eq. (6), and acceleration, over the next seconds of a path."""

    effort: ClassVar[bool] = True
    horizon: float = param(1.0, 'for how long to look ahead along a path [s]', 0.0, 10.0)


@dataclass(frozen=True)
class MinimumKineticEnergy(MinimumVelocity):
    """Least kinetic energy 1/2 dq' M dq, Eq. (A.13) with W = M; no history either."""

    def weight(self, state: RobotState) -> Weight:
        return state.M


@dataclass(frozen=True)
class MinimumWeightedTorque(Law):
    """Least torque in the norm of M^-2, Eq. (24)-(26) -> (27).

    The bias is the velocity after one tick of zero torque and null-space damping. Gravity moves
    the null space, unless its torques are left out.
    """

    gravity: float = param(
        1.0, 'fraction of the weight in the torques; 0: the robot carries itself [-]', 0.0, 1.0
    )

    def bias(self, state: RobotState, T: Seconds) -> JointVelocities:
        n = state.n
        if self.gravity < 1.0:
            n = n - (1.0 - self.gravity) * state.gravity
        b = np.empty(len(state.q))
        free_motion(self.forgetting_factor(T), state.dq_prev, T, state.M, n, b)
        return b  # lambda dq_{k-1} - T M^-1 n, Eq. (27), (32), (A.14)


@dataclass(frozen=True)
class DynamicallyConsistent(MinimumWeightedTorque):
    """Least torque in the norm of M^-1, Eq. (28)-(34) -> (32)."""

    def weight(self, state: RobotState) -> Weight:
        return state.M


@dataclass(frozen=True)
class MinimumTorque(MinimumWeightedTorque):
    """Least torque in the plain norm, Eq. (7) with (A.14)."""

    def weight(self, state: RobotState) -> Weight:
        return Square(state.M)


# A new law is one small class and one line in this table.
LAWS: Table[Law] = Table(
    'law',
    Law,
    minimum_velocity=MinimumVelocity,
    minimum_acceleration=MinimumAcceleration,
    minimum_kinetic_energy=MinimumKineticEnergy,
    minimum_weighted_torque=MinimumWeightedTorque,
    dynamically_consistent=DynamicallyConsistent,
    minimum_torque=MinimumTorque,
    minimum_effort_ahead=MinimumEffortAhead,
)
make_law = LAWS.make
law_name = LAWS.name_of
