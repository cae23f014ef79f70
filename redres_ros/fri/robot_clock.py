"""The robot's time: stamps exactly one period apart, and a schedule that can stand still."""

import time
from collections.abc import Callable

import numpy as np

NANOSECONDS = 1_000_000_000

_REMEMBERED = 256  # ticks whose time of sending is kept, to know the latency of their answers


class RobotClock:
    """Ticks of `period` [ns], the first one stamped `epoch` [ns], kept to on the monotonic clock,
    which nobody sets.

    stood_still [s]: how long the clock did not go on. Latencies do not count it.
    """

    def __init__(self, epoch: int, period: int) -> None:
        self.period = period
        self.stood_still = 0.0
        self._epoch = epoch
        self._due = time.monotonic()
        self._sent = np.zeros(_REMEMBERED)  # [s]

    def stamp(self, tick: int) -> int:
        """Stamp of a tick [ns]."""
        return self._epoch + tick * self.period

    def tick(self, stamp: int) -> int | None:
        """Tick of a stamp [ns]; None for one between or before the ticks."""
        tick, rest = divmod(stamp - self._epoch, self.period)
        return None if rest or tick < 0 else tick

    def send(self, tick: int) -> None:
        """The state of a tick goes out now."""
        self._sent[tick % _REMEMBERED] = time.monotonic() - self.stood_still

    def latency(self, tick: int, arrived: float) -> float:
        """From sending the state of a tick to an instant of the monotonic clock, without what this
        one stood still [s].

        For an answer that came before the clock stood still this is too little, but never below 0.
        """
        return max(arrived - self.stood_still - float(self._sent[tick % _REMEMBERED]), 0.0)

    def restart(self) -> None:
        """The next tick is due one period from now."""
        self._due = time.monotonic()

    def wait(self, sleep: Callable[[float], None] = time.sleep) -> None:
        """Sleep until the next tick is due; after being held up for more than a period go on from
        here, in no burst.
        """
        self._due += self.period / NANOSECONDS
        late = time.monotonic() - self._due
        sleep(max(-late, 0.0))
        if late > self.period / NANOSECONDS:
            self.stand_still()

    def stand_still(self) -> None:
        """Between the instant at which the tick was due and now the clock has stood still."""
        seconds = time.monotonic() - self._due
        self.stood_still += seconds
        self._due += seconds
