"""The base class of preferences: an auxiliary joint acceleration, Eq. (19)."""

from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import ClassVar, Self

import numpy as np

from redres_ros.parameter import check_parameters, param
from redres_ros.robot_model import RobotState

_LITTLE = 1e-3  # [rad/s^2]


@dataclass(frozen=True)
class Preference(ABC):
    """A null-space objective, as a joint acceleration.

    It adds T ddq_N to the bias of every law that remembers the last velocity; several of them add
    up. A subclass is a frozen dataclass whose fields are declared with `param`.

    One that uses a sensor names its `measurement`, finds it in `state.measurements` while it is
    fresh, and is zero without it. In Python `Controller.measurements` holds them; the node
    subscribes to a topic of that name.
    """

    measurement: ClassVar[str] = ''
    gain: float = param(4.0, 'k of the auxiliary acceleration [1/s^2]', 0.0, 1e4)

    def __post_init__(self) -> None:
        check_parameters(self)

    @abstractmethod
    def acceleration(self, state: RobotState) -> np.ndarray:
        """ddq_N, (n,) [rad/s^2]."""

    def asks(self, state: RobotState) -> bool:
        """Whether a measurement is to move an arm that is at rest."""
        if self.measurement not in state.measurements:
            return False
        return bool((np.abs(self.acceleration(state)) > _LITTLE).any())

    def with_initial_targets(self, state: RobotState) -> Self:
        """A copy with unset targets taken from the current state."""
        return self
