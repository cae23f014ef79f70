"""The tasks, J dq = dx: position and orientation of a frame, most often the tip; the elbow; joints.

The first task of a controller gets its dx from outside. The others hold their targets, dx = k e.
"""

from abc import ABC, abstractmethod
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache
from typing import ClassVar, Self

import numpy as np

from redres_ros.errors import ArrayError, UnknownNameError
from redres_ros.geometry import from_quaternion, to_quaternion
from redres_ros.kernels.tick import rotation_error
from redres_ros.parameter import Checked, Table, param
from redres_ros.resolution import Level, scaled
from redres_ros.robot_model import ELBOW, RobotModel, RobotState
from redres_ros.types import Jacobian, JacobianDerivatives, Rotation, TaskVelocity, check_finite


@dataclass(frozen=True)
class Task(Checked, ABC):
    """One aim of the arm.

    A target that is left open, (), becomes the value at the start of the motion. A subclass is a
    frozen dataclass whose fields are declared with `param`, its target among them.
    """

    size: ClassVar[int]  # m, the number of rows; 0: as many as the arm has joints
    target_size: ClassVar[int] = 0  # how many numbers the target has; 0: as many as rows
    components: ClassVar[tuple[int, ...]] = ()  # rows of translation, of rotation; empty: one only
    qualifier: ClassVar[str] = ''  # the field that is given after an @, as in joint@A3
    gain: float = param(10.0, 'k in dx = k e, of the error to the target [1/s]', 0.0, 1e3)
    target: tuple[float, ...] = ()

    def __post_init__(self) -> None:
        super().__post_init__()
        name = f'target of {type(self).__name__.lower()}'
        _check_length(name, self.target, self.target_size or self.size)

    def rows(self, model: RobotModel) -> int:
        """m, the number of rows for an arm."""
        return self.size or model.n

    @abstractmethod
    def jacobian(self, state: RobotState) -> Jacobian: ...

    @abstractmethod
    def value(self, state: RobotState) -> np.ndarray:
        """Where the task is at this state, in the form of a target, (target_size,)."""

    def error(self, state: RobotState) -> np.ndarray:
        """The task error e, (m,), towards the target, which is set."""
        return np.array(self.target) - self.value(state)

    def with_initial_targets(self, state: RobotState) -> Self:
        """A copy with an unset target taken from the current state."""
        return replace(self, target=self.target or tuple(self.value(state).tolist()))

    def velocity(self, state: RobotState) -> TaskVelocity:
        """dx = k e."""
        return self.gain * self.error(state)

    def level(self, state: RobotState) -> Level:
        """J and dx with comparable rows."""
        return scaled(self.jacobian(state), self.velocity(state), self.row_scale(state.model))

    def derivatives(self, state: RobotState) -> JacobianDerivatives | None:
        """By which the arm finds the escape direction from a singularity.

        None for a task that does not know them; it is stuck where J alone shows none.
        """
        return None

    def row_scale(self, model: RobotModel) -> np.ndarray | None:
        """Factors (m,) that make rows of different units comparable; None if all are alike."""
        return None


@dataclass(frozen=True)
class _FrameTask(Task):
    """Position, orientation or both of a frame, given as in orientation@link_4; empty: the tip."""

    qualifier: ClassVar[str] = 'frame'
    part: ClassVar[slice]  # of the rows of the frame's Jacobian
    frame: str = ''

    def jacobian(self, state: RobotState) -> Jacobian:
        return state.jacobian(self.frame)[self.part]

    def derivatives(self, state: RobotState) -> JacobianDerivatives:
        return state.jacobian_derivatives(self.frame)[:, self.part]


@dataclass(frozen=True)
class Position(_FrameTask):
    """Position of a frame's origin: 3 rows [m/s]."""

    size: ClassVar[int] = 3
    part: ClassVar[slice] = slice(0, 3)
    target: tuple[float, ...] = param(
        (), 'desired position in the base frame [m]; none: that of the start'
    )

    def value(self, state: RobotState) -> np.ndarray:
        return state.pose(self.frame)[0]


@dataclass(frozen=True)
class Elbow(Position):
    """Where the arm's elbow is: 3 rows [m/s], of which those that it cannot follow are left."""

    qualifier: ClassVar[str] = ''
    frame: str = ELBOW
    target: tuple[float, ...] = param(
        (), 'desired position of the elbow in the base frame [m]; none: that of the start'
    )


class _TurningTask(_FrameTask):
    """One whose target ends with a quaternion."""

    def __post_init__(self) -> None:
        super().__post_init__()
        _check_direction(f'target of {type(self).__name__.lower()}', self.target[-4:])

    @cached_property
    def _desired(self) -> Rotation:
        return from_quaternion(np.array(self.target[-4:]))


@dataclass(frozen=True)
class Orientation(_TurningTask):
    """Orientation of a frame: 3 rows [rad/s]; the error is the rotation vector to the target."""

    size: ClassVar[int] = 3
    part: ClassVar[slice] = slice(3, 6)
    target_size: ClassVar[int] = 4
    target: tuple[float, ...] = param(
        (), 'desired quaternion x, y, z, w [1]; none: that of the start'
    )

    def value(self, state: RobotState) -> np.ndarray:
        return to_quaternion(state.pose(self.frame)[1])

    def error(self, state: RobotState) -> np.ndarray:
        return rotation_error(state.pose(self.frame)[1], self._desired)


