"""Kinematics and dynamics of one arm at one state. The only file that imports pinocchio."""

import math
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pinocchio as pin

from redres_ros.errors import ArrayError, FileError, UnknownNameError
from redres_ros.robots import Arm, arm_from_urdf, find_arm

TASK_SPACES = {'position': 3, 'pose': 6}  # rows of the task


class RobotState(
    NamedTuple
):  # a third of a frozen dataclass's time to make, which is 2 us in every tick
    """Everything a law may ask, at one (q, dq_prev); what most laws do without is evaluated when it
    is asked for.

    q, dq_prev: (n,) [rad], [rad/s], the previous velocity being all that is known at a tick
    (footnote 4); J: (m, n) task Jacobian, linear rows first, in the base frame (the URDF's root
    link); model: the arm.
    """

    q: np.ndarray
    dq_prev: np.ndarray
    J: np.ndarray
    model: 'RobotModel'

    @property
    def x(self) -> np.ndarray:
        """Tip position in the base frame, (3,) [m]."""
        return self.model._pose(self.q)[0]

    @property
    def R(self) -> np.ndarray:
        """Tip orientation in the base frame, (3, 3)."""
        return self.model._pose(self.q)[1]

    @property
    def M(self) -> np.ndarray:
        """Inertia, (n, n) [kg m^2]."""
        return self.model._inertia(self.q)

    @property
    def n(self) -> np.ndarray:
        """Coriolis, centrifugal and gravity torque n(q, dq_prev), (n,) [Nm]."""
        return self.model._bias_torque(self.q, self.dq_prev)

    @property
    def free_acceleration(self) -> np.ndarray:
        """-M^-1 n, (n,) [rad/s^2]: how the arm would move without any torque, Eq. (6)."""
        return self.model._acceleration(self.q, self.dq_prev, self.model._no_torque)


