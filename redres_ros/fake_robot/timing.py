"""Timing of a client: statistics over the last packets, the resulting quality, and counts."""

import math
from collections import Counter, deque

from redres_ros.fake_robot.robot_clock import NANOSECONDS
from redres_ros.types import Cycles, Seconds

WINDOW = 100  # packets

# Bounds on the statistics for the qualities 1, 2, 3; the worst one, 0, has none. Values of ours,
# since KUKA's are not public. Misses follow from commands that are lost or late: they come last.
_BOUNDS = {
    'response_rate': (0.60, 0.85, 0.95),  # at least; the others: at most
    'latency': (4.0, 2.0, 1.0),  # [cycles]
    'jitter': (4.0, 2.0, 1.0),  # [cycles]
    'miss_rate': (0.40, 0.15, 0.05),
}


class TimingMonitor:
    def __init__(self, period: Seconds) -> None:
        self._period = period
        self._latenesses: deque[Cycles | None] = deque(maxlen=WINDOW)
        self._latencies: deque[int] = deque(maxlen=WINDOW)  # [ns]: their sums are exact
        # by which the newest command is too old: they have to be bridged
        self.age: Cycles = 0
        # Cycles since the start by what became of their command; the session counts those bridged.
        self.counts = Counter({'in time': 0, 'late': 0, 'missed': 0, 'bridged': 0})
        # What FRI reports, over the last packets: the fraction of cycles in which a command
        # arrived, late or not; mean and standard deviation of the time from a state to its command
        # [s]; the fraction of cycles without a command in time
        self.statistics = dict.fromkeys(_BOUNDS, 0.0)
        self.quality = 0  # the best, up to 3, whose bounds the statistics meet
        self.at_fault = 'response_rate'  # keeps it from being better; empty for the best

    def record(self, lateness: Cycles | None, latency: Seconds) -> None:
        """Enter a cycle: the lateness of its command, 0: in time, None: none, and its latency."""
        self._latenesses.append(lateness)
        if lateness is None:
            self.counts['missed'] += 1
            self.age += 1
        else:
            self.counts['late' if lateness else 'in time'] += 1
            self._latencies.append(round(NANOSECONDS * latency))
            self.age = lateness
        self.statistics = self._statistics()
        qualities = {name: self._quality(name) for name in _BOUNDS}
        self.quality = min(qualities.values())
        self.at_fault = '' if self.quality == 3 else min(qualities, key=qualities.__getitem__)

    @property
    def complaint(self) -> str:
        """The statistic that is at fault beside its bound: 'latency 9.1 ms, allowed 8 ms'."""
        name = self.at_fault
        value = self.statistics[name]
        bound = self._bounds(name)[self.quality]
        if name in ('latency', 'jitter'):
            return f'{name} {1e3 * value:.3g} ms, allowed {1e3 * bound:.3g} ms'
        expected = 'needed' if name == 'response_rate' else 'allowed'
        return f'{name.replace("_", " ")} {value:.0%}, {expected} {bound:.0%}'

    def _bounds(self, name: str) -> tuple[float, ...]:
        unit = self._period if name in ('latency', 'jitter') else 1.0
        return tuple(unit * bound for bound in _BOUNDS[name])

    def _quality(self, name: str) -> int:
        """How many of its bounds a statistic keeps."""
        value = self.statistics[name]
        sign = -1.0 if name == 'response_rate' else 1.0
        return sum(sign * value <= sign * bound for bound in self._bounds(name))

    def _statistics(self) -> dict[str, float]:
        packets = len(self._latenesses)
        n = max(len(self._latencies), 1)
        total = sum(self._latencies)
        variance = n * sum(latency * latency for latency in self._latencies) - total * total
        return {
            'response_rate': (packets - self._latenesses.count(None)) / packets,
            'latency': total / (n * NANOSECONDS),
            'jitter': math.sqrt(variance) / (n * NANOSECONDS),  # variance: [ns^2], n^2 times
            'miss_rate': (packets - self._latenesses.count(0)) / packets,
        }
