"""Limits on what a client commands."""

from collections import deque

import numpy as np

from redres_ros.fake_robot.profile import Profile, Reflex
from redres_ros.robots.joint_limits import JointLimits
from redres_ros.types import JointPositions, JointVelocities, Seconds

# [rad], [rad/s] for rounding: a client may command exactly the limit
_ROUNDING = 1e-10


class CommandValidator:
    """Judges the stream of commanded positions, one a cycle, against the limits of the joints.

    In some profiles velocity does not end in a stop: the reference keeps to it. Acceleration is the
    commanded velocity's change over a window, because a single step of a sampled command, as at a
    new segment, is far above the limit and does the arm no harm. Its excess over the limit adds up
    from cycle to cycle, and what is below the limit is subtracted: zero-mean noise cancels.
    """

    def __init__(self, limits: JointLimits, period: Seconds, profile: Profile) -> None:
        self._limits = limits
        self._period = period
        self._profile = profile
        self._cycles = max(1, round(profile.acceleration_window / period))
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
        profile = self._profile
        limits = self._limits
        window = self._cycles * self._period
        change = np.abs(velocity - self._velocities[0]) / window  # (n,)
        acceleration = (velocity - self._velocities[-1]) / self._period  # (n,)
        jerk = np.abs(acceleration - self._acceleration) / self._period  # (n,)
        self._velocities.append(velocity)
        self._acceleration = acceleration
        self._excess = np.maximum(0.0, self._excess + (change - limits.acceleration))
        tolerance = limits.acceleration * profile.acceleration_tolerance / self._period
        lower = limits.lower + profile.position_margin
        upper = limits.upper - profile.position_margin
        slowest, fastest = limits.velocities_at(position)
        # The arm must be able to stop before the limit itself: the margin is too short for that.
        end = position + velocity * np.abs(velocity) / (2.0 * limits.acceleration)  # (n,)
        # Every comparison asks whether a value is allowed, so NaN is not.
        fine = {
            Reflex.POSITION: (lower - _ROUNDING <= position) & (position <= upper + _ROUNDING),
            Reflex.VELOCITY: (slowest - _ROUNDING <= velocity) & (velocity <= fastest + _ROUNDING),
            Reflex.BRAKING: (limits.lower <= end) & (end <= limits.upper),
            Reflex.ACCELERATION: self._excess <= tolerance,
            Reflex.JERK: jerk <= profile.jerk_limit,
        }
        if not profile.velocity_stops:
            del fine[Reflex.VELOCITY]
        broken = next((reflex for reflex, joints in fine.items() if not joints.all()), None)
        if broken is None:
            return ''
        j = int(np.argmin(fine[broken]))  # the first joint that is not fine
        commanded = {
            Reflex.POSITION: f'{position[j]:.4g} rad, allowed {lower[j]:.4g} to {upper[j]:.4g}',
            Reflex.VELOCITY: f'{velocity[j]:.3g} rad/s at {position[j]:.4g} rad, '
            f'allowed {slowest[j]:.3g} to {fastest[j]:.3g}',
            Reflex.BRAKING: f'{position[j]:.4g} rad at {velocity[j]:.3g} rad/s, braking would '
            f'end at {end[j]:.4g}, allowed {limits.lower[j]:.4g} to {limits.upper[j]:.4g}',
            Reflex.ACCELERATION: f'{change[j]:.3g} rad/s^2 over {1e3 * window:g} ms, '
            f'allowed {limits.acceleration[j]:.3g}',
            Reflex.JERK: f'{jerk[j]:.3g} rad/s^3, allowed {profile.jerk_limit:.3g}',
        }
        return f'{profile.reflexes[broken]}: {limits.joint_names[j]} commanded {commanded[broken]}'