class RobotModel:
    """An arm as Pinocchio sees it.

    arm: geometry and dynamics; task_space: 'position' (m = 3) or 'pose' (m = 6, angular velocity
    below the linear one). Raises FileError for a URDF that cannot be used, UnknownNameError for a
    frame or task space that does not exist.
    """

    def __init__(self, arm: Arm, task_space: str = 'position') -> None:
        if task_space not in TASK_SPACES:
            raise UnknownNameError('task space', task_space, TASK_SPACES)
        self.arm = arm
        self.task_space = task_space
        self.m = TASK_SPACES[task_space]
        try:
            self._model = pin.buildModelFromXML(arm.description())
        except ValueError as error:
            raise FileError(f'{arm.source} is no URDF that can be used: {error}') from None
        if arm.armature:
            self._model.armature[:] = arm.armature
        self._data = self._model.createData()
        self._tip = self._frame(arm.tip_frame)
        self.base_frame = self._model.frames[1].name  # the root link; x and J are expressed in it
        self.n = self._model.nv
        self._no_torque = np.zeros(self.n)
        self.joint_names = tuple(self._model.names[1:])
        self.q_min = self._model.lowerPositionLimit.copy()  # (n,) [rad]
        self.q_max = self._model.upperPositionLimit.copy()  # (n,) [rad]
        self.dq_max = self._model.velocityLimit.copy()  # (n,) [rad/s]
        self.tau_max = self._model.effortLimit.copy()  # (n,) [Nm]

    @classmethod
    def named(
        cls,
        name: str,
        task_space: str = 'position',
        *,
        dynamics: str | None = None,
        base_offset: float | None = None,
        tool_offset: float | None = None,
    ) -> 'RobotModel':
        """The arm of that name in the table ARMS, with its own dynamics and offsets [m] unless
        given here.
        """
        return cls(
            find_arm(name, dynamics=dynamics, base_offset=base_offset, tool_offset=tool_offset),
            task_space,
        )

    @classmethod
    def from_urdf(
        cls,
        path: str | Path,
        tip_frame: str,
        task_space: str = 'position',
        *,
        elbow_frame: str = '',
    ) -> 'RobotModel':
        """Any serial arm from a URDF or xacro file.

        Args:
            path: The file.
            tip_frame: The link that carries out the task.
            task_space: 'position' or 'pose'.
            elbow_frame: The link whose origin counts as the elbow; empty: chosen.
        """
        return cls(arm_from_urdf(Path(path), tip_frame, elbow_frame), task_space)

    def state(self, q: np.ndarray, dq_prev: np.ndarray) -> RobotState:
        """The state at (q, dq_prev); its arrays are never overwritten. Raises ArrayError for bad
        input.
        """
        return self.unchecked_state(
            finite_vector(q, self.n, 'q'), finite_vector(dq_prev, self.n, 'dq_prev')
        )

    def unchecked_state(self, q: np.ndarray, dq_prev: np.ndarray) -> RobotState:
        """The same for finite vectors (n,) that nobody will change: a vector's check and copy take
        4 % of a tick.
        """
        J = pin.computeFrameJacobian(
            self._model, self._data, q, self._tip, pin.LOCAL_WORLD_ALIGNED
        )  # (6, n)
        return RobotState(q, dq_prev, J[: self.m], self)

    def acceleration(self, q: np.ndarray, dq: np.ndarray, tau: np.ndarray) -> np.ndarray:
        """ddq = M^-1 (tau - n), (n,) [rad/s^2], Eq. (6), by the articulated-body algorithm, without
        M or n.
        """
        q = finite_vector(q, self.n, 'q')
        dq = finite_vector(dq, self.n, 'dq')
        tau = finite_vector(tau, self.n, 'tau')
        return self._acceleration(q, dq, tau)

    def velocity_product(self, q: np.ndarray, dq: np.ndarray) -> np.ndarray:
        """dJ dq, (m,): the task acceleration at (q, dq) with ddq = 0, Eq. (4)."""
        q = finite_vector(q, self.n, 'q')
        dq = finite_vector(dq, self.n, 'dq')
        pin.forwardKinematics(self._model, self._data, q, dq, np.zeros(self.n))
        ddx = pin.getFrameClassicalAcceleration(
            self._model, self._data, self._tip, pin.LOCAL_WORLD_ALIGNED
        )
        return ddx.vector[: self.m].copy()

    def tip(self, q: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Tip position f(q), (3,) [m], and orientation, (3, 3), in the base frame."""
        return self._pose(finite_vector(q, self.n, 'q'))

    def position(self, q: np.ndarray, frame: str) -> np.ndarray:
        """Position of a frame's origin in the base frame, (3,) [m]."""
        pin.framesForwardKinematics(self._model, self._data, finite_vector(q, self.n, 'q'))
        return self._data.oMf[self._frame(frame)].translation.copy()

    def _pose(self, q: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        pin.forwardKinematics(self._model, self._data, q)
        H = pin.updateFramePlacement(
            self._model, self._data, self._tip
        ).homogeneous  # (4, 4), a copy
        return H[:3, 3], H[:3, :3]

    def _inertia(self, q: np.ndarray) -> np.ndarray:
        return pin.crba(self._model, self._data, q)  # a copy

    def _bias_torque(self, q: np.ndarray, dq: np.ndarray) -> np.ndarray:
        return pin.nonLinearEffects(self._model, self._data, q, dq)  # a copy

    def _acceleration(self, q: np.ndarray, dq: np.ndarray, tau: np.ndarray) -> np.ndarray:
        return pin.aba(self._model, self._data, q, dq, tau)  # a copy

    def _frame(self, name: str) -> int:
        if not self._model.existFrame(name):
            raise UnknownNameError('frame', name, [frame.name for frame in self._model.frames])
        return self._model.getFrameId(name)


def quaternion(R: np.ndarray) -> np.ndarray:
    """The rotation R (3, 3) as a unit quaternion (x, y, z, w), (4,)."""
    return pin.Quaternion(R).coeffs()


def finite_vector(values: np.ndarray, size: int, name: str) -> np.ndarray:
    """A copy of the values as (size,) float64. Raises ArrayError for anything else, and for NaN or
    infinity.
    """
    try:
        vector = np.array(values, np.float64)
    except (TypeError, ValueError):
        raise ArrayError(f'{name} is {values!r}; expected {size} numbers') from None
    if vector.shape != (size,):
        raise ArrayError(f'{name} has shape {vector.shape}; expected ({size},)')
    if (
        not math.isfinite(sum(vector.tolist())) and not np.isfinite(vector).all()
    ):  # the second alone takes longer
        raise ArrayError(f'{name} is {vector.tolist()}; every value must be finite')
    return vector
