"""The robot's time: stamps one period apart, and a schedule that can pause."""

import time
from collections.abc import Callable

from redres_ros.types import Nanoseconds, Seconds

NANOSECONDS = 1_000_000_000

_KEPT = 256  # states whose time of sending is kept, to assign commands to them


class RobotClock:
    """Stamps the states of ticks, and keeps to the computer's monotonic clock, which nobody sets.

    While its process is held up, or it waits for a client, the clock stands still: the next stamp
    is one period after the last, and all that follow are as much behind the computer's clock.
    """

    def __init__(self, epoch: Nanoseconds, period: Nanoseconds) -> None:
        """A clock with the stamp `epoch` at tick 0."""
        self.period = period
        self.stood_still: Seconds = 0.0  # since the start; latencies do not count it
        self._epoch = epoch
        self._due = time.monotonic()  # when the next tick is to come [s]
        # Tick and time [s] of the last states by stamp, oldest first, without the time stood still
        self._sent: dict[Nanoseconds, tuple[int, Seconds]] = {}

    def send(self, tick: int) -> Nanoseconds:
        """Stamp of a tick whose state goes out now."""
        stamp = self._epoch + tick * self.period
        self._sent[stamp] = (tick, time.monotonic() - self.stood_still)
        if len(self._sent) > _KEPT:
            del self._sent[next(iter(self._sent))]
        return stamp

    def tick(self, stamp: Nanoseconds) -> int | None:
        """Tick of a state that went out, by its stamp; None if none of the last has it."""
        return self._sent[stamp][0] if stamp in self._sent else None

    def latency(self, stamp: Nanoseconds, arrived: Seconds) -> Seconds:
        """Time from a state to its command, which arrived at an instant of the monotonic clock,
        without that in which the clock stood still; of a command that came before that, too little.
        """
        _, sent_at = self._sent[stamp]
        return max(arrived - self.stood_still - sent_at, 0.0)

    def restart(self) -> None:
        """The next tick is due one period from now."""
        self._due = time.monotonic()

    def wait(self, sleep: Callable[[Seconds], object] = time.sleep) -> None:
        """Sleep until the next tick is due; stand still for a delay of more than a period."""
        period = self.period / NANOSECONDS
        self._due += period
        late = time.monotonic() - self._due
        sleep(max(-late, 0.0))
        if late > period:
            self.stand_still()

    def stand_still(self) -> None:
        """Between the instant at which the tick was due and now the clock has stood still."""
        seconds = time.monotonic() - self._due
        self.stood_still += seconds
        self._due += seconds
