"""Tasks of a frame, most often the tip: position and orientation."""

from dataclasses import dataclass, replace
from functools import cached_property, lru_cache
from typing import ClassVar, Self

import numpy as np

from redres_ros.errors import ArrayError
from redres_ros.kernels.rotation_error import part_of_turn, rotation_error
from redres_ros.parameter import param
from redres_ros.robot_model import RobotModel, RobotState
from redres_ros.rotation import from_quaternion, rotation_matrix, to_quaternion
from redres_ros.tasks.task import FrameTask, check_target


@dataclass(frozen=True)
class Position(FrameTask):
    """Position of a frame's origin: 3 rows [m/s]."""

    size: ClassVar[int] = 3
    target: tuple[float, ...] = param(
        (), 'desired position in the base frame [m]; none: that of the start'
    )

    def __post_init__(self) -> None:
        super().__post_init__()
        check_target('target of position', self.target, 3)

    def jacobian(self, state: RobotState) -> np.ndarray:
        return state.jacobian(self.frame)[:3]

    def derivatives(self, state: RobotState) -> np.ndarray:
        return state.jacobian_derivatives(self.frame)[:, :3]

    def error(self, state: RobotState) -> np.ndarray:
        return np.array(self.target) - state.pose(self.frame)[0]

    def with_initial_targets(self, state: RobotState) -> Self:
        x, _ = state.pose(self.frame)
        return replace(self, target=self.target or tuple(x.tolist()))


@dataclass(frozen=True)
class Orientation(FrameTask):
    """Orientation of a frame: 3 rows [rad/s]; the error is the rotation vector to the target."""

    size: ClassVar[int] = 3
    target: tuple[float, ...] = param(
        (), 'desired quaternion x, y, z, w [1]; none: that of the start'
    )

    def __post_init__(self) -> None:
        super().__post_init__()
        check_target('target of orientation', self.target, 4)
        _check_direction('target of orientation', self.target)

    def jacobian(self, state: RobotState) -> np.ndarray:
        return state.jacobian(self.frame)[3:]

    def derivatives(self, state: RobotState) -> np.ndarray:
        return state.jacobian_derivatives(self.frame)[:, 3:]

    def error(self, state: RobotState) -> np.ndarray:
        return rotation_error(state.rotation(self.frame), self._wanted)

    def velocity(self, state: RobotState) -> np.ndarray:
        """dx = k e, in half the time of numpy's product."""
        dx = np.empty(3)
        part_of_turn(self.gain, state.rotation(self.frame), self._wanted, dx)
        return dx

    @cached_property
    def _wanted(self) -> np.ndarray:
        """The target as a matrix, (3, 3)."""
        return from_quaternion(np.array(self.target))

    def with_initial_targets(self, state: RobotState) -> Self:
        _, R = state.pose(self.frame)
        return replace(self, target=self.target or tuple(to_quaternion(R).tolist()))


@dataclass(frozen=True)
class Pose(FrameTask):
    """Position and orientation of a frame: 3 rows [m/s], then 3 rows [rad/s]."""

    size: ClassVar[int] = 6
    components: ClassVar[tuple[int, ...]] = (3, 3)
    target: tuple[float, ...] = param(
        (), 'desired position [m] and quaternion x, y, z, w [1]; none: those of the start'
    )

    def __post_init__(self) -> None:
        super().__post_init__()
        check_target('target of pose', self.target, 7)
        _check_direction('target of pose', self.target[3:])

    def jacobian(self, state: RobotState) -> np.ndarray:
        return state.jacobian(self.frame)

    def derivatives(self, state: RobotState) -> np.ndarray:
        return state.jacobian_derivatives(self.frame)

    def error(self, state: RobotState) -> np.ndarray:
        x, R = state.pose(self.frame)
        turn = rotation_error(R, self._wanted)
        return np.concatenate((np.array(self.target[:3]) - x, turn))

    @cached_property
    def _wanted(self) -> np.ndarray:
        """The target's orientation as a matrix, (3, 3)."""
        return from_quaternion(np.array(self.target[3:]))

    def with_initial_targets(self, state: RobotState) -> Self:
        x, R = state.pose(self.frame)
        here = (*x.tolist(), *to_quaternion(R).tolist())
        return replace(self, target=self.target or here)

    def row_scale(self, model: RobotModel) -> np.ndarray:
        """1 / reach for the linear rows: a turn of the stretched arm then counts alike in both."""
        return _pose_scale(model.reach)


@dataclass(frozen=True)
class Axis(FrameTask):
    """Direction of an axis of a frame, free to turn about it: 2 rows [rad/s].

    The rows are the angular velocities about two directions that stand on the axis.
    """

    size: ClassVar[int] = 2
    axis: tuple[float, ...] = param((0.0, 0.0, 1.0), 'axis in the frame [1]')
    target: tuple[float, ...] = param(
        (0.0, 0.0, -1.0), 'desired direction in the base frame [1]; none: that of the start'
    )

    def __post_init__(self) -> None:
        super().__post_init__()
        check_target('axis', self.axis, 3)
        check_target('target of axis', self.target, 3)
        _check_direction('axis', self.axis or (0.0,))
        _check_direction('target of axis', self.target)

    def jacobian(self, state: RobotState) -> np.ndarray:
        across = state.pose(self.frame)[1].dot(_across(self.axis))  # (3, 2) in the base frame
        return across.T.dot(state.jacobian(self.frame)[3:])

    def error(self, state: RobotState) -> np.ndarray:
        _, R = state.pose(self.frame)
        now = R.dot(_unit(self.axis))
        wanted = _unit(self.target)
        turn = np.cross(now, wanted)  # sin(angle) times the axis to turn about
        sine = float(np.linalg.norm(turn))
        angle = np.arctan2(sine, now.dot(wanted))
        across = R.dot(_across(self.axis))
        if sine > 0.0:
            turn = turn * (angle / sine)
        elif angle > 0.0:
            turn = angle * across[:, 0]  # the opposite direction: any way round
        return across.T.dot(turn)

    def with_initial_targets(self, state: RobotState) -> Self:
        _, R = state.pose(self.frame)
        return replace(self, target=self.target or tuple(R.dot(_unit(self.axis)).tolist()))


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
