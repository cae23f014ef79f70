"""Kinematics and dynamics of one arm at one state, by Pinocchio."""

from collections.abc import Callable, Mapping, Sequence
from copy import copy
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pinocchio as pin

from redres_ros.errors import FileError, UnknownNameError
from redres_ros.preview import Ahead
from redres_ros.robots import Arm, arm_from_urdf, find_arm
from redres_ros.robots.joint_limits import with_accelerations
from redres_ros.robots.kinematics import Bodies
from redres_ros.types import (
    Cycles,
    InertiaMatrix,
    Jacobian,
    JacobianDerivatives,
    JointAccelerations,
    JointPositions,
    JointTorques,
    JointVelocities,
    Meters,
    Position,
    Rotation,
    TaskVelocity,
    finite_vector,
)

ELBOW = '(elbow)'  # in place of a frame: the arm's elbow
_ALIGNED = pin.LOCAL_WORLD_ALIGNED  # at the frame's origin, along the axes of the base

_INNER_MARGIN = 0.05  # [rad]

# w.dot(_CROSS), as (3, 3), is the matrix K with K v = w x v
_CROSS = np.array(
    (
        (0.0, 0.0, 0.0, 0.0, 0.0, -1.0, 0.0, 1.0, 0.0),
        (0.0, 0.0, 1.0, 0.0, 0.0, 0.0, -1.0, 0.0, 0.0),
        (0.0, -1.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 0.0),
    )
)


class Correction(NamedTuple):
    """What holds the components of a task velocity that nobody asks to move."""

    velocity: TaskVelocity  # of their rows, which is a part of dx
    is_held: np.ndarray  # (m,) of bool
    away: TaskVelocity  # with which each row may leave what is held


@dataclass(frozen=True)
class TickContext:
    """What a tick needs besides the state of the arm."""

    measurements: Mapping[str, np.ndarray] = field(default_factory=dict)  # fresh ones, by name
    gap: Cycles = 1  # between two commands, in which every joint must be able to stop
    longest_gap: Cycles = 1  # the same of the next command alone, which may be the last for long
    correction: Correction | None = None
    lost: Cycles = 0  # commands that the robot may lose and bridge at constant acceleration


_USUAL = TickContext()


