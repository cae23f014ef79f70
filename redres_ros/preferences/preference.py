"""The base class of preferences: an auxiliary joint acceleration, Eq. (19)."""

from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import Self

import numpy as np

from redres_ros.parameter import check_parameters, param
from redres_ros.robot_model import RobotState


@dataclass(frozen=True)
class Preference(ABC):
    """A null-space objective, as a joint acceleration.

    It adds T ddq_N to the bias of every law that remembers the last velocity; several of them add
    up. A subclass is a frozen dataclass whose fields are declared with `param`.
    """

    gain: float = param(4.0, 'k of the auxiliary acceleration [1/s^2]', 0.0, 1e4)

    def __post_init__(self) -> None:
        check_parameters(self)

    @abstractmethod
    def acceleration(self, state: RobotState) -> np.ndarray:
        """ddq_N, (n,) [rad/s^2]."""

    def with_initial_targets(self, state: RobotState) -> Self:
        """A copy with unset targets taken from the current state."""
        return self
