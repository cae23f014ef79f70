"""Limits on what a client commands: what is refused, and what makes the arm stop."""

from collections import deque
from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from redres_ros.fake_robot.reflex import KUKA_NAMES, Reflex
from redres_ros.parameter import check_parameters, param
from redres_ros.robots.joint_limits import JointLimits

# [rad], [rad/s] for rounding: a client may command exactly the limit
_ROUNDING = 1e-10


@dataclass(frozen=True)
class ValidatorSettings:
    """How the limits are applied."""

    acceleration_window: float = param(
        0.02, 'time over which the commanded acceleration is averaged [s]', 1e-4, 1.0
    )
    position_margin: float = param(
        float(np.radians(0.5)), 'distance kept from the position limits [rad]', 0.0, 0.5
    )
    acceleration_scale: float = param(1.0, 'factor on the acceleration limits', 0.01, 100.0)
    acceleration_tolerance: float = param(
        2e-4,
        'allowed excess: seconds at twice the acceleration limit [s]',
        0.0,
        0.1,
    )

    velocity_stops: bool = param(
        False, 'a velocity above its limit ends command mode, instead of being limited'
    )
    jerk_limit: float = param(
        0.0, 'largest change of the commanded acceleration; 0: any [rad/s^3]', 0.0, 1e6
    )

    def __post_init__(self) -> None:
        check_parameters(self)


class CommandValidator:
    """Judges the stream of commanded positions, one a cycle, against the limits of the joints.

    Position and acceleration end in a stop. Velocity does not by default: the follower keeps to it,
    as the robot's own interpolation does. Acceleration is the commanded velocity's change over a
    window, because a single step of a sampled command, such as a new segment makes, is far above
    the limit and does the arm no harm. Its excess over the limit adds up from cycle to cycle, and
    what is below the limit takes away from the sum. So zero-mean noise cancels, and a sustained
    excess accumulates. Every comparison asks whether a value is allowed, so NaN is not.

    Args:
        limits: Of the joints.
        period: The cycle [s].
        settings: How the limits are applied.
        names: What each cause of a stop is called.
    """

    def __init__(
        self,
        limits: JointLimits,
        period: float,
        settings: ValidatorSettings | None = None,
        names: Mapping[Reflex, str] = KUKA_NAMES,
    ) -> None:
        settings = settings or ValidatorSettings()
        self.limits = replace(
            limits, acceleration=limits.acceleration * settings.acceleration_scale
        )
        self.period = period
        self._names = names
        self._lower = limits.lower + settings.position_margin
        self._upper = limits.upper - settings.position_margin
        self._cycles = max(1, round(settings.acceleration_window / period))
        # (n,) [rad/s^2], summed
        self._tolerance = self.limits.acceleration * settings.acceleration_tolerance / period
        self._velocity_stops = settings.velocity_stops
        self._jerk_limit = settings.jerk_limit or np.inf
        self.begin()

    def begin(self) -> None:
        """Forget the stream: the next command follows a standstill."""
        standstill = np.zeros(len(self.limits.joint_names))  # (n,)
        # (n,) [rad/s] each; the oldest is one window ago
        self._velocities = deque([standstill] * self._cycles, maxlen=self._cycles)
        self._acceleration = standstill  # (n,) [rad/s^2] of the last cycle
        # (n,) [rad/s^2] by which the acceleration was above its limit, summed over cycles
        self._excess = standstill

    def violation(self, position: np.ndarray, velocity: np.ndarray) -> str:
        """Why the arm must stop at a command; empty if it need not.

        Args:
            position: The command, (n,) [rad].
            velocity: From the command before, (n,) [rad/s].
        """
        change = velocity - self._velocities[0]  # (n,)
        acceleration = (velocity - self._velocities[-1]) / self.period  # (n,)
        jerk = (acceleration - self._acceleration) / self.period  # (n,)
        self._velocities.append(velocity)
        self._acceleration = acceleration
        return (
            self._position_violation(position)
            or self._velocity_violation(position, velocity)
            or self._braking_violation(position, velocity)
            or self._acceleration_violation(np.abs(change) / (self._cycles * self.period))
            or self._jerk_violation(np.abs(jerk))
        )

    def _position_violation(self, position: np.ndarray) -> str:
        lower = self._lower
        upper = self._upper
        allowed = (lower - _ROUNDING <= position) & (position <= upper + _ROUNDING)
        j = _first_false(allowed)
        if j is None:
            return ''
        return self._reason(
            Reflex.POSITION,
            j,
            f'{position[j]:.4g} rad, allowed {lower[j]:.4g} to {upper[j]:.4g}',
        )

    def _velocity_violation(self, position: np.ndarray, velocity: np.ndarray) -> str:
        if not self._velocity_stops:
            return ''
        slowest, fastest = self.limits.velocities_at(position)
        j = _first_false((slowest - _ROUNDING <= velocity) & (velocity <= fastest + _ROUNDING))
        if j is None:
            return ''
        return self._reason(
            Reflex.VELOCITY,
            j,
            f'{velocity[j]:.3g} rad/s at {position[j]:.4g} rad, '
            f'allowed {slowest[j]:.3g} to {fastest[j]:.3g}',
        )

    def _braking_violation(self, position: np.ndarray, velocity: np.ndarray) -> str:
        """The arm must be able to stop before the limit itself: the margin alone is too short for
        that at speed.
        """
        lower = self.limits.lower
        upper = self.limits.upper
        end = position + velocity * np.abs(velocity) / (2.0 * self.limits.acceleration)  # (n,)
        j = _first_false((lower <= end) & (end <= upper))
        if j is None:
            return ''
        return self._reason(
            Reflex.BRAKING,
            j,
            f'{position[j]:.4g} rad at {velocity[j]:.3g} rad/s, braking would end at '
            f'{end[j]:.4g}, allowed {lower[j]:.4g} to {upper[j]:.4g}',
        )

    def _acceleration_violation(self, acceleration: np.ndarray) -> str:
        allowed = self.limits.acceleration
        self._excess = np.maximum(0.0, self._excess + (acceleration - allowed))
        j = _first_false(self._excess <= self._tolerance)
        if j is None:
            return ''
        return self._reason(
            Reflex.ACCELERATION,
            j,
            f'{acceleration[j]:.3g} rad/s^2 over {1e3 * self._cycles * self.period:g} ms, '
            f'allowed {allowed[j]:.3g}',
        )

    def _jerk_violation(self, jerk: np.ndarray) -> str:
        j = _first_false(jerk <= self._jerk_limit)
        if j is None:
            return ''
        return self._reason(
            Reflex.JERK, j, f'{jerk[j]:.3g} rad/s^3, allowed {self._jerk_limit:.3g}'
        )

    def _reason(self, reflex: Reflex, joint: int, what: str) -> str:
        return f'{self._names[reflex]}: {self.limits.joint_names[joint]} commanded {what}'


def _first_false(fine: np.ndarray) -> int | None:
    """Index of the first joint that is not fine; None if all are."""
    return None if fine.all() else int(np.argmin(fine))