class RobotState:
    """Kinematics and dynamics at one (q, dq_prev), for laws, tasks and preferences.

    dq_prev is the last command, which is all that is known of the velocity at a tick (footnote 4),
    ddq_prev its acceleration, `ahead` the path to come, if it is known. Each quantity is evaluated
    once, when it is asked for first.
    """

    # Until a quantity is asked for. A property with such a default takes half of what a
    # functools.cached_property takes.
    _J: Jacobian | None = None
    _tip: pin.SE3 | None = None
    _M: np.ndarray | None = None
    _n: np.ndarray | None = None

    def __init__(
        self,
        model: 'RobotModel',
        q: JointPositions,
        dq_prev: JointVelocities,
        ddq_prev: JointAccelerations | None = None,
        tick: TickContext = _USUAL,
        ahead: Ahead | None = None,
    ) -> None:
        self.model = model
        self.tick = tick
        self.ahead = ahead
        self.q = q
        self.dq_prev = dq_prev
        self.ddq_prev = np.zeros(len(q)) if ddq_prev is None else ddq_prev

    def with_velocity(self, dq_prev: JointVelocities, plan: Any = None) -> 'RobotState':
        """The same position at another last velocity; keeps what q alone decides."""
        state = copy(self)
        state.dq_prev = dq_prev
        if self.ahead is not None:
            state.ahead = self.ahead._replace(plan=plan)
        state._n = None
        return state

    @property
    def measurements(self) -> Mapping[str, np.ndarray]:
        """Of this tick by name: those that are fresh."""
        return self.tick.measurements

    @property
    def J(self) -> Jacobian:
        """Jacobian of the tip in the base frame, (6, n): the linear rows, then the angular ones."""
        return self.jacobian('')

    @property
    def x(self) -> Position:
        """Of the tip in the base frame."""
        return self._placement.translation.copy()

    @property
    def R(self) -> Rotation:
        """Of the tip in the base frame."""
        return self._placement.rotation.copy()

    @property
    def _placement(self) -> pin.SE3:
        if self._tip is None:
            self._tip = self.model._placement(self.q, self.model._tip)
        return self._tip

    @property
    def M(self) -> InertiaMatrix:
        if self._M is None:
            self._M = self.model._inertia(self.q)
        return self._M

    @property
    def n(self) -> JointTorques:
        """Coriolis, centrifugal and gravity torque n(q, dq_prev)."""
        if self._n is None:
            self._n = self.model._bias_torque(self.q, self.dq_prev)
        return self._n

    @property
    def gravity(self) -> JointTorques:
        """Gravity torque n(q, 0)."""
        return self.model._bias_torque(self.q, np.zeros(len(self.q)))

    def pose(self, frame: str) -> tuple[Position, Rotation]:
        """Of a frame in the base frame; '' is the tip."""
        return self.model.pose(self.q, frame) if frame else (self.x, self.R)

    def jacobian(self, frame: str) -> Jacobian:
        """Of a frame, (6, n), rows as in `J`; '' is the tip."""
        if frame:
            return self.model.jacobian(self.q, frame)
        if self._J is None:
            self._J = self.model._jacobian(self.q, self.model._tip)
        return self._J

    def jacobian_derivatives(self, frame: str) -> JacobianDerivatives:
        """Of a frame's Jacobian, (n, 6, n), by its rows alone; '' is the tip.

        With v_j and w_j the linear and angular columns: joint i turns or shifts all that comes
        after it, so dw_j/dq_i = w_i x w_j and dv_j/dq_i = w_i x v_j for i <= j, else w_j x v_i.
        """
        J = self.jacobian(frame)
        n = J.shape[1]
        turns = J[3:].T.dot(_CROSS).reshape(n, 3, 3)  # w_i x as a matrix
        dv = turns @ J[:3]  # (i, 3, j): w_i x v_j
        dw = turns @ J[3:]
        inner = np.tri(n, dtype=bool).T[:, None, :]  # (i, 1, j): i <= j
        dv = np.where(inner, dv, dv.transpose(2, 1, 0))
        return np.concatenate((dv, np.where(inner, dw, 0.0)), axis=1)


