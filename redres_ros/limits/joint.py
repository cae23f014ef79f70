"""Limits of the joints: acceleration, velocity and position, each a box, and torque as rows."""

from abc import abstractmethod
from dataclasses import dataclass
from functools import cached_property
from typing import ClassVar

import numpy as np

from redres_ros.errors import ArrayError
from redres_ros.kernels.boxes import ACCELERATION, JERK, POSITION, VELOCITY, fill_boxes, within
from redres_ros.kernels.tick import agitation, differentiate
from redres_ros.limits.limit import BoxLimit, Limit, ReferenceState, RowLimit
from redres_ros.parameter import param
from redres_ros.solver import Box, Rows

# What a robot may be shown of its limits. It judges differences of positions, whose 16 digits leave
# an acceleration 10 and a jerk 9 at 1 kHz.
_SHOWN = 1.0 - 1e-7

# An arm brakes at its ends with this fraction of the deceleration that the robot counts on. The
# smaller, the less of the range is lost: offset^2 / (2 (deceleration - that of the arm)).
_GENTLER = 0.7
_CYCLE = 1e-3  # [s] of robots that limit velocities by position: they judge a joint one step ahead
_TOLERANCE = 1e-3  # [rad/s] below their limits, as libfranka's rate limiter

_NO_INERTIA = 1e-12  # [kg m^2], of links without mass: only keeps a division finite
_RISE = 100.0  # [1/s]; an arm without jerk limits may reach its acceleration in 10 ms


@dataclass(frozen=True, eq=False)
class JointLimit(BoxLimit):
    """A limit whose box is one of the formulas in kernels/boxes.py."""

    kind: ClassVar[int]  # of those formulas

    @property
    @abstractmethod
    def figures(self) -> np.ndarray:
        """What the formula needs, (3, n)."""

    def box(self, state: ReferenceState, T: float) -> Box:
        boxes = np.empty((2, 2, self.model.n))
        kinds = np.array([self.kind])
        dq = state.dq_prev
        fill_boxes(dq, state.q, dq, state.ddq_prev, T, kinds, self.figures[None], boxes, 1.0, 1.0)
        return boxes[0, 0], boxes[0, 1]


@dataclass(frozen=True, eq=False)
class AccelerationFigures(Limit):
    """Figures common to the limits that assume an acceleration.

    Args:
        acceleration: (n,) [rad/s^2], for an arm whose table has none; empty for that table's.

    Raises:
        ArrayError: Neither it nor the arm's table has a positive value for each joint.
    """

    acceleration: tuple[float, ...] = ()

    def __post_init__(self) -> None:
        super().__post_init__()
        given = self.acceleration or self.model.arm.acceleration_limit
        if len(given) != self.model.n or not min(given) > 0.0:
            raise ArrayError(
                f'acceleration limits of {self.model.arm.urdf}: {given or "none known"}; '
                f'expected {self.model.n} positive values [rad/s^2] in acceleration=(...)'
            )

    @cached_property
    def A(self) -> np.ndarray:
        """The acceleration that is allowed, (n,) [rad/s^2]."""
        return self.scale * np.array(self.acceleration or self.model.arm.acceleration_limit)


@dataclass(frozen=True, eq=False)
class AccelerationLimit(AccelerationFigures, JointLimit):
    """|dq - dq_prev| <= A T. It holds whatever the state.

    Only a joint that would leave its range, because limits have become narrower while it was fast,
    brakes with more: with the arm's own acceleration, whatever the scale.

    Args:
        reach: Of the largest singular value of the task: below it the tip brakes before the end of
            its reach (boundary_braking.py), and each direction of dx has a scaling of its own.
    """

    order = 0
    kind = ACCELERATION

    reach: float = param(
        0.0,
        'fraction of the largest singular value below which the tip brakes before the end of its '
        'reach and goes on along it; 0: nowhere, and joints swing there while the tip is led '
        'outwards; nodes begin with 0.02',
        0.0,
        0.1,
        live=True,
    )

    @property
    def figures(self) -> np.ndarray:
        return np.stack((self.A, self.A / self.scale, self.A))


@dataclass(frozen=True, eq=False)
class JerkLimit(JointLimit):
    """|ddq - ddq_prev| <= J T. It holds whatever the state.

    With it, the limits on velocity and position leave each joint the way that it needs to brake
    without exceeding it (kernels/boxes.py).

    Args:
        jerk: (n,) [rad/s^3]; empty for the arm's table. An arm without one gets RISE times its
            acceleration limits.
        lost: A robot that bridges a lost command with constant acceleration sees a jump in the
            next one. Jerk, acceleration and velocity are lowered so that what it sees keeps the
            limits, whatever the order in which so many get lost. The count begins anew once three
            commands in a row have come.

    Raises:
        ArrayError: Neither it nor the arm's table has a positive value for each joint.
    """

    order = -1
    kind = JERK

    jerk: tuple[float, ...] = ()
    lost: int = param(
        0,
        'commands lost at short notice that the robot bridges with constant acceleration; jerk '
        'and acceleration are lowered for them',
        0,
        4,
        live=True,
    )

    def __post_init__(self) -> None:
        super().__post_init__()
        if len(self._given) != self.model.n or not min(self._given) > 0.0:
            raise ArrayError(
                f'jerk limits of {self.model.arm.urdf}: {self._given or "none known"}; '
                f'expected {self.model.n} positive values [rad/s^3] in jerk=(...)'
            )

    @property
    def _given(self) -> tuple[float, ...]:
        """Of each joint, unscaled [rad/s^3]."""
        arm = self.model.arm
        return self.jerk or arm.jerk_limit or tuple(_RISE * A for A in arm.acceleration_limit)

    @cached_property
    def J(self) -> np.ndarray:
        """The jerk that is allowed, (n,) [rad/s^3]."""
        # The robot extrapolates from velocity and acceleration as it has seen them, whose errors
        # are those of the position, once and twice differenced. The worst is that every other
        # command gets lost: each one then triples the error before it.
        seen = (3.0 ** (self.lost + 1) - 1.0) / 2.0  # [J T], change of the acceleration
        return _SHOWN * self.scale * np.array(self._given) / seen

    @property
    def figures(self) -> np.ndarray:
        A = np.array(self.model.arm.acceleration_limit or (np.inf,) * self.model.n)
        return np.stack((self.J, _SHOWN * self.scale * A, np.full(len(A), 3.0**self.lost - 1.0)))


