"""Limits on what a client commands, and the causes of a stop."""

from collections import deque
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, replace
from enum import Enum

import numpy as np

from redres_ros.parameter import check_parameters, param
from redres_ros.robots.joint_limits import JointLimits

# [rad], [rad/s] for rounding: a client may command exactly the limit
_ROUNDING = 1e-10


class Reflex(Enum):
    """Causes of a stop. Each profile has its own names for them; a stop reason begins with one."""

    TIMING = 'commands are missing or come too late'
    START_POSE = 'the first command is not where the arm is'
    POSITION = 'a commanded position is outside its limits'
    BRAKING = 'at the commanded velocity the joint can no longer stop before its limit'
    VELOCITY = 'a commanded velocity is above its limit'
    ACCELERATION = 'the commanded velocity changes too fast'
    JERK = 'the commanded acceleration changes too fast'


# Words of ours, as KUKA's are not public.
KUKA_NAMES: Mapping[Reflex, str] = {
    Reflex.TIMING: 'timing',
    Reflex.START_POSE: 'interpolation error',
    Reflex.POSITION: 'position limit',
    Reflex.BRAKING: 'position limit',
    Reflex.VELOCITY: 'velocity limit',
    Reflex.ACCELERATION: 'protective stop',
    Reflex.JERK: 'protective stop',
}


_Check = tuple[Reflex, np.ndarray, Callable[[int], str]]
"""A cause of a stop, whether each joint is fine (n,), and what to say of one that is not."""


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
        2e-4, 'allowed excess: seconds at twice the acceleration limit [s]', 0.0, 0.1
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
        limits: Limits of the joints.
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
        """Reset: the next command follows a standstill."""
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
        for reflex, fine, describe in self._checks(position, velocity):
            if not fine.all():
                j = int(np.argmin(fine))  # the first joint that is not fine
                name = self.limits.joint_names[j]
                return f'{self._names[reflex]}: {name} commanded {describe(j)}'
        return ''

    def _checks(self, position: np.ndarray, velocity: np.ndarray) -> Iterator[_Check]:
        """The causes of a stop, one after the other; arguments as of violation()."""
        change = np.abs(velocity - self._velocities[0]) / (self._cycles * self.period)  # (n,)
        acceleration = (velocity - self._velocities[-1]) / self.period  # (n,)
        jerk = np.abs(acceleration - self._acceleration) / self.period  # (n,)
        self._velocities.append(velocity)
        self._acceleration = acceleration
        limits = self.limits

        lower = self._lower
        upper = self._upper
        yield (
            Reflex.POSITION,
            (lower - _ROUNDING <= position) & (position <= upper + _ROUNDING),
            lambda j: f'{position[j]:.4g} rad, allowed {lower[j]:.4g} to {upper[j]:.4g}',
        )
        if self._velocity_stops:
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
                f'{change[j]:.3g} rad/s^2 over {1e3 * self._cycles * self.period:g} ms, '
                f'allowed {limits.acceleration[j]:.3g}'
            ),
        )
        yield (
            Reflex.JERK,
            jerk <= self._jerk_limit,
            lambda j: f'{jerk[j]:.3g} rad/s^3, allowed {self._jerk_limit:.3g}',
        )