class RobotModel:
    """An arm's model in Pinocchio. Raises FileError for a URDF that cannot be used, and
    UnknownNameError for a frame that does not exist.
    """

    def __init__(self, arm: Arm) -> None:
        self.arm = arm
        self.kinematics = arm.kinematics()
        self._model = self.kinematics.model
        if arm.armature:
            self._model.armature[:] = arm.armature
        self._data = self._model.createData()
        self._tip = self._frame(arm.tip_frame)
        self.base_frame = self._model.frames[1].name  # the root link; x and J are expressed in it
        self.links = tuple(frame.name for frame in self._model.frames if frame.type == pin.BODY)
        self.n = self._model.nv
        self.joint_names = tuple(self._model.names[1:])
        self.q_min: JointPositions = self._model.lowerPositionLimit.copy()
        self.q_max: JointPositions = self._model.upperPositionLimit.copy()
        self.dq_max: JointVelocities = self._model.velocityLimit.copy()
        self.tau_max: JointTorques = self._model.effortLimit.copy()
        for limit in (self.q_min, self.q_max, self.dq_max, self.tau_max):
            limit.setflags(write=False)  # all controllers of this arm share it
        offsets = reversed(self.kinematics.offsets)
        self.reach: Meters = float(sum(map(np.linalg.norm, offsets)))  # of the arm in one line

    def __reduce__(self) -> tuple[Callable[[Arm], 'RobotModel'], tuple[Arm]]:
        """Pickle and copy by the arm: Pinocchio's data are 50 times as large."""
        return type(self), (self.arm,)

    @cached_property
    def bodies(self) -> Bodies:
        """The capsules that must not collide, read from the URDF."""
        return Bodies.along(self.kinematics, self.arm.body_radius)

    @cached_property
    def inner_range(self) -> tuple[JointPositions, JointPositions]:
        """Positions somewhat within the ranges, where motions are planned."""
        margin = np.minimum(_INNER_MARGIN, 0.1 * (self.q_max - self.q_min))
        return self.q_min + margin, self.q_max - margin

    @property
    def elbow_frame(self) -> str:
        """The frame that is the arm's elbow. Raises FileError for an arm that names none."""
        if not self.arm.elbow_frame:
            raise FileError(f'{self.arm.source}: no elbow_frame is given, which the elbow needs')
        return self.arm.elbow_frame

    @classmethod
    def named(cls, name: str, **changes: object) -> 'RobotModel':
        """The arm of that name in ARMS, also with other values of its fields, such as dynamics
        ('identified' or 'cylinders') or tool_offset. Raises as find_arm().
        """
        return cls(find_arm(name, **changes))

    @classmethod
    def from_urdf(
        cls,
        path: str | Path,
        tip_frame: str,
        *,
        elbow_frame: str = '',
        acceleration_limit: Sequence[float] = (),
        effort_limit: Sequence[float] = (),
    ) -> 'RobotModel':
        """Any serial arm from a URDF file; the tip is the link that carries out the task.

        The elbow is a link, or that of the joint in the middle of the arm. Limits are those of each
        joint [rad/s^2], [Nm]; without them efforts are those of the URDF, accelerations an
        assumption, see `arm.remarks()`. Raises as arm_from_urdf().
        """
        efforts = tuple(map(float, effort_limit))
        arm = arm_from_urdf(Path(path), tip_frame, elbow_frame, efforts)
        return cls(with_accelerations(arm, tuple(map(float, acceleration_limit))))

    def state(self, q: JointPositions, dq_prev: JointVelocities) -> RobotState:
        """The state at (q, dq_prev); its arrays are never overwritten. Raises ArrayError."""
        q = finite_vector(q, self.n, 'q')
        return RobotState(self, q, finite_vector(dq_prev, self.n, 'dq_prev'))

    def torque(
        self, q: JointPositions, dq: JointVelocities, ddq: JointAccelerations
    ) -> JointTorques:
        """M(q) ddq + n(q, dq), Eq. (6), without M or n and without check."""
        return pin.rnea(self._model, self._data, q, dq, ddq)  # a copy

    def tip(self, q: JointPositions) -> tuple[Position, Rotation]:
        """The tip's pose in the base frame."""
        return self._pose(q, self._tip)

    def pose(self, q: JointPositions, frame: str) -> tuple[Position, Rotation]:
        """Of a link in the base frame."""
        return self._pose(q, self._frame(frame))

    def position(self, q: JointPositions, frame: str) -> Position:
        """Of a link's origin in the base frame."""
        return self.pose(q, frame)[0]

    def kinetic_energy(self, q: JointPositions, dq: JointVelocities) -> float:
        """1/2 dq' M dq [J], without M and without check."""
        return float(pin.computeKineticEnergy(self._model, self._data, q, dq))

    def jacobian(self, q: JointPositions, frame: str) -> Jacobian:
        """Of a link in the base frame, (6, n): the linear rows, then the angular ones."""
        return self._jacobian(finite_vector(q, self.n, 'q'), self._frame(frame))

    def _jacobian(self, q: JointPositions, frame: int) -> Jacobian:
        return pin.computeFrameJacobian(self._model, self._data, q, frame, _ALIGNED)  # a copy

    def _placement(self, q: JointPositions, frame: int) -> pin.SE3:
        pin.forwardKinematics(self._model, self._data, q)
        return pin.updateFramePlacement(self._model, self._data, frame)  # a copy

    def _pose(self, q: JointPositions, frame: int) -> tuple[Position, Rotation]:
        placement = self._placement(finite_vector(q, self.n, 'q'), frame)
        return placement.translation.copy(), placement.rotation.copy()

    def _inertia(self, q: JointPositions) -> InertiaMatrix:
        return pin.crba(self._model, self._data, q)  # a copy

    def _bias_torque(self, q: JointPositions, dq: JointVelocities) -> JointTorques:
        return pin.nonLinearEffects(self._model, self._data, q, dq)  # a copy

    def _frame(self, name: str) -> int:
        """The frame of a link; a joint may have the same name."""
        name = self.elbow_frame if name == ELBOW else name
        if not self._model.existFrame(name, pin.BODY):
            raise UnknownNameError('frame', name, self.links)
        return self._model.getFrameId(name, pin.BODY)