@dataclass(frozen=True, eq=False)
class VelocityLimit(JointLimit):
    """|dq| <= V. A joint that is faster brakes as hard as it may."""

    order = 1
    kind = VELOCITY

    @cached_property
    def V(self) -> np.ndarray:
        """The velocity that is allowed, (n,) [rad/s]."""
        return self.scale * self.model.dq_max

    @property
    def figures(self) -> np.ndarray:
        return np.stack((self.V, self.V, self.V))


@dataclass(frozen=True, eq=False)
class PositionLimit(AccelerationFigures, JointLimit):
    """-beta(q - q_min) <= dq <= beta(q_max - q): the joint can always stop within its range.

    beta is the largest speed from which it stops in time if it brakes by A T a tick
    (kernels/boxes.py). A joint that is outside comes back as fast as A allows, so that it stops at
    the end of its range. scale acts on A.

    Args:
        margin: [rad].

    Raises:
        ArrayError: The margin leaves nothing of a joint's range.
    """

    order = 2
    kind = POSITION

    margin: float = param(
        float(np.radians(0.5)),
        'distance kept from the ends of the range [rad]',
        0.0,
        1.0,
        live=True,
    )

    def __post_init__(self) -> None:
        super().__post_init__()
        if not (self.q_min < self.q_max).all():
            narrowest = float((self.model.q_max - self.model.q_min).min())
            raise ArrayError(
                f'a margin of {self.margin} rad leaves nothing of a range of {narrowest:.3g} rad; '
                f'allowed: less than {narrowest / 2.0:.3g}'
            )

    @cached_property
    def q_min(self) -> np.ndarray:
        """(n,) [rad], the margin taken off."""
        return self.model.q_min + self.margin

    @cached_property
    def q_max(self) -> np.ndarray:
        """(n,) [rad], the margin taken off."""
        return self.model.q_max - self.margin

    @property
    def figures(self) -> np.ndarray:
        return np.stack((self.q_min, self.q_max, self.A))


@dataclass(frozen=True, eq=False)
class EndSpeedLimit(AccelerationFigures, JointLimit):
    """A joint near the end of its range is no faster than the robot allows there.

    The robot allows v <= sqrt(2 D d) - v_0 at a distance d. The joint brakes with less than D, with
    D', and stops before the end, by

        v_0^2 / (2 (D - D')),

    the least for which sqrt(2 D' d') stays below the robot's limit at every speed. It is the limit
    on positions with these figures. An arm without end_speeds keeps to the ends of its range.
    """

    order = 3
    kind = POSITION

    @property
    def figures(self) -> np.ndarray:
        if not self.model.arm.end_speeds:
            return np.stack((self.model.q_min, self.model.q_max, self.A))
        lower, upper, D, offset = np.array(self.model.arm.end_speeds).T
        A = np.minimum(self.A, _GENTLER * D)
        v = offset + _TOLERANCE
        touching = v * A / (D - A)  # the speed at which both curves touch [rad/s]
        before = v**2 / (2.0 * (D - A)) + _CYCLE * touching
        return np.stack((lower + before, upper - before, A))


@dataclass(frozen=True, eq=False)
class TorqueLimit(RowLimit):
    """-tau_max <= M (dq - dq_prev) / T + n <= tau_max, Eq. (6) with Eq. (13).

    Raises:
        ArrayError: A joint has no effort limit above zero.
    """

    order = 1
    scaled_by = 'torque_scale'

    def __post_init__(self) -> None:
        super().__post_init__()
        for name, tau in zip(self.model.joint_names, self.model.tau_max, strict=True):
            if not tau > 0.0:
                raise ArrayError(
                    f'joint {name} has the effort limit {tau:g} in its URDF; '
                    'the torque limit needs one above zero'
                )

    @cached_property
    def tau_max(self) -> np.ndarray:
        """The torque that is allowed, (n,) [Nm]."""
        return self.scale * self.model.tau_max

    @cached_property
    def _tau_min(self) -> np.ndarray:
        return -self.tau_max

    def rows(self, state: ReferenceState, T: float) -> Rows:
        C = state.M / T  # (n, n)
        rest = state.n - C.dot(state.dq_prev)  # (n,), the torque that dq = 0 would take
        return C, self._tau_min - rest, self.tau_max - rest

    @cached_property
    def _gentle(self) -> float:
        """The A + 2 V^2 up to which no torque exceeds its limit, wherever the arm is [rad/s^2]."""
        G, H = self.model.torque_bounds
        return float(np.min((self.tau_max - G) / np.maximum(H, _NO_INERTIA)))

    def is_kept(self, dq: np.ndarray, state: ReferenceState, T: float) -> bool:
        if agitation(dq, state.dq_prev, T) < self._gentle:  # in a sixth of the time of what follows
            return True
        ddq = np.empty(len(dq))
        differentiate(dq, state.dq_prev, T, ddq)  # Eq. (13)
        tau = self.model.torque(state.q, state.dq_prev, ddq)  # Eq. (6), without M or n
        return bool(within(tau, self._tau_min, self.tau_max))
