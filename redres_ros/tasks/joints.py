"""Tasks of the elbow and of single joints."""

from dataclasses import dataclass, replace
from typing import ClassVar, Self

import numpy as np

from redres_ros.errors import UnknownNameError
from redres_ros.parameter import param
from redres_ros.robot_model import RobotModel, RobotState
from redres_ros.tasks.task import Task, check_target


@dataclass(frozen=True)
class Elbow(Task):
    """Where the arm's elbow is: 3 rows [m/s], of which those that it cannot follow are left."""

    size: ClassVar[int] = 3
    target: tuple[float, ...] = param(
        (), 'desired position of the elbow in the base frame [m]; none: that of the start'
    )

    def __post_init__(self) -> None:
        super().__post_init__()
        check_target('target of elbow', self.target, 3)

    def jacobian(self, state: RobotState) -> np.ndarray:
        return state.jacobian(state.model.elbow_frame)[:3]

    def error(self, state: RobotState) -> np.ndarray:
        return np.array(self.target) - state.pose(state.model.elbow_frame)[0]

    def with_initial_targets(self, state: RobotState) -> Self:
        x, _ = state.pose(state.model.elbow_frame)
        return replace(self, target=self.target or tuple(x.tolist()))


@dataclass(frozen=True)
class Joint(Task):
    """The angle of one joint: 1 row [rad/s]."""

    size: ClassVar[int] = 1
    joint: str = param('', 'name of the joint; empty: the first one')
    target: tuple[float, ...] = param((), 'desired angle [rad]; none: that of the start')

    def __post_init__(self) -> None:
        super().__post_init__()
        check_target('target of joint', self.target, 1)

    def jacobian(self, state: RobotState) -> np.ndarray:
        J = np.zeros((1, len(state.q)))
        J[0, self._index(state.model)] = 1.0
        return J

    def error(self, state: RobotState) -> np.ndarray:
        return np.array(self.target) - state.q[self._index(state.model)]

    def with_initial_targets(self, state: RobotState) -> Self:
        angle = float(state.q[self._index(state.model)])
        return replace(self, target=self.target or (angle,))

    def _index(self, model: RobotModel) -> int:
        names = model.joint_names
        name = self.joint or names[0]
        if name not in names:
            raise UnknownNameError('joint', name, names)
        return names.index(name)


@dataclass(frozen=True)
class Configuration(Task):
    """All joints: n rows [rad/s]. Nothing is left for a law, a preference or a lower task.

    Below another task it keeps the joints as near to its target as that one lets them, so that a
    closed path of the tip ends with the joints with which it began.
    """

    size: ClassVar[int] = 0  # that of the arm
    target: tuple[float, ...] = param((), 'desired angles [rad]; none: those of the start')

    def rows(self, model: RobotModel) -> int:
        return model.n

    def jacobian(self, state: RobotState) -> np.ndarray:
        n = len(state.q)
        if len(self.target) != n:
            check_target('target of configuration', self.target, n)
        return np.eye(n)

    def error(self, state: RobotState) -> np.ndarray:
        return np.array(self.target) - state.q

    def with_initial_targets(self, state: RobotState) -> Self:
        return replace(self, target=self.target or tuple(state.q.tolist()))
