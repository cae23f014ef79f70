"""Kinematics and dynamics of one arm at one state, by Pinocchio."""

from collections.abc import Callable, Mapping, Sequence
from copy import copy
from functools import cached_property, partial
from pathlib import Path
from types import MappingProxyType
from typing import Any, NamedTuple

import numpy as np
import pinocchio as pin

from redres_ros.errors import FileError, RangeError, UnknownNameError
from redres_ros.robots import Arm, arm_from_urdf, find_arm
from redres_ros.robots.bodies import Bodies
from redres_ros.robots.kinematics import Kinematics
from redres_ros.types import Cycles, TaskVelocity
from redres_ros.vectors import finite_vector

_ALIGNED = pin.LOCAL_WORLD_ALIGNED  # at the frame's origin, along the axes of the base

# w.dot(_CROSS), as (3, 3), is the matrix K with K v = w x v
_CROSS = np.array(
    (
        (0.0, 0.0, 0.0, 0.0, 0.0, -1.0, 0.0, 1.0, 0.0),
        (0.0, 0.0, 1.0, 0.0, 0.0, 0.0, -1.0, 0.0, 0.0),
        (0.0, -1.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 0.0),
    )
)


class TickContext(NamedTuple):
    """What a tick needs besides the state of the arm.

    Attributes:
        measurements: By name, as preferences and limits ask for them.
        gap: Between two commands, in which every joint must be able to stop.
        longest_gap: The same of the next command alone, which may be the last one for long.
        correction: The part of dx that only holds what nobody asks to move.
    """

    measurements: Mapping[str, np.ndarray] = MappingProxyType({})
    gap: Cycles = 1
    longest_gap: Cycles = 1
    correction: TaskVelocity | None = None


_USUAL = TickContext()


class RobotState:
    """Kinematics and dynamics at one (q, dq_prev), for laws, tasks and preferences.

    Each quantity is evaluated once, when it is asked for first: most laws do without most of them.

    Args:
        model: Model of the arm.
        q: (n,) [rad].
        dq_prev: (n,) [rad/s], the last command, which is all that is known of the velocity at a
            tick (footnote 4).
        ddq_prev: (n,) [rad/s^2], the acceleration of the last command; None: zero.
        tick: What a tick needs besides.
    """

    # Until a quantity is asked for. A property with such a default takes half of what a
    # functools.cached_property takes.
    _J: np.ndarray | None = None
    _M: np.ndarray | None = None
    _n: np.ndarray | None = None
    _x: np.ndarray | None = None
    _R: np.ndarray | None = None

    def __init__(
        self,
        model: 'RobotModel',
        q: np.ndarray,
        dq_prev: np.ndarray,
        ddq_prev: np.ndarray | None = None,
        tick: TickContext = _USUAL,
    ) -> None:
        self.model = model
        self.tick = tick
        self.q = q
        self.dq_prev = dq_prev
        self.ddq_prev = np.zeros(len(q)) if ddq_prev is None else ddq_prev

    def with_velocity(self, dq_prev: np.ndarray) -> 'RobotState':
        """The same position at another last velocity (n,) [rad/s]; keeps what q alone decides."""
        state = copy(self)
        state.dq_prev = dq_prev
        state._n = None
        return state

    @property
    def measurements(self) -> Mapping[str, np.ndarray]:
        """Of this tick by name: those that are fresh."""
        return self.tick.measurements

    @property
    def J(self) -> np.ndarray:
        """Jacobian of the tip in the base frame, (6, n): the linear rows, then the angular ones."""
        if self._J is None:
            self._J = self.model._tip_jacobian(self.q)
        return self._J

    @property
    def x(self) -> np.ndarray:
        """Tip position in the base frame, (3,) [m]."""
        if self._x is None:
            self._x = self.model._tip_position(self.q)
        return self._x

    @property
    def R(self) -> np.ndarray:
        """Tip orientation in the base frame, (3, 3)."""
        if self._R is None:
            self._R = self.model._tip_orientation(self.q)
        return self._R

    @property
    def M(self) -> np.ndarray:
        """Inertia, (n, n) [kg m^2]."""
        if self._M is None:
            self._M = self.model._inertia(self.q)
        return self._M

    @property
    def n(self) -> np.ndarray:
        """Coriolis, centrifugal and gravity torque n(q, dq_prev), (n,) [Nm]."""
        if self._n is None:
            self._n = self.model._bias_torque(self.q, self.dq_prev)
        return self._n

    @property
    def gravity(self) -> np.ndarray:
        """Gravity torque n(q, 0), (n,) [Nm]."""
        return self.model._bias_torque(self.q, np.zeros(len(self.q)))

    def pose(self, frame: str) -> tuple[np.ndarray, np.ndarray]:
        """Position (3,) [m] and orientation (3, 3) of a frame; '' is the tip."""
        return self.model.pose(self.q, frame) if frame else (self.x, self.R)

    def rotation(self, frame: str) -> np.ndarray:
        """Orientation of a frame, (3, 3); '' is the tip."""
        return self.model.pose(self.q, frame)[1] if frame else self.R

    def jacobian(self, frame: str) -> np.ndarray:
        """Jacobian (6, n) of a frame, rows as in `J`; '' is the tip."""
        return self.model.jacobian(self.q, frame) if frame else self.J

    def jacobian_derivatives(self, frame: str) -> np.ndarray:
        """dJ/dq_i of a frame's Jacobian J (6, n), (n, 6, n); '' is the tip."""
        return jacobian_derivatives(self.jacobian(frame))


