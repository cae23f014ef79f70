"""Whether the robot takes commands, by its session state."""

from redres_ros.loop.cycle_counter import NANOSECONDS
from redres_ros.types import Nanoseconds

# Session states in which a robot takes commands: of an LWR, an iiwa and a Franka arm.
COMMANDING = ('CMD', 'COMMANDING_ACTIVE', 'MOVE')

_PATIENCE = 5 * NANOSECONDS  # for a new robot's session state; DDS may take 3 s


class RobotSession:
    """The session state of the robot. A robot without a session takes commands.

    Args:
        lockstep: Then the first command begins command mode, so the tick in which the news of that
            arrives must not matter.
    """

    def __init__(self, lockstep: bool) -> None:
        self.is_connected = True  # whether commands reach it at all
        self._commanding = True
        self._undecided = lockstep  # until command mode has begun
        self._is_known = False
        self._awaited_until = 0  # stamp [ns] until which a new robot may publish it

    def enter(self, state: str) -> None:
        """Record the name of a session state."""
        self._is_known = True
        self._awaited_until = 0
        self._undecided = self._undecided and state not in COMMANDING
        self._commanding = state in COMMANDING or self._undecided

    def begin(self, stamp: Nanoseconds) -> None:
        """Expect another robot from a stamp on; the state of the last one does not hold."""
        if self._is_known:
            self._awaited_until = stamp + _PATIENCE

    def commanding_at(self, stamp: Nanoseconds) -> bool:
        """Whether the robot takes commands at a stamp."""
        return self.is_connected and self._commanding and stamp >= self._awaited_until
