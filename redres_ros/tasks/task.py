"""The base class of tasks: the Jacobian J of one aim, and its task velocity."""

from abc import ABC, abstractmethod
from dataclasses import dataclass, replace
from typing import ClassVar, Self

import numpy as np

from redres_ros.errors import ArrayError
from redres_ros.parameter import check_parameters, param
from redres_ros.robot_model import RobotModel, RobotState


@dataclass(frozen=True)
class Task(ABC):
    """One aim of the arm: J dq = dx, with dx = k e if the task has a target of its own.

    The first task of a controller gets its dx from outside. The others hold their targets. A target
    that is left open, (), becomes the value at the start of the motion. A subclass is a frozen
    dataclass whose fields are declared with `param`, its target among them.
    """

    size: ClassVar[int]  # m, the number of rows
    target_size: ClassVar[int] = 0  # how many numbers the target has; 0: as many as rows
    components: ClassVar[tuple[int, ...]] = ()  # rows of translation, of rotation; empty: one only
    gain: float = param(10.0, 'k in dx = k e, of the error to the target [1/s]', 0.0, 1e3)
    target: tuple[float, ...] = ()

    def __post_init__(self) -> None:
        check_parameters(self)
        name = f'target of {type(self).__name__.lower()}'
        check_length(name, self.target, self.target_size or self.size)

    def rows(self, model: RobotModel) -> int:
        """m, the number of rows for an arm."""
        return self.size

    @abstractmethod
    def jacobian(self, state: RobotState) -> np.ndarray:
        """J, (m, n)."""

    @abstractmethod
    def value(self, state: RobotState) -> np.ndarray:
        """Where the task is at this state, in the form of a target, (target_size,)."""

    def error(self, state: RobotState) -> np.ndarray:
        """The task error e, (m,), towards the target, which is set."""
        return np.array(self.target) - self.value(state)

    def with_initial_targets(self, state: RobotState) -> Self:
        """A copy with an unset target taken from the current state."""
        return replace(self, target=self.target or tuple(self.value(state).tolist()))

    def velocity(self, state: RobotState) -> np.ndarray:
        """dx = k e, (m,)."""
        return self.gain * self.error(state)

    def derivatives(self, state: RobotState) -> np.ndarray | None:
        """dJ/dq_i, (n, m, n), by which the arm finds the escape direction from a singularity.

        None for a task that does not know them; it is stuck where J alone shows none.
        """
        return None

    def row_scale(self, model: RobotModel) -> np.ndarray | None:
        """Factors (m,) that make rows of different units comparable; None if all are alike."""
        return None


@dataclass(frozen=True)
class FrameTask(Task):
    """A task of one frame of the arm."""

    frame: str = param('', 'frame of the task; empty: the tip')


def check_length(name: str, values: tuple[float, ...], length: int) -> None:
    """Refuse a target, or another vector, that does not suit a task.

    Args:
        name: What an error calls it.
        values: The target; () if it is open.
        length: The one that is allowed; 0: any.

    Raises:
        ArrayError: It has another length, or is not finite.
    """
    if values and length and len(values) != length:
        raise ArrayError(f'{name} holds {len(values)} numbers; expected {length}, or none')
    if not np.isfinite(values).all():
        raise ArrayError(f'{name} is {values}; every value must be finite')
