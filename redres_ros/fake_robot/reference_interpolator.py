"""The reference of the arm's servos: it follows the commands, or brakes, and never jumps."""

import numpy as np

from redres_ros.robots.joint_limits import JointLimits

# fraction of the acceleration limit that closes a lag; the rest is left to the command itself
CATCH_UP = 0.5


class ReferenceInterpolator:
    """Advances the reference of one arm, cycle by cycle.

    The reference is the command, bit for bit, as long as the command keeps the velocity limits. A
    faster one is followed as fast as they allow; the lag is then closed without overshoot. Position
    limits are kept too, from wherever the arm stands.

    Args:
        limits: Of the joints.
        period: The cycle [s].
        q: Where the arm stands still, (n,) [rad].
    """

    def __init__(self, limits: JointLimits, period: float, q: np.ndarray) -> None:
        self._limits = limits
        self._max_step = limits.velocity * period  # (n,) [rad] in one cycle
        # (n,) [rad] change of the step from cycle to cycle; if accelerations are not limited, by
        # velocities alone
        self._max_change = np.minimum(limits.acceleration * period**2, 2.0 * self._max_step)
        self._reference = np.array(q, dtype=np.float64)  # (n,)
        self._step = np.zeros_like(self._reference)  # (n,) last move of the reference
        self.begin(self._reference)

    @property
    def reference(self) -> np.ndarray:
        """Reference in force, (n,) [rad]."""
        return self._reference.copy()

    @property
    def at_rest(self) -> bool:
        """Whether the reference stands still."""
        return not self._step.any()

    def begin(self, command: np.ndarray) -> None:
        """Follow constant commands at `command` (n,) [rad]; the distance to it is a lag."""
        self._lag = command - self._reference  # (n,)
        self._closing = np.zeros_like(self._lag)  # (n,) part of the lag that the last cycle closed

    def follow(self, command: np.ndarray, step: np.ndarray) -> None:
        """Move on to a command.

        Args:
            command: Where to, (n,) [rad].
            step: How far that is beyond the command before, (n,) [rad].
        """
        change = CATCH_UP * self._max_change  # (n,)
        # A lag d is closed at sqrt(a d), a braking curve at half of the acceleration a that the
        # ramp allows. So it is not overshot.
        wanted = np.copysign(
            np.minimum(np.abs(self._lag), np.sqrt(change * np.abs(self._lag))), self._lag
        )
        closing = self._closing + _bounded(wanted - self._closing, change)
        self._move(command - (self._lag - closing))
        self._closing = self._step - step
        self._lag = command - self._reference

    def brake(self) -> None:
        """Decelerate to rest, each joint as fast as its acceleration limit allows."""
        self._move(self._reference + (self._step - _bounded(self._step, self._max_change)))

    def _move(self, target: np.ndarray) -> None:
        """Go to the target or as near as the limits allow; an arm beyond a position limit can only
        come back.
        """
        last = self._reference
        limits = self._limits
        upper = np.minimum(np.maximum(limits.upper, last), last + self._max_step)
        lower = np.maximum(np.minimum(limits.lower, last), last - self._max_step)
        self._reference = np.maximum(lower, np.minimum(target, upper))
        self._step = self._reference - last


def _bounded(value: np.ndarray, bound: np.ndarray) -> np.ndarray:
    """The value brought within -bound and bound; several times as fast as np.clip for so few
    joints.
    """
    return np.minimum(np.maximum(value, -bound), bound)
