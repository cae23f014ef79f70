"""Limits of the joints: acceleration, jerk, velocity and position, all in one box; and torque."""

from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from redres_ros.errors import ArrayError
from redres_ros.kernels.boxes import ACCELERATION, END_SPEED, JERK, POSITION, VELOCITY
from redres_ros.limits.limit import JointLimit, Limit, ReferenceState
from redres_ros.parameter import param
from redres_ros.solver import Rows
from redres_ros.types import JointAccelerations, Seconds

# Fraction of the limits that a robot may see. It judges differences of positions, whose 16 digits
# leave an acceleration 10 and a jerk 9 at 1 kHz.
_SEEN = 1.0 - 1e-7

# An arm brakes at its ends with this fraction of the deceleration that the robot counts on. The
# smaller, the less of the range is lost: offset^2 / (2 (deceleration - that of the arm)).
_GENTLER = 0.7
_CYCLE = 1e-3  # [s] of robots that limit velocities by position: they judge a joint one step ahead
_TOLERANCE = 1e-3  # [rad/s] below their limits, as libfranka's rate limiter

_RISE = 100.0  # [1/s]; an arm without jerk limits may reach its acceleration in 10 ms


@dataclass(frozen=True, eq=False)
class BrakingLimit(Limit):
    """What limits that assume an acceleration have in common.

    Raises ArrayError if neither `acceleration` nor the arm has a positive value for each joint.
    """

    acceleration: tuple[float, ...] = ()  # [rad/s^2], for an arm whose table has none
    A: JointAccelerations = field(init=False, repr=False)  # that is allowed

    def __post_init__(self) -> None:
        super().__post_init__()
        given = self.acceleration or self.model.arm.acceleration_limit
        _check_positive('acceleration', 'rad/s^2', given, self)
        A = self.scale * np.array(given)
        A.setflags(write=False)
        object.__setattr__(self, 'A', A)


@dataclass(frozen=True, eq=False)
class AccelerationLimit(BrakingLimit, JointLimit):
    """|dq - dq_prev| <= A T. It holds whatever the state.

    Only a joint that would leave its range, because limits have become narrower while it was fast,
    brakes with more: with the arm's own acceleration, whatever the scale. Below `reach` the tip
    brakes before the end of its reach, and each direction of dx has a scaling of its own.
    """

    box = ACCELERATION

    reach: float = param(
        0.0,
        'fraction of the largest singular value below which the tip brakes before the end of its '
        'reach and goes on along it; 0: nowhere, and joints swing there while the tip is led '
        'outwards; nodes begin with 0.02',
        0.0,
        0.1,
        live=True,
    )

    def _enter(self, limits: np.ndarray) -> None:
        limits['A'] = self.A
        limits['A_arm'] = self.A / self.scale


@dataclass(frozen=True, eq=False)
class JerkLimit(JointLimit):
    """|ddq - ddq_prev| <= J T, unless a joint would leave its range or exceed its speed limit.

    The limits on velocity and position leave each joint the distance that it needs to brake at J.
    So it does not brake harder, unless limits have become narrower while it was fast, or commands
    got lost (kernels/boxes.py). An arm without jerk limits gets RISE times its acceleration limits.
    Raises ArrayError if there are none either.
    """

    box = JERK

    jerk: tuple[float, ...] = ()  # [rad/s^3]; empty for the arm's table

    def __post_init__(self) -> None:
        super().__post_init__()
        _check_positive('jerk', 'rad/s^3', self._given_jerk, self)

    @property
    def _given_jerk(self) -> tuple[float, ...]:
        arm = self.model.arm
        return self.jerk or arm.jerk_limit or tuple(_RISE * A for A in arm.acceleration_limit)

    def _enter(self, limits: np.ndarray) -> None:
        limits['J'] = _SEEN * self.scale * np.array(self._given_jerk)
        A_arm = np.array(self.model.arm.acceleration_limit or np.inf)
        limits['A_arm'] = A_arm
        limits['A_jerk'] = _SEEN * self.scale * A_arm


