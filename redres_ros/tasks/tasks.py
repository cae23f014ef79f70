"""The tasks: position and orientation of a frame, most often the tip; the elbow; joints."""

from dataclasses import dataclass
from functools import cached_property, lru_cache
from typing import ClassVar

import numpy as np

from redres_ros.errors import ArrayError, UnknownNameError
from redres_ros.kernels.tick import rotation_error
from redres_ros.parameter import param
from redres_ros.robot_model import RobotModel, RobotState
from redres_ros.rotation import from_quaternion, rotation_matrix, to_quaternion
from redres_ros.tasks.task import FrameTask, Task, check_length


@dataclass(frozen=True)
class Position(FrameTask):
    """Position of a frame's origin: 3 rows [m/s]."""

    size: ClassVar[int] = 3
    target: tuple[float, ...] = param(
        (), 'desired position in the base frame [m]; none: that of the start'
    )

    def jacobian(self, state: RobotState) -> np.ndarray:
        return state.jacobian(self.frame)[:3]

    def derivatives(self, state: RobotState) -> np.ndarray:
        return state.jacobian_derivatives(self.frame)[:, :3]

    def value(self, state: RobotState) -> np.ndarray:
        return state.pose(self.frame)[0]


@dataclass(frozen=True)
class Orientation(FrameTask):
    """Orientation of a frame: 3 rows [rad/s]; the error is the rotation vector to the target."""

    size: ClassVar[int] = 3
    target_size: ClassVar[int] = 4
    target: tuple[float, ...] = param(
        (), 'desired quaternion x, y, z, w [1]; none: that of the start'
    )

    def __post_init__(self) -> None:
        super().__post_init__()
        _check_direction('target of orientation', self.target)

    def jacobian(self, state: RobotState) -> np.ndarray:
        return state.jacobian(self.frame)[3:]

    def derivatives(self, state: RobotState) -> np.ndarray:
        return state.jacobian_derivatives(self.frame)[:, 3:]

    def value(self, state: RobotState) -> np.ndarray:
        return to_quaternion(state.rotation(self.frame))

    def error(self, state: RobotState) -> np.ndarray:
        return rotation_error(state.rotation(self.frame), self._desired)

    @cached_property
    def _desired(self) -> np.ndarray:
        """The target as a matrix, (3, 3)."""
        return from_quaternion(np.array(self.target))


@dataclass(frozen=True)
class Pose(FrameTask):
    """Position and orientation of a frame: 3 rows [m/s], then 3 rows [rad/s]."""

    size: ClassVar[int] = 6
    target_size: ClassVar[int] = 7
    components: ClassVar[tuple[int, ...]] = (3, 3)
    target: tuple[float, ...] = param(
        (), 'desired position [m] and quaternion x, y, z, w [1]; none: those of the start'
    )

    def __post_init__(self) -> None:
        super().__post_init__()
        _check_direction('target of pose', self.target[3:])

    def jacobian(self, state: RobotState) -> np.ndarray:
        return state.jacobian(self.frame)

    def derivatives(self, state: RobotState) -> np.ndarray:
        return state.jacobian_derivatives(self.frame)

    def value(self, state: RobotState) -> np.ndarray:
        x, R = state.pose(self.frame)
        return np.concatenate((x, to_quaternion(R)))

    def error(self, state: RobotState) -> np.ndarray:
        x, R = state.pose(self.frame)
        turn = rotation_error(R, self._desired)
        return np.concatenate((np.array(self.target[:3]) - x, turn))

    @cached_property
    def _desired(self) -> np.ndarray:
        """The target's orientation as a matrix, (3, 3)."""
        return from_quaternion(np.array(self.target[3:]))

    def row_scale(self, model: RobotModel) -> np.ndarray:
        """1 / reach for the linear rows: a turn of the stretched arm then counts alike in both."""
        return _pose_scale(model.reach)


@dataclass(frozen=True)
class Axis(FrameTask):
    """Direction of an axis of a frame, free to turn about it: 2 rows [rad/s].

    The rows are the angular velocities about two directions that stand on the axis.
    """

    size: ClassVar[int] = 2
    target_size: ClassVar[int] = 3
    axis: tuple[float, ...] = param((0.0, 0.0, 1.0), 'axis in the frame [1]')
    target: tuple[float, ...] = param(
        (0.0, 0.0, -1.0), 'desired direction in the base frame [1]; none: that of the start'
    )

    def __post_init__(self) -> None:
        super().__post_init__()
        check_length('axis', self.axis, 3)
        _check_direction('axis', self.axis or (0.0,))
        _check_direction('target of axis', self.target)

    def jacobian(self, state: RobotState) -> np.ndarray:
        across = state.rotation(self.frame).dot(_across(self.axis))  # (3, 2) in the base frame
        return across.T.dot(state.jacobian(self.frame)[3:])

    def value(self, state: RobotState) -> np.ndarray:
        return state.rotation(self.frame).dot(_unit(self.axis))

    def error(self, state: RobotState) -> np.ndarray:
        now = self.value(state)
        desired = _unit(self.target)
        turn = np.cross(now, desired)  # sin(angle) times the axis to turn about
        sine = float(np.linalg.norm(turn))
        angle = np.arctan2(sine, now.dot(desired))
        across = state.rotation(self.frame).dot(_across(self.axis))
        if sine > 0.0:
            turn = turn * (angle / sine)
        elif angle > 0.0:
            turn = angle * across[:, 0]  # the opposite direction: any way round
        return across.T.dot(turn)


@dataclass(frozen=True)
class Elbow(Task):
    """Where the arm's elbow is: 3 rows [m/s], of which those that it cannot follow are left."""

    size: ClassVar[int] = 3
    target: tuple[float, ...] = param(
        (), 'desired position of the elbow in the base frame [m]; none: that of the start'
    )

    def jacobian(self, state: RobotState) -> np.ndarray:
        return state.jacobian(state.model.elbow_frame)[:3]

    def value(self, state: RobotState) -> np.ndarray:
        return state.pose(state.model.elbow_frame)[0]


@dataclass(frozen=True)
class Joint(Task):
    """The angle of one joint: 1 row [rad/s]."""

    size: ClassVar[int] = 1
    joint: str = param('', 'name of the joint; empty: the first one')
    target: tuple[float, ...] = param((), 'desired angle [rad]; none: that of the start')

    def jacobian(self, state: RobotState) -> np.ndarray:
        J = np.zeros((1, len(state.q)))
        J[0, self._index(state.model)] = 1.0
        return J

    def value(self, state: RobotState) -> np.ndarray:
        return state.q[[self._index(state.model)]]

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
        check_length('target of configuration', self.target, n)
        return np.eye(n)

    def value(self, state: RobotState) -> np.ndarray:
        return state.q


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
    z = np.array((0.0, 0.0, 1.0))
    a = _unit(axis)
    turn = np.cross(z, a)
    sine = float(np.linalg.norm(turn))
    angle = float(np.arctan2(sine, a[2]))
    if sine == 0.0:
        return rotation_matrix(np.array((angle, 0.0, 0.0)))[:, :2]
    return rotation_matrix(turn * (angle / sine))[:, :2]