@dataclass(frozen=True)
class Pose(_TurningTask):
    """Position and orientation of a frame: 3 rows [m/s], then 3 rows [rad/s]."""

    size: ClassVar[int] = 6
    part: ClassVar[slice] = slice(0, 6)
    target_size: ClassVar[int] = 7
    components: ClassVar[tuple[int, ...]] = (3, 3)
    target: tuple[float, ...] = param(
        (), 'desired position [m] and quaternion x, y, z, w [1]; none: those of the start'
    )

    def value(self, state: RobotState) -> np.ndarray:
        x, R = state.pose(self.frame)
        return np.concatenate((x, to_quaternion(R)))

    def error(self, state: RobotState) -> np.ndarray:
        x, R = state.pose(self.frame)
        return np.concatenate((np.array(self.target[:3]) - x, rotation_error(R, self._desired)))

    def row_scale(self, model: RobotModel) -> np.ndarray:
        """1 / reach for the linear rows: a turn of the stretched arm then counts alike in both."""
        return _pose_scale(model.reach)


@dataclass(frozen=True)
class Axis(Task):
    """Direction of an axis of a frame, free to turn about it: 2 rows [rad/s].

    The rows are the angular velocities about two directions that stand on the axis.
    """

    size: ClassVar[int] = 2
    target_size: ClassVar[int] = 3
    qualifier: ClassVar[str] = 'frame'
    frame: str = ''
    axis: tuple[float, ...] = param((0.0, 0.0, 1.0), 'axis in the frame [1]')
    target: tuple[float, ...] = param(
        (0.0, 0.0, -1.0), 'desired direction in the base frame [1]; none: that of the start'
    )

    def __post_init__(self) -> None:
        super().__post_init__()
        _check_length('axis', self.axis, 3)
        _check_direction('axis', self.axis or (0.0,))
        _check_direction('target of axis', self.target)

    def jacobian(self, state: RobotState) -> Jacobian:
        across = state.pose(self.frame)[1].dot(_across(self.axis))  # (3, 2) in the base frame
        return across.T.dot(state.jacobian(self.frame)[3:])

    def value(self, state: RobotState) -> np.ndarray:
        return state.pose(self.frame)[1].dot(_unit(self.axis))

    def error(self, state: RobotState) -> np.ndarray:
        now = self.value(state)
        desired = _unit(self.target)
        turn = np.cross(now, desired)  # sin(angle) times the axis to turn about
        sine = float(np.linalg.norm(turn))
        angle = np.arctan2(sine, now.dot(desired))
        across = state.pose(self.frame)[1].dot(_across(self.axis))
        if sine > 0.0:
            turn = turn * (angle / sine)
        elif angle > 0.0:
            turn = angle * across[:, 0]  # the opposite direction: any turn leads there
        return across.T.dot(turn)


@dataclass(frozen=True)
class Joint(Task):
    """The angle of one joint, given as in joint@A3; empty: the first one. 1 row [rad/s]."""

    size: ClassVar[int] = 1
    qualifier: ClassVar[str] = 'joint'
    joint: str = ''
    target: tuple[float, ...] = param((), 'desired angle [rad]; none: that of the start')

    def jacobian(self, state: RobotState) -> Jacobian:
        return np.eye(len(state.q))[self._indices(state.model)]

    def value(self, state: RobotState) -> np.ndarray:
        return state.q[self._indices(state.model)]

    def _indices(self, model: RobotModel) -> list[int]:
        names = model.joint_names
        name = self.joint or names[0]
        if name not in names:
            raise UnknownNameError('joint', name, names)
        return [names.index(name)]


@dataclass(frozen=True)
class Configuration(Task):
    """All joints: n rows [rad/s]. Nothing is left for a law, a preference or a lower task.

    Below another task it keeps the joints as near to its target as that one lets them, so that a
    closed path of the tip ends with the joints with which it began.
    """

    size: ClassVar[int] = 0
    target: tuple[float, ...] = param((), 'desired angles [rad]; none: those of the start')

    def jacobian(self, state: RobotState) -> Jacobian:
        _check_length('target of configuration', self.target, len(state.q))
        return np.eye(len(state.q))

    def value(self, state: RobotState) -> np.ndarray:
        return state.q


# A new task is one small class and one line in this table.
TASKS: Table[Task] = Table(
    'task',
    Task,
    position=Position,
    orientation=Orientation,
    pose=Pose,
    axis=Axis,
    elbow=Elbow,
    joint=Joint,
    configuration=Configuration,
)
make_task = TASKS.make


def _check_length(name: str, values: tuple[float, ...], length: int) -> None:
    """Refuse a vector of another length, 0 for any, or one that is not finite; () is open."""
    if values and length and len(values) != length:
        raise ArrayError(f'{name} holds {len(values)} numbers; expected {length}, or none')
    check_finite(np.array(values), name)


def _check_direction(name: str, values: tuple[float, ...]) -> None:
    if values and not any(values):
        raise ArrayError(f'{name} is {values}; expected values that are not all zero')


@lru_cache(maxsize=64)
def _pose_scale(reach: float) -> np.ndarray:
    scale = np.repeat((1.0 / reach, 1.0), 3)
    scale.flags.writeable = False  # every tick shares it
    return scale


@lru_cache(maxsize=64)  # a target is looked up in every tick
def _unit(direction: tuple[float, ...]) -> np.ndarray:
    vector = np.array(direction)
    return vector / np.linalg.norm(vector)


@lru_cache(maxsize=64)
def _across(axis: tuple[float, ...]) -> np.ndarray:
    """Two orthonormal columns (3, 2) that stand on an axis of a frame, in that frame."""
    return np.linalg.svd(np.array((axis,)))[2][1:].T
