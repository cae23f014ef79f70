"""The base class of laws: a weight W and a bias b for the formula in resolution.py."""

from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from redres_ros.errors import RangeError
from redres_ros.parameter import check_parameters, param
from redres_ros.resolution import Weight
from redres_ros.robot_model import RobotState


@dataclass(frozen=True)
class Law(ABC):
    """A redundancy resolution law at the velocity level: dq = argmin 1/2 (dq - b)' W (dq - b)
    subject to J dq = dx.

    A subclass is a frozen dataclass whose fields, declared with `param`, are its gains. damping is
    k_d of Eq. (21); it acts through the forgetting factor lambda = 1 - k_d T (Appendix B).
    """

    has_memory: ClassVar[bool] = True  # has the last velocity in its bias, and so takes preferences
    damping: float = param(10.0, 'null-space damping k_d [1/s]', 0.0, 1e5)

    def __post_init__(self) -> None:
        check_parameters(self)

    @abstractmethod
    def bias(self, state: RobotState, T: float) -> np.ndarray:
        """The bias b, (n,) [rad/s].

        Args:
            state: State of the arm at this tick.
            T: Sampling time [s].
        """

    def bias_with(self, state: RobotState, T: float, ddq_N: np.ndarray | None) -> np.ndarray:
        """b + T ddq_N, (n,) [rad/s], Eq. (19); b itself for a law without velocity history.

        Args:
            state: The state of the tick.
            T: Sampling time [s].
            ddq_N: (n,) [rad/s^2], the sum of the preferences; None without any.
        """
        b = self.bias(state, T)
        if ddq_N is None or not self.has_memory:
            return b
        return b + T * ddq_N

    def weight(self, state: RobotState) -> Weight:
        """W, symmetric positive definite, (n, n), or its Factor; None for the identity."""
        return None

    def forgetting_factor(self, T: float) -> float:
        """lambda = 1 - k_d T, Eq. (23)."""
        return 1.0 - self.damping * T

    def check_damping(self, T: float) -> None:
        """Raise RangeError unless 0 <= k_d <= 1/T: beyond it null-space motion oscillates or
        diverges (Appendix B).
        """
        if not 0.0 <= self.damping * T <= 1.0 + 1e-12:
            raise RangeError(
                'damping',
                self.damping,
                0.0,
                1.0 / T,
                f'0 <= k_d <= 1/T by Appendix B, with T = {T:g} s',
            )
