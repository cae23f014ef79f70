"""Limits on what a client commands: what is refused, and what makes the arm stop."""

from collections import deque
from dataclasses import dataclass, replace

import numpy as np

from redres_ros.parameter import check_parameters, param
from redres_ros.robots.joint_limits import JointLimits


@dataclass(frozen=True)
class GuardSettings:
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
        'how long twice the acceleration limit is borne; a smaller excess in proportion longer [s]',
        0.0,
        0.1,
    )

    def __post_init__(self) -> None:
        check_parameters(self)


class Guard:
    """Judges the stream of commanded positions, one a cycle of `period` [s], against the limits of
    the joints.

    Position and acceleration end in a stop. Velocity does not: the follower keeps to it, as the
    robot's own interpolation does. Acceleration is the commanded velocity's change over a window,
    because a single step of a sampled command, such as a new segment makes, is far above the limit
    and does the arm no harm. Its excess over the limit adds up from cycle to cycle, and what is
    below the limit takes away from the sum, so that noise on a command just below the limit is no
    reason to stop: it goes to and fro, and an excess that lasts does not. Every comparison asks
    whether a value is allowed, so NaN is not.
    """

    def __init__(
        self, limits: JointLimits, period: float, settings: GuardSettings | None = None
    ) -> None:
        settings = settings or GuardSettings()
        self.limits = replace(
            limits, acceleration=limits.acceleration * settings.acceleration_scale
        )
        self.period = period
        self._lower = limits.lower + settings.position_margin
        self._upper = limits.upper - settings.position_margin
        self._cycles = max(1, round(settings.acceleration_window / period))
        # (n,) [rad/s^2], summed
        self._tolerance = self.limits.acceleration * settings.acceleration_tolerance / period
        self.begin()

    def begin(self) -> None:
        """Forget the stream: the next command follows a standstill."""
        standstill = np.zeros(len(self.limits.joint_names))  # (n,)
        self._velocities = deque(
            [standstill] * self._cycles, maxlen=self._cycles
        )  # the oldest is one window ago
        # (n,) [rad/s^2] by which the acceleration was above its limit, summed over cycles
        self._excess = standstill

    def violation(self, position: np.ndarray, velocity: np.ndarray) -> str:
        """Why the arm must stop at a command, position (n,) [rad] at velocity (n,) [rad/s]; empty
        if it need not.
        """
        change = velocity - self._velocities[0]  # (n,)
        self._velocities.append(velocity)
        return (
            self._position_violation(position)
            or self._braking_violation(position, velocity)
            or self._acceleration_violation(np.abs(change) / (self._cycles * self.period))
        )

    def _position_violation(self, position: np.ndarray) -> str:
        lower = self._lower
        upper = self._upper
        j = _first_false((lower <= position) & (position <= upper))
        return (
            ''
            if j is None
            else (
                f'position limit: {self.limits.joint_names[j]} commanded {position[j]:.4g} rad, '
                f'allowed {lower[j]:.4g} to {upper[j]:.4g}'
            )
        )

    def _braking_violation(self, position: np.ndarray, velocity: np.ndarray) -> str:
        """The arm must be able to stop before the limit itself: the margin alone is too short for
        that at speed.
        """
        lower = self.limits.lower
        upper = self.limits.upper
        end = position + velocity * np.abs(velocity) / (2.0 * self.limits.acceleration)  # (n,)
        j = _first_false((lower <= end) & (end <= upper))
        return (
            ''
            if j is None
            else (
                f'position limit: {self.limits.joint_names[j]} commanded {position[j]:.4g} rad at '
                f'{velocity[j]:.3g} rad/s, braking would end at {end[j]:.4g}, '
                f'allowed {lower[j]:.4g} to {upper[j]:.4g}'
            )
        )

    def _acceleration_violation(self, acceleration: np.ndarray) -> str:
        allowed = self.limits.acceleration
        self._excess = np.maximum(0.0, self._excess + (acceleration - allowed))
        j = _first_false(self._excess <= self._tolerance)
        return (
            ''
            if j is None
            else (
                f'protective stop: {self.limits.joint_names[j]} commanded {acceleration[j]:.3g} '
                f'rad/s^2 over {1e3 * self._cycles * self.period:g} ms, allowed {allowed[j]:.3g}'
            )
        )


def _first_false(fine: np.ndarray) -> int | None:
    """Index of the first joint that is not fine; None if all are."""
    return None if fine.all() else int(np.argmin(fine))
