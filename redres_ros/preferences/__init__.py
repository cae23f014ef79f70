"""The preferences: auxiliary joint accelerations ddq_N of Eq. (19)."""

import math
from abc import ABC, abstractmethod
from dataclasses import dataclass, replace
from typing import ClassVar, Self

import numpy as np

from redres_ros.errors import UnknownNameError
from redres_ros.parameter import Checked, Table, param
from redres_ros.resolution import Weight, solve_weight
from redres_ros.robot_model import RobotState
from redres_ros.types import JointAccelerations, as_vector

_LITTLE = 1e-3  # [rad/s^2]
_FARTHEST = 1000.0  # [m] a height that no arm reaches; 1e308 times a gain would be infinite
_ROWS = {'position': 3, 'pose': 6}  # of the Jacobian that is to be far from singular


@dataclass(frozen=True)
class Preference(Checked, ABC):
    """A null-space objective. It adds T ddq_N to the bias of every law that has velocity history.

    A subclass is a frozen dataclass whose fields are declared with `param`. One that uses a sensor
    names its `measurement`, a topic of the node and a key of `Controller.measurements`, finds it in
    `state.measurements` while it is fresh, and is zero without it.
    """

    measurement: ClassVar[str] = ''
    qualifier: ClassVar[str] = ''  # the field that is given after an @, as in manipulability@pose
    gain: float = param(4.0, 'k of the auxiliary acceleration [1/s^2]', 0.0, 1e4)

    @abstractmethod
    def acceleration(self, state: RobotState) -> JointAccelerations:
        """ddq_N."""

    def acceleration_in(self, state: RobotState, W: Weight) -> JointAccelerations:
        """ddq_N for a law of the weight W, if it depends on that."""
        return self.acceleration(state)

    def asks(self, state: RobotState) -> bool:
        """Whether a measurement is to move an arm that is at rest."""
        is_fresh = self.measurement in state.measurements
        return is_fresh and bool((np.abs(self.acceleration(state)) > _LITTLE).any())

    def with_initial_targets(self, state: RobotState) -> Self:
        """A copy with unset targets taken from the current state."""
        return self


@dataclass(frozen=True)
class JointCentering(Preference):
    """The middle of the joint ranges: ddq_N = -k dH/dq.

    H = 1/(2n) sum ((q_i - m_i) / (q_max,i - q_min,i))^2, m the middles.
    """

    def acceleration(self, state: RobotState) -> JointAccelerations:
        width = state.model.q_max - state.model.q_min  # (n,) [rad]
        offset = state.q - state.model.q_min - width / 2.0
        return -self.gain * offset / (len(offset) * width**2)


@dataclass(frozen=True)
class JointLimitAvoidance(Preference):
    """Away from the ends of the joint ranges, ahead of time: ddq_N = -k e.

    e is by how much q + t dq, where the joint will be after the horizon t, is beyond the margin
    before an end. So it acts on a joint that comes near an end, the earlier the faster it is, and
    on no other: in mid-range the law is left alone.
    """

    gain: float = param(40.0, 'k of the auxiliary acceleration [1/s^2]', 0.0, 1e4)
    margin: float = 0.26  # distance from the ends in which it acts at rest [rad]
    horizon: float = 0.5  # t, how far a motion is predicted [s]

    def acceleration(self, state: RobotState) -> JointAccelerations:
        predicted = state.q + self.horizon * state.dq_prev  # (n,) [rad]
        above = np.maximum(predicted - (state.model.q_max - self.margin), 0.0)
        below = np.maximum(state.model.q_min + self.margin - predicted, 0.0)
        return self.gain * (below - above)


@dataclass(frozen=True)
class Posture(Preference):
    """A posture q*: ddq_N = -k (q - q*)."""

    target: tuple[float, ...] = param((), 'q*, a value for each joint [rad]; none: the start')

    def acceleration(self, state: RobotState) -> JointAccelerations:
        target = as_vector(np.array(self.target), len(state.q), 'target of posture')
        return -self.gain * (state.q - target)

    def with_initial_targets(self, state: RobotState) -> Self:
        return replace(self, target=self.target or tuple(state.q.tolist()))


@dataclass(frozen=True)
class Manipulability(Preference):
    """Away from singularities: ddq_N = k d/dq sqrt(det(J J')).

    J is of the tip's position, or of its pose in manipulability@pose; UnknownNameError for other
    rows. Where it is singular the measure is zero and has no gradient; ddq_N is then zero, too.
    """

    qualifier: ClassVar[str] = 'rows'
    rows: str = 'position'

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.rows not in _ROWS:
            raise UnknownNameError('rows of manipulability', self.rows, _ROWS)

    def acceleration(self, state: RobotState) -> JointAccelerations:
        m = _ROWS[self.rows]
        J = state.J[:m]
        s = np.linalg.svd(J, compute_uv=False)
        if s[-1] <= 1e-9 * s[0]:
            return np.zeros(len(state.q))
        J_pinv = np.linalg.solve(J.dot(J.T), J)  # (m, n), the transpose of J^#
        dJ = state.jacobian_derivatives('')[:, :m]  # (n, m, n)
        gradient = float(np.prod(s)) * np.einsum('imj,mj->i', dJ, J_pinv)  # w tr(J^# dJ/dq_i)
        return self.gain * gradient


@dataclass(frozen=True)
class ElbowHeight(Preference):
    """A high elbow: ddq_N = k dz/dq; or one at a desired height z*: ddq_N = -k (z - z*) dz/dq."""

    height: float = param(math.inf, 'z*, desired height of the elbow [m]; inf: as high as possible')

    def acceleration(self, state: RobotState) -> JointAccelerations:
        frame = state.model.elbow_frame
        slope = state.jacobian(frame)[2]  # (n,) dz/dq
        if math.isinf(self.height):
            pull = math.copysign(1.0, self.height)
        else:
            pull = min(max(self.height, -_FARTHEST), _FARTHEST) - float(state.pose(frame)[0][2])
        return self.gain * pull * slope


@dataclass(frozen=True)
class Compliance(Preference):
    """Yielding to torques from outside: ddq_N = k W^-1 tau_ext; nothing while none are measured.

    W is the law's weight. So a force f on the tip moves nothing in the null space, dq = Z z:
    Z' W W^-1 J' f = (J Z)' f = 0.
    """

    measurement: ClassVar[str] = 'external_torques'
    gain: float = param(1.0, 'k; with W = I in [rad/(s^2 Nm)], with W = M in [1]', 0.0, 1e4)

    def acceleration(self, state: RobotState) -> JointAccelerations:
        torques = state.measurements.get(self.measurement)
        if torques is None:
            return np.zeros(len(state.q))
        return self.gain * as_vector(torques, len(state.q), self.measurement)

    def acceleration_in(self, state: RobotState, W: Weight) -> JointAccelerations:
        return solve_weight(W, self.acceleration(state))


# A new preference is one small class and one line in this table.
PREFERENCES: Table[Preference] = Table(
    'preference',
    Preference,
    joint_centering=JointCentering,
    joint_limit_avoidance=JointLimitAvoidance,
    posture=Posture,
    manipulability=Manipulability,
    elbow_height=ElbowHeight,
    compliance=Compliance,
)
make_preference = PREFERENCES.make
