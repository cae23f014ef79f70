"""Timing of a client: statistics over the last packets, the resulting quality, and counts."""

import math
from collections import deque
from dataclasses import dataclass

from redres_ros.fake_robot.robot_clock import NANOSECONDS
from redres_ros.types import Cycles, Seconds

WINDOW = 100  # packets


@dataclass(frozen=True)
class Statistics:
    """The five figures that FRI reports, over the last WINDOW packets."""

    response_rate: float = 0.0  # fraction of cycles in which a command arrived, late or not
    latency: Seconds = 0.0  # mean time from a state to its command
    jitter: Seconds = 0.0  # standard deviation of that time
    miss_rate: float = 0.0  # fraction of cycles without a command in time
    miss_count: int = 0  # cycles without a command in time since the start


@dataclass
class Counts:
    """Numbers of cycles by their outcome, since the start. The session counts."""

    cycles: int = 0  # in_time + late + missed
    in_time: int = 0
    late: int = 0  # their command came late
    missed: int = 0  # no command came
    longest_run: int = 0  # most cycles in a row without a command in time
    bridged: int = 0  # in command mode, whose command was extrapolated
    refused: int = 0  # messages that were no valid command


@dataclass(frozen=True)
class _Threshold:
    """Bounds on the statistics. Figures of ours, since KUKA's are not public."""

    response_rate: float  # at least
    latency: float  # at most [cycles]
    jitter: float  # at most [cycles]
    miss_rate: float  # at most


# by the number of the quality; the worst one has none
_THRESHOLDS = {
    3: _Threshold(response_rate=0.95, latency=1.0, jitter=1.0, miss_rate=0.05),
    2: _Threshold(response_rate=0.85, latency=2.0, jitter=2.0, miss_rate=0.15),
    1: _Threshold(response_rate=0.60, latency=4.0, jitter=4.0, miss_rate=0.40),
}


class TimingMonitor:
    """Monitors the timing of one client, packet by packet.

    Attributes:
        age: Cycles by which the newest command is too old: they have to be bridged.
        quality: The best one whose threshold the statistics meet, 3, or else 2, 1, 0.
        at_fault: Which statistic keeps it from being better by one; empty for the best.
    """

    def __init__(self, period: Seconds) -> None:
        self._period = period
        self._latenesses: deque[Cycles | None] = deque(maxlen=WINDOW)
        self._latencies: deque[int] = deque(maxlen=WINDOW)  # [ns]: their sums are exact
        self._run: Cycles = 0
        self.age: Cycles = 0
        self.counts = Counts()
        self.statistics = Statistics()
        self.quality = 0
        self.at_fault = 'response_rate'

    def record(self, lateness: Cycles | None, latency: Seconds) -> None:
        """Enter one cycle, by the lateness of its command, 0: in time, None: no command; and the
        time from the state to the command.
        """
        counts = self.counts
        counts.cycles += 1
        self._latenesses.append(lateness)
        if lateness is None:
            counts.missed += 1
            self.age += 1
        else:
            self._latencies.append(round(NANOSECONDS * latency))
            counts.in_time += lateness == 0
            counts.late += lateness > 0
            self.age = lateness
        self._run = 0 if lateness == 0 else self._run + 1
        counts.longest_run = max(counts.longest_run, self._run)
        self.statistics = self._statistics()
        self.at_fault = ''
        for quality, bounds in _THRESHOLDS.items():
            self.quality = quality
            breach = self._breach(bounds)
            if not breach:
                return
            self.at_fault = breach
        self.quality = 0

    @property
    def silent(self) -> bool:
        """Whether none of the last packets got a command."""
        return self.statistics.response_rate == 0.0

    @property
    def complaint(self) -> str:
        """The statistic at fault beside its bound, such as 'latency 9.1 ms, allowed 8 ms'."""
        name = self.at_fault
        if not name:
            return ''
        value = getattr(self.statistics, name)
        bound = getattr(_THRESHOLDS[self.quality + 1], name)
        if name in ('latency', 'jitter'):
            bound *= self._period
            return f'{name} {1e3 * value:.3g} ms, allowed {1e3 * bound:.3g} ms'
        expected = 'needed' if name == 'response_rate' else 'allowed'
        return f'{name.replace("_", " ")} {value:.0%}, {expected} {bound:.0%}'

    def _breach(self, bounds: _Threshold) -> str:
        """Name of the statistic that breaks its bound, empty if none does.

        Misses follow from commands that are lost or late: they are named last.
        """
        seen = self.statistics
        if seen.response_rate < bounds.response_rate:
            return 'response_rate'
        if seen.latency > bounds.latency * self._period:
            return 'latency'
        if seen.jitter > bounds.jitter * self._period:
            return 'jitter'
        return 'miss_rate' if seen.miss_rate > bounds.miss_rate else ''

    def _statistics(self) -> Statistics:
        packets = len(self._latenesses)
        n = max(len(self._latencies), 1)
        total = sum(self._latencies)
        variance = n * sum(latency * latency for latency in self._latencies) - total * total
        return Statistics(
            response_rate=(packets - self._latenesses.count(None)) / packets,
            latency=total / (n * NANOSECONDS),
            jitter=math.sqrt(variance) / (n * NANOSECONDS),  # variance: [ns^2], n^2 times
            miss_rate=(packets - self._latenesses.count(0)) / packets,
            miss_count=self.counts.late + self.counts.missed,
        )
