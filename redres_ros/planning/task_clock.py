"""The time of a task, which advances with the arm, and the speed of its path: braked early where
limits act, and resumed slowly.
"""

import math

from redres_ros.types import Cycles, Seconds

# [s] for which nothing may be executed, or received, until the controller counts as not following
_PATIENCE = 0.1

FALL = 2.0  # [1/s] at which the speed falls, at most
RESUME = 4.0  # [1/s^2] at which its rate rises once limits no longer act

_ROUNDING = 1e-9  # of the task scaling


class PathSpeed:
    """The speed at which a path is asked for, as a fraction of the nominal one.

    If limits leave a fraction s < 1 of the task velocity, the largest s in every tick uses up the
    null space: joints reverse at full acceleration for the sake of the next moment. A path that is
    asked for at the speed last executed, and gets faster again with a limited acceleration, leaves
    the law a null space in which joints calm down. A sudden s, of a few ticks, changes little.

    An initial fraction below 1 rises at once: no limit has acted.
    """

    def __init__(self, fraction: float = 1.0) -> None:
        self.fraction = fraction
        self._rate = FALL if self.fraction < 1.0 else 0.0  # [1/s] at which it rises

    def advance(self, s: float, seconds: Seconds) -> None:
        """Advance by some time in which the fraction s of the task velocity was executed."""
        is_limited = s < 1.0 - _ROUNDING
        if self.fraction == 1.0 and not is_limited:
            return
        if is_limited:
            self._rate = 0.0
            self.fraction = max(s * self.fraction, self.fraction - FALL * seconds, 0.0)
        else:
            self._rate += RESUME * seconds
            self.fraction = min(self.fraction + self._rate * seconds, 1.0)
        if self.fraction == 1.0:
            self._rate = 0.0


class TaskClock:
    """The time t of a task [s], which advances at the rate s of the controller's task scaling: the
    path is kept. While the controller holds or is silent, the time stands still.

    In lock-step the controller follows until it says otherwise, and need not say so.
    """

    def __init__(self, T: Seconds, lockstep: bool) -> None:
        self.t = 0.0
        self._T = T
        self.speed = PathSpeed()
        self._limit = max(round(_PATIENCE / T), 1)  # cycles
        self._lockstep = lockstep
        self._scaling = 1.0 if lockstep else 0.0
        self._silent = 0  # cycles since the last message of the controller
        self._standing = 0 if lockstep else self._limit  # cycles in which nothing was executed

    @property
    def follows(self) -> bool:
        return self._standing < self._limit

    @property
    def is_receiving(self) -> bool:
        """Whether a scaling factor came lately."""
        return self._silent <= self._limit

    def set_scaling(self, scaling: float) -> None:
        """Record the fraction of the task velocity that is executed; NaN is no message."""
        if not math.isnan(scaling):
            self._scaling = min(max(scaling, 0.0), 1.0)
            self._silent = 0

    def begin(self) -> None:
        """The task begins, from rest and at its nominal speed."""
        self.t = 0.0
        self.speed = PathSpeed()

    def resume(self) -> None:
        """The task resumes from rest."""
        self.speed = PathSpeed(0.0)

    def advance(self, cycles: Cycles) -> None:
        """Some cycles of the robot have passed; 0 for a new robot. It, and more cycles than the
        controller would go on without a task velocity, make the controller report again.
        """
        self._silent += cycles
        if (cycles == 0 or not self.is_receiving) and not self._lockstep:
            self._scaling = 0.0
            self._standing = self._limit
        self._standing = 0 if self._scaling > 0.0 else self._standing + cycles
        if self.follows:
            self.t += self.speed.fraction * self._scaling * cycles * self._T
            self.speed.advance(self._scaling, cycles * self._T)
