"""Whether the robot takes commands, by its session state."""

from redres_ros.loop.cycle_counter import NANOSECONDS

# Session states in which a robot takes commands: of an LWR, an iiwa and a Franka arm.
COMMANDING = ('CMD', 'COMMANDING_ACTIVE', 'MOVE')

_PATIENCE = 5 * NANOSECONDS  # for a new robot's word on its session; DDS may take 3 s


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
        self._spoken = False
        self._silent_until = 0  # stamp [ns] until which a new robot may say it

    def enter(self, word: str) -> None:
        """Record the name of a session state."""
        self._spoken = True
        self._silent_until = 0
        self._undecided = self._undecided and word not in COMMANDING
        self._commanding = word in COMMANDING or self._undecided

    def begin(self, stamp: int) -> None:
        """Expect another robot from a stamp [ns] on; the word of the last one does not hold."""
        if self._spoken:
            self._silent_until = stamp + _PATIENCE

    def commanding_at(self, stamp: int) -> bool:
        """Whether the robot takes commands at a stamp [ns]."""
        return self.is_connected and self._commanding and stamp >= self._silent_until
