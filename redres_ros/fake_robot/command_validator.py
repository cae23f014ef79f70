"""Limits on what a client commands."""

from collections import deque
from collections.abc import Callable, Iterator

import numpy as np

from redres_ros.fake_robot.profile import Profile, Reflex
from redres_ros.robots.joint_limits import JointLimits
from redres_ros.types import JointPositions, JointVelocities, Seconds

# [rad], [rad/s] for rounding: a client may command exactly the limit
_ROUNDING = 1e-10

_Check = tuple[Reflex, np.ndarray, Callable[[int], str]]
"""A cause of a stop, whether each joint is fine (n,), and what to say of one that is not."""


class CommandValidator:
    """Judges the stream of commanded positions, one a cycle, against the limits of the joints.

    In some profiles velocity does not end in a stop: the reference keeps to it. Acceleration is the
    commanded velocity's change over a window, because a single step of a sampled command, as at a
    new segment, is far above the limit and does the arm no harm. Its excess over the limit adds up
    from cycle to cycle, and what is below the limit is subtracted: zero-mean noise cancels.

    Every comparison asks whether a value is allowed, so NaN is not.
    """

    def __init__(self, limits: JointLimits, period: Seconds, profile: Profile) -> None:
        self._limits = limits
        self._period = period
        self._profile = profile
        self._lower = limits.lower + profile.position_margin
        self._upper = limits.upper - profile.position_margin
        self._cycles = max(1, round(profile.acceleration_window / period))
        # (n,) [rad/s^2], summed over cycles
        self._tolerance = limits.acceleration * profile.acceleration_tolerance / period
        self.begin()

    def begin(self) -> None:
        """Reset: the next command follows a standstill."""
        standstill = np.zeros(len(self._limits.joint_names))  # (n,)
        # (n,) [rad/s] each; the oldest is one window ago
        self._velocities = deque([standstill] * self._cycles, maxlen=self._cycles)
        self._acceleration = standstill  # (n,) [rad/s^2] of the last cycle
        self._excess = standstill  # (n,) [rad/s^2] over the limit, summed over cycles

    def violation(self, position: JointPositions, velocity: JointVelocities) -> str:
        """Why the arm must stop at a command and its velocity; empty if it need not."""
        for reflex, fine, describe in self._checks(position, velocity):
            if not fine.all():
                j = int(np.argmin(fine))  # the first joint that is not fine
                name = self._limits.joint_names[j]
                return f'{self._profile.reflexes[reflex]}: {name} commanded {describe(j)}'
        return ''

    def _checks(self, position: JointPositions, velocity: JointVelocities) -> Iterator[_Check]:
        change = np.abs(velocity - self._velocities[0]) / (self._cycles * self._period)  # (n,)
        acceleration = (velocity - self._velocities[-1]) / self._period  # (n,)
        jerk = np.abs(acceleration - self._acceleration) / self._period  # (n,)
        self._velocities.append(velocity)
        self._acceleration = acceleration
        limits = self._limits

        lower = self._lower
        upper = self._upper
        yield (
            Reflex.POSITION,
            (lower - _ROUNDING <= position) & (position <= upper + _ROUNDING),
            lambda j: f'{position[j]:.4g} rad, allowed {lower[j]:.4g} to {upper[j]:.4g}',
        )
        if self._profile.velocity_stops:
            slowest, fastest = limits.velocities_at(position)
            yield (
                Reflex.VELOCITY,
                (slowest - _ROUNDING <= velocity) & (velocity <= fastest + _ROUNDING),
                lambda j: (
                    f'{velocity[j]:.3g} rad/s at {position[j]:.4g} rad, '
                    f'allowed {slowest[j]:.3g} to {fastest[j]:.3g}'
                ),
            )
        # The arm must be able to stop before the limit itself: the margin is too short for that.
        end = position + velocity * np.abs(velocity) / (2.0 * limits.acceleration)  # (n,)
        yield (
            Reflex.BRAKING,
            (limits.lower <= end) & (end <= limits.upper),
            lambda j: (
                f'{position[j]:.4g} rad at {velocity[j]:.3g} rad/s, braking would end at '
                f'{end[j]:.4g}, allowed {limits.lower[j]:.4g} to {limits.upper[j]:.4g}'
            ),
        )
        self._excess = np.maximum(0.0, self._excess + (change - limits.acceleration))
        yield (
            Reflex.ACCELERATION,
            self._excess <= self._tolerance,
            lambda j: (
                f'{change[j]:.3g} rad/s^2 over {1e3 * self._cycles * self._period:g} ms, '
                f'allowed {limits.acceleration[j]:.3g}'
            ),
        )
        yield (
            Reflex.JERK,
            jerk <= self._profile.jerk_limit,
            lambda j: f'{jerk[j]:.3g} rad/s^3, allowed {self._profile.jerk_limit:.3g}',
        )