class RobotModel:
    """An arm's model in Pinocchio.

    Args:
        arm: Geometry and dynamics.
        weight: Whether torques carry the arm. False: the robot does that by itself, n is without
            gravity, and so are torque limits.

    Raises:
        FileError: A URDF that cannot be used.
        UnknownNameError: A frame that does not exist.
    """

    def __init__(self, arm: Arm, *, weight: bool = True) -> None:
        self.arm = arm
        self._weight = weight
        try:
            self._model = pin.buildModelFromXML(arm.description())
        except ValueError as error:
            raise FileError(f'{arm.source} is not a usable URDF: {error}') from None
        if arm.armature:
            self._model.armature[:] = arm.armature
        if not weight:
            self._model.gravity = pin.Motion.Zero()
        self._portable_arm = arm.with_text()  # now: later the file may have changed, or be gone
        self._data = self._model.createData()
        self._tip = self._frame(arm.tip_frame)
        self._tip_x = self._data.oMf[self._tip].translation  # in the data: changes with them
        self._tip_R = self._data.oMf[self._tip].rotation
        self._tip_J: Any = None  # (6, n), until somebody asks for it
        # The bytes of the q that these three belong to, or nothing. What computes M, n or a torque
        # leaves them.
        self._placed = b''
        self.base_frame = self._model.frames[1].name  # the root link; x and J are expressed in it
        self.n = self._model.nv
        self.joint_names = tuple(self._model.names[1:])
        self.q_min = self._model.lowerPositionLimit.copy()  # (n,) [rad]
        self.q_max = self._model.upperPositionLimit.copy()  # (n,) [rad]
        self.dq_max = self._model.velocityLimit.copy()  # (n,) [rad/s]
        self.tau_max = self._model.effortLimit.copy()  # (n,) [Nm]
        self.reach = self._reach()

    def __reduce__(self) -> tuple[Callable[[Arm], 'RobotModel'], tuple[Arm]]:
        """Pickle and copy by the arm: a copy of Pinocchio's data would no longer be what
        `_tip_x` and `_tip_R` look at.
        """
        return partial(type(self), weight=self._weight), (self._portable_arm,)

    @property
    def links(self) -> tuple[str, ...]:
        """Names of the links."""
        return tuple(frame.name for frame in self._model.frames if frame.type == pin.BODY)

    @cached_property
    def kinematics(self) -> Kinematics:
        """The moving joints, read from the URDF."""
        return self.arm.kinematics()

    @cached_property
    def bodies(self) -> Bodies:
        """The capsules that must not collide, read from the URDF."""
        return self.arm.bodies()

    @property
    def elbow_frame(self) -> str:
        """The frame that is the arm's elbow. Raises FileError for an arm that names none."""
        if not self.arm.elbow_frame:
            raise FileError(f'{self.arm.source}: no elbow_frame is given, which the elbow needs')
        return self.arm.elbow_frame

    @classmethod
    def named(
        cls,
        name: str,
        *,
        dynamics: str | None = None,
        base_offset: float | None = None,
        tool_offset: float | None = None,
    ) -> 'RobotModel':
        """The arm of that name.

        Args:
            name: Name of an arm in ARMS.
            dynamics: 'identified' or 'cylinders'; None for the arm's own.
            base_offset: Height of the arm above its root link [m]; None for the arm's own.
            tool_offset: Offset of the tip from the flange [m]; None for the arm's own.

        Raises:
            UnknownNameError: No arm, or no dynamics, has that name.
        """
        return cls(
            find_arm(name, dynamics=dynamics, base_offset=base_offset, tool_offset=tool_offset)
        )

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
        """Any serial arm from a URDF or xacro file.

        Args:
            path: The file.
            tip_frame: The link that carries out the task.
            elbow_frame: The link whose origin counts as the elbow; empty: that of the joint in the
                middle of the arm.
            acceleration_limit: Of each joint, (n,) [rad/s^2]; empty: an assumption, see
                `arm.remarks()`.
            effort_limit: Of each joint, (n,) [Nm]; empty: that of the URDF.
        """
        arm = arm_from_urdf(
            Path(path),
            tip_frame,
            elbow_frame,
            acceleration_limit=tuple(map(float, acceleration_limit)),
            effort_limit=tuple(map(float, effort_limit)),
        )
        return cls(arm)

    def state(self, q: np.ndarray, dq_prev: np.ndarray) -> RobotState:
        """The state at (q, dq_prev); its arrays are never overwritten.

        Args:
            q: (n,) [rad].
            dq_prev: (n,) [rad/s].

        Raises:
            ArrayError: Another length, or NaN or infinity.
        """
        return self.unchecked_state(
            finite_vector(q, self.n, 'q'), finite_vector(dq_prev, self.n, 'dq_prev')
        )

    def unchecked_state(self, q: np.ndarray, dq_prev: np.ndarray) -> RobotState:
        """As `state`, without check or copy.

        Args:
            q: Finite, (n,) [rad], and never modified by the caller.
            dq_prev: Finite, (n,) [rad/s], and never modified by the caller.
        """
        return RobotState(self, q, dq_prev)

    def acceleration(self, q: np.ndarray, dq: np.ndarray, tau: np.ndarray) -> np.ndarray:
        """ddq = M^-1 (tau - n), (n,) [rad/s^2], Eq. (6), by the articulated-body algorithm, without
        M or n.

        Args:
            q: (n,) [rad].
            dq: (n,) [rad/s].
            tau: Joint torques, (n,) [Nm].
        """
        q = finite_vector(q, self.n, 'q')
        dq = finite_vector(dq, self.n, 'dq')
        tau = finite_vector(tau, self.n, 'tau')
        self._placed = b''
        return pin.aba(self._model, self._data, q, dq, tau)  # a copy

    def torque(self, q: np.ndarray, dq: np.ndarray, ddq: np.ndarray) -> np.ndarray:
        """M(q) ddq + n(q, dq), (n,) [Nm], Eq. (6), without M or n and without check.

        Args:
            q: (n,) [rad].
            dq: (n,) [rad/s].
            ddq: (n,) [rad/s^2].
        """
        return pin.rnea(self._model, self._data, q, dq, ddq)  # a copy

    @cached_property
    def torque_bounds(self) -> tuple[np.ndarray, np.ndarray]:
        """G (n,) [Nm] and H (n,) [kg m^2] with |tau_i| <= G_i + H_i (A + 2 V^2) at every q.

        A is the sum of all |ddq_j|, V that of all |dq_j|. A link turns at V at most, and faster by
        A + V^2. A point at the distance L along the arm then accelerates by L (A + 2 V^2) at most,
        and no lever is longer than the arm between. G is infinite with linear joints.
        """
        model = self._model
        G = np.zeros(self.n)
        H = model.armature.copy()
        for link in range(1, model.njoints):
            body = model.inertias[link]
            levers = np.zeros(self.n)  # from each joint before it to its centre of mass, (n,) [m]
            length = np.linalg.norm(body.lever)
            joint = link
            while joint:
                i = model.joints[joint].idx_v
                levers[i] = length
                H[i] += np.linalg.norm(body.inertia, 2)
                length += np.linalg.norm(model.jointPlacements[joint].translation)
                joint = model.parents[joint]
            G += body.mass * levers * np.linalg.norm(model.gravity.linear)
            H += body.mass * levers * levers.max()
        if not all(joint.shortname().startswith('JointModelR') for joint in model.joints[1:]):
            G[:] = np.inf
        return G, H

    def velocity_product(self, q: np.ndarray, dq: np.ndarray) -> np.ndarray:
        """dJ dq, (6,): the tip's acceleration at (q, dq) with ddq = 0, Eq. (4); rows as in J.

        Args:
            q: (n,) [rad].
            dq: (n,) [rad/s].
        """
        q = finite_vector(q, self.n, 'q')
        dq = finite_vector(dq, self.n, 'dq')
        self._placed = b''
        pin.forwardKinematics(self._model, self._data, q, dq, np.zeros(self.n))
        ddx = pin.getFrameClassicalAcceleration(self._model, self._data, self._tip, _ALIGNED)
        return ddx.vector.copy()

    def tip(self, q: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Tip position f(q), (3,) [m], and orientation, (3, 3), in the base frame."""
        q = finite_vector(q, self.n, 'q')
        return self._tip_position(q), self._tip_orientation(q)

    def pose(self, q: np.ndarray, frame: str) -> tuple[np.ndarray, np.ndarray]:
        """Position (3,) [m] and orientation (3, 3) of a frame in the base frame.

        Args:
            q: (n,) [rad].
            frame: Name of a link.
        """
        q = finite_vector(q, self.n, 'q')
        self._placed = b''
        pin.forwardKinematics(self._model, self._data, q)
        placement = pin.updateFramePlacement(self._model, self._data, self._frame(frame))
        return placement.translation.copy(), placement.rotation.copy()

    def position(self, q: np.ndarray, frame: str) -> np.ndarray:
        """Position of a frame's origin in the base frame, (3,) [m].

        Args:
            q: (n,) [rad].
            frame: Name of a link.
        """
        return self.pose(q, frame)[0]

    def energies_and_positions(
        self, q: np.ndarray, dq: np.ndarray, frame: str
    ) -> tuple[np.ndarray, np.ndarray]:
        """1/2 dq' M dq, (ticks,) [J], without M, and the positions of a frame's origin in the base
        frame, (ticks, 3) [m].

        Args:
            q: (ticks, n) [rad].
            dq: (ticks, n) [rad/s].
            frame: Name of a link.
        """
        index = self._frame(frame)
        place = self._data.oMf[index].translation  # in the data: changes with them
        self._placed = b''
        energies = []
        x = np.empty((len(q), 3))
        for row, q_k, dq_k in zip(x, q, dq, strict=True):
            energies.append(pin.computeKineticEnergy(self._model, self._data, q_k, dq_k))
            pin.updateFramePlacement(self._model, self._data, index)
            row[:] = place
        return np.array(energies), x

    def jacobian(self, q: np.ndarray, frame: str) -> np.ndarray:
        """Jacobian of a frame in the base frame, (6, n): the linear rows, then the angular ones.

        Args:
            q: (n,) [rad].
            frame: Name of a link.
        """
        q = finite_vector(q, self.n, 'q')
        self._placed = b''
        J: np.ndarray = pin.computeFrameJacobian(
            self._model, self._data, q, self._frame(frame), _ALIGNED
        )
        return J

    def check_reach(self, x: np.ndarray) -> None:
        """Refuse a point that the tip cannot reach: one that is farther from the first joint than
        all links in one line, with linear joints at their longest.

        Args:
            x: Position in the base frame, (3,) [m].

        Raises:
            RangeError: It is too far away.
        """
        root, length = self._length()
        distance = float(np.linalg.norm(x - root))
        if not distance <= length:
            raise RangeError('distance from the first joint', distance, 0.0, length, 'm')

    def _length(self) -> tuple[np.ndarray, float]:
        """Position of the first joint in the base frame, (3,) [m], and a bound on the distance of
        the tip from there [m].
        """
        joint = self._model.frames[self._tip].parentJoint
        length = self.reach
        while joint:
            if self._model.joints[joint].shortname().startswith('JointModelP'):  # prismatic
                place = self._model.joints[joint].idx_q
                length += float(max(abs(self.q_min[place]), abs(self.q_max[place])))
            root = self._model.jointPlacements[joint].translation.copy()
            joint = self._model.parents[joint]
        return root, length

    def _tip_position(self, q: np.ndarray) -> np.ndarray:
        self._place_tip(q)
        return self._tip_x.copy()

    def _tip_orientation(self, q: np.ndarray) -> np.ndarray:
        self._place_tip(q)
        return self._tip_R.copy()

    def _tip_jacobian(self, q: np.ndarray) -> np.ndarray:
        if self._tip_J is None:
            self._placed = b''
        self._place_tip(q)
        J: np.ndarray = self._tip_J
        self._tip_J = None  # the caller may change it
        return J

    def _place_tip(self, q: np.ndarray) -> None:
        """Compute the tip's pose and its Jacobian, unless q is that of the last call.

        A tick asks for all of them: each alone takes as long as they do together.
        """
        key = q.tobytes()
        if self._placed != key:
            self._placed = b''  # in case that this fails
            self._tip_J = pin.computeFrameJacobian(self._model, self._data, q, self._tip, _ALIGNED)
            self._placed = key

    def _inertia(self, q: np.ndarray) -> np.ndarray:
        return pin.crba(self._model, self._data, q)  # a copy

    def _bias_torque(self, q: np.ndarray, dq: np.ndarray) -> np.ndarray:
        return pin.nonLinearEffects(self._model, self._data, q, dq)  # a copy

    def _reach(self) -> float:
        """Length of the arm from its second joint to the tip, stretched out [m]."""
        tip = self._model.frames[self._tip]
        reach = np.linalg.norm(tip.placement.translation)
        joint = tip.parentJoint
        while self._model.parents[joint]:
            reach += np.linalg.norm(self._model.jointPlacements[joint].translation)
            joint = self._model.parents[joint]
        return float(reach)

    def _frame(self, name: str) -> int:
        """The frame of a link; a joint may have the same name."""
        if not self._model.existFrame(name, pin.BODY):
            raise UnknownNameError('frame', name, self.links)
        return self._model.getFrameId(name, pin.BODY)


def jacobian_derivatives(J: np.ndarray) -> np.ndarray:
    """dJ/dq_i of a serial arm's Jacobian J (6, n), (n, 6, n), by the rows of J alone.

    With v_j and w_j the linear and angular columns: joint i turns or shifts all that comes after
    it, so dw_j/dq_i = w_i x w_j and dv_j/dq_i = w_i x v_j for i <= j, and w_j x v_i for i > j.
    """
    n = J.shape[1]
    turns = J[3:].T.dot(_CROSS).reshape(n, 3, 3)  # w_i x as a matrix
    dv = turns @ J[:3]  # (i, 3, j): w_i x v_j
    dw = turns @ J[3:]
    inner = np.tri(n, dtype=bool).T[:, None, :]  # (i, 1, j): i <= j
    dv = np.where(inner, dv, dv.transpose(2, 1, 0))
    return np.concatenate((dv, np.where(inner, dw, 0.0)), axis=1)