@dataclass(frozen=True, eq=False)
class VelocityLimit(JointLimit):
    """|dq| <= V. A joint that is faster brakes as hard as it may."""

    box = VELOCITY

    def _enter(self, limits: np.ndarray) -> None:
        limits['V'] = self.scale * self.model.dq_max
        limits['V_arm'] = self.model.dq_max


@dataclass(frozen=True, eq=False)
class PositionLimit(BrakingLimit, JointLimit):
    """-beta(q - q_min) <= dq <= beta(q_max - q): the joint can always stop within its range.

    beta is the largest speed from which it stops in time if it brakes by A T a tick
    (kernels/boxes.py). A joint that is outside comes back as fast as A allows, so that it stops at
    the end of its range. Raises ArrayError if the margin leaves nothing of a joint's range.
    """

    box = POSITION

    margin: float = param(
        float(np.radians(0.5)),
        'distance kept from the ends of the range [rad]',
        0.0,
        1.0,
        live=True,
    )

    def __post_init__(self) -> None:
        super().__post_init__()
        narrowest = float((self.model.q_max - self.model.q_min).min())
        if not 2.0 * self.margin < narrowest:
            got = f'a margin of {self.margin} rad leaves nothing of a range of {narrowest:.3g} rad'
            raise ArrayError(f'{got}; allowed: less than {narrowest / 2.0:.3g}')

    def _enter(self, limits: np.ndarray) -> None:
        limits['lower'][:, 0] = self.model.q_min + self.margin
        limits['upper'][:, 0] = self.model.q_max - self.margin
        limits['A_stop'][:, 0] = self.A


@dataclass(frozen=True, eq=False)
class EndSpeedLimit(BrakingLimit, JointLimit):
    """A joint near the end of its range is no faster than the robot allows there.

    The robot allows v <= sqrt(2 D d) - v_0 at a distance d. The joint brakes with less than D, with
    D', and stops before the end, by

        v_0^2 / (2 (D - D')),

    the least for which sqrt(2 D' d') stays below the robot's limit at every speed. It is the limit
    on positions with these ends. An arm without end_speeds keeps to the ends of its range.
    """

    box = END_SPEED

    def _enter(self, limits: np.ndarray) -> None:
        lower = self.model.q_min
        upper = self.model.q_max
        A = self.A
        if self.model.arm.end_speeds:
            lower, upper, D, offset = np.array(self.model.arm.end_speeds).T
            A = np.minimum(self.A, _GENTLER * D)
            v = offset + _TOLERANCE
            touching = v * A / (D - A)  # the speed at which both curves touch [rad/s]
            before = v**2 / (2.0 * (D - A)) + _CYCLE * touching
            lower = lower + before
            upper = upper - before
        limits['lower'][:, 1] = lower
        limits['upper'][:, 1] = upper
        limits['A_stop'][:, 1] = A


@dataclass(frozen=True, eq=False)
class TorqueLimit(Limit):
    """-tau_max <= M (dq - dq_prev) / T + n <= tau_max, Eq. (6) with Eq. (13).

    Raises ArrayError for a joint without an effort limit above zero.
    """

    order = 1
    scaled_by = 'torque_scale'

    def __post_init__(self) -> None:
        super().__post_init__()
        for name, tau in zip(self.model.joint_names, self.model.tau_max, strict=True):
            if not tau > 0.0:
                got = f'joint {name} has the effort limit {tau:g} in its URDF'
                raise ArrayError(f'{got}; the torque limit needs one above zero')

    @cached_property
    def _ends(self) -> np.ndarray:
        return self.scale * np.array((-self.model.tau_max, self.model.tau_max))

    def rows(self, state: ReferenceState, T: Seconds) -> Rows:
        C = state.M / T  # (n, n)
        rest = state.n - C.dot(state.dq_prev)  # (n,), the torque that dq = 0 would take
        low, high = self._ends - rest
        return C, low, high


def _check_positive(what: str, unit: str, given: tuple[float, ...], limit: Limit) -> None:
    """Raise ArrayError unless there is a positive value for each joint."""
    model = limit.model
    if len(given) != model.n or not min(given) > 0.0:
        raise ArrayError(
            f'{what} limits of {model.arm.source}: {given or "none known"}; '
            f'expected {model.n} positive values [{unit}] in {what}=(...)'
        )
