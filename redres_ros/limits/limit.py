"""The base class of limits: rows low <= C dq <= high, or a part of the box of the joints."""

from abc import ABC, abstractmethod
from dataclasses import dataclass, field
from typing import ClassVar

import numpy as np

from redres_ros.parameter import Checked, Parameter, check_value
from redres_ros.robot_model import RobotModel, RobotState
from redres_ros.solver import Rows
from redres_ros.types import JointVelocities, Seconds

ReferenceState = RobotState  # at the reference that is integrated, with the last command

_SCALE = Parameter('fraction of the limit that is allowed', 1e-3, 1.0)


@dataclass(frozen=True, eq=False)
class Limit(Checked, ABC):
    """A bound on joint velocities. A subclass is a frozen dataclass, whose fields that are declared
    with `param` are what users set.

    One that uses a sensor names its `measurement` and finds it in `state.measurements` while it is
    fresh, as a Preference does. Without a fresh value it must be on the safe side.
    """

    order: ClassVar[int]  # among rows: a lower number is kept before a higher one
    measurement: ClassVar[str] = ''
    scaled_by: ClassVar[str] = 'limit_scale'  # the parameter that sets `scale` of all such limits
    still_brakes: ClassVar[bool] = False  # whether it makes an arm that is stopped brake harder

    model: RobotModel = field(repr=False)
    scale: float = 1.0  # fraction of the arm's limits that is allowed

    def __post_init__(self) -> None:
        check_value(self.scaled_by, self.scale, _SCALE)
        super().__post_init__()

    @abstractmethod
    def rows(self, state: ReferenceState, T: Seconds) -> Rows:
        """C (r, n), low (r,) and high (r,) with low <= C dq <= high."""

    def can_be_kept(self, dq: JointVelocities, state: ReferenceState, T: Seconds) -> bool:
        """Whether the joints can brake without leaving it, after a velocity that keeps its rows."""
        return True

    def name(self, row: int, state: ReferenceState, T: Seconds) -> str:
        """The joint, or pair of bodies, that a row belongs to."""
        return self.model.joint_names[row]


class JointLimit(Limit):
    """A limit of the single joints: all of them are one box, which is always kept."""

    box: ClassVar[int]  # its own, in the order of kernels/boxes.py

    @abstractmethod
    def _enter(self, limits: np.ndarray) -> None:
        """Enter it into the limits of the joints, (n,) of JOINT_LIMITS."""

    def rows(self, state: ReferenceState, T: Seconds) -> Rows:
        return np.empty((0, self.model.n)), np.empty(0), np.empty(0)
