"""The base classes of limits: a box lower <= dq <= upper, or rows low <= C dq <= high."""

from abc import ABC, abstractmethod
from dataclasses import dataclass, field
from typing import ClassVar

import numpy as np

from redres_ros.parameter import Parameter, check_parameters, check_value
from redres_ros.robot_model import RobotModel, RobotState
from redres_ros.solver import Box, Rows

ReferenceState = RobotState  # at the reference that is integrated, with the last command

_SCALE = Parameter('fraction of the limit that is allowed', 1e-3, 1.0)


@dataclass(frozen=True, eq=False)
class Limit(ABC):
    """A bound on joint velocities: a BoxLimit or a RowLimit.

    A subclass is a frozen dataclass. Its figures come from the model; the fields that it declares
    with `param` are what users set.

    One that uses a sensor names its `measurement` and finds it in `state.measurements` while it is
    fresh, as a Preference does. Without a fresh value it must be on the safe side.

    Args:
        model: the arm.
        scale: the fraction of the arm's figures that is allowed.
    """

    order: ClassVar[int]  # among boxes, and among rows: a lower number is kept before a higher one
    measurement: ClassVar[str] = ''
    scaled_by: ClassVar[str] = 'limit_scale'  # the parameter that sets `scale` of all such limits

    model: RobotModel = field(repr=False)
    scale: float = 1.0

    def __post_init__(self) -> None:
        check_value(self.scaled_by, self.scale, _SCALE)
        check_parameters(self)

    def place(self, state: ReferenceState, index: int, T: float) -> str:
        """The name of a bound's joint, or pair of bodies.

        Args:
            state: Of the reference at this tick.
            index: Number of the bound.
            T: Sampling time [s].
        """
        return self.model.joint_names[index]


class BoxLimit(Limit):
    """A limit on single joints, as a box."""

    @abstractmethod
    def box(self, state: ReferenceState, T: float) -> Box:
        """lower and upper of dq, both (n,) [rad/s].

        Args:
            state: Of the reference at this tick.
            T: Sampling time [s].
        """


class RowLimit(Limit):
    """A limit that couples joints, as rows."""

    holds_in_a_stop: ClassVar[bool] = False  # whether it makes an arm that is stopped brake harder

    @abstractmethod
    def rows(self, state: ReferenceState, T: float) -> Rows:
        """C (r, n), low (r,) and high (r,) with low <= C dq <= high.

        Args:
            state: Of the reference at this tick.
            T: Sampling time [s].
        """

    def is_kept(self, dq: np.ndarray, state: ReferenceState, T: float) -> bool:
        """Whether a velocity keeps it, if that takes less time than its rows; else False.

        Args:
            dq: (n,) [rad/s].
            state: Of the reference at this tick.
            T: Sampling time [s].
        """
        return False

    def can_be_kept(self, dq: np.ndarray, state: ReferenceState, T: float) -> bool:
        """Whether the joints can brake without leaving it, after a velocity that keeps its rows.

        Args:
            dq: (n,) [rad/s].
            state: Of the reference at this tick.
            T: Sampling time [s].
        """
        return True
