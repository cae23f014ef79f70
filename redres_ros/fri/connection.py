"""How well a client answers: statistics over the last packets, the quality they add up to, counts since the start."""

import math
from collections import deque
from dataclasses import dataclass
from enum import IntEnum

WINDOW = 100  # packets


class Quality(IntEnum):
    """Quality of a connection; commanding is allowed in all but the first."""

    UNACCEPTABLE = 0
    BAD = 1
    OK = 2
    PERFECT = 3


@dataclass(frozen=True)
class Statistics:
    """The five figures that FRI reports, over the last WINDOW packets.

    answer_rate: share of cycles in which an answer arrived, late or not; miss_rate: share without an answer in time;
    latency: mean time from a state to its answer [s], and jitter its standard deviation [s], both over the last WINDOW
    answers; miss_count: cycles without an answer in time since the start.
    """

    answer_rate: float = 0.0
    latency: float = 0.0
    jitter: float = 0.0
    miss_rate: float = 0.0
    miss_count: int = 0


@dataclass(frozen=True)
class Threshold:
    """What a quality asks for: bounds on shares of packets, and on times in units of the cycle."""

    answer_rate: float
    miss_rate: float
    latency: float
    jitter: float

    def holds(self, statistics: Statistics, period: float) -> bool:
        """Whether the statistics keep every bound; NaN keeps none."""
        return (statistics.answer_rate >= self.answer_rate and statistics.miss_rate <= self.miss_rate
                and statistics.latency <= self.latency * period and statistics.jitter <= self.jitter * period)


THRESHOLDS = {  # ours: KUKA's are not public; best first
    Quality.PERFECT: Threshold(answer_rate=0.95, miss_rate=0.05, latency=1.0, jitter=1.0),
    Quality.OK: Threshold(answer_rate=0.85, miss_rate=0.15, latency=2.0, jitter=2.0),
    Quality.BAD: Threshold(answer_rate=0.60, miss_rate=0.40, latency=4.0, jitter=4.0),
}


@dataclass(frozen=True)
class Counts:
    """What became of every cycle since the start.

    cycles = in_time + late + missed; longest_run: most cycles in a row without an answer in time; bridged: cycles in
    command mode whose command was extrapolated; refused: answers that were no valid command, each of them also a miss.
    """

    cycles: int = 0
    in_time: int = 0
    late: int = 0
    missed: int = 0
    longest_run: int = 0
    bridged: int = 0
    refused: int = 0


class Connection:
    """Keeps the books on one client, packet by packet, for a cycle of `period` [s]."""

    def __init__(self, period: float) -> None:
        self._period = period
        self._latenesses: deque[int | None] = deque(maxlen=WINDOW)  # of packets
        self._latencies: deque[float] = deque(maxlen=WINDOW)  # of answers
        self._age, self._run, self._longest_run = 0, 0, 0
        self._in_time, self._late, self._missed = 0, 0, 0
        self._statistics, self._quality = Statistics(), Quality.UNACCEPTABLE

    def record(self, lateness: int | None, latency: float) -> None:
        """Enter one cycle: its answer's lateness in cycles (0: in time; None: no answer) and latency [s]."""
        self._latenesses.append(lateness)
        if lateness is not None:
            self._latencies.append(latency)
        self._in_time += lateness == 0
        self._late += lateness is not None and lateness > 0
        self._missed += lateness is None
        self._age = self._age + 1 if lateness is None else lateness
        self._run = 0 if lateness == 0 else self._run + 1
        self._longest_run = max(self._longest_run, self._run)
        self._statistics = self._evaluate()
        self._quality = next((quality for quality, threshold in THRESHOLDS.items()
                              if threshold.holds(self._statistics, self._period)), Quality.UNACCEPTABLE)

    @property
    def age(self) -> int:
        """Cycles by which the newest answer is older than it should be: so many have to be bridged."""
        return self._age

    @property
    def statistics(self) -> Statistics:
        """The five figures as they stand."""
        return self._statistics

    @property
    def quality(self) -> Quality:
        """The best quality whose threshold the statistics meet; UNACCEPTABLE before the first packet."""
        return self._quality

    def counts(self, bridged: int, refused: int) -> Counts:
        """What became of every cycle so far; bridged and refused are known to others."""
        cycles = self._in_time + self._late + self._missed
        return Counts(cycles, self._in_time, self._late, self._missed, self._longest_run, bridged, refused)

    def _evaluate(self) -> Statistics:
        packets, answers = len(self._latenesses), len(self._latencies)
        in_time, silent = self._latenesses.count(0), self._latenesses.count(None)
        mean = sum(self._latencies) / max(answers, 1)
        jitter = math.dist(tuple(self._latencies), (mean,) * answers) / math.sqrt(max(answers, 1))
        return Statistics(answer_rate=(packets - silent) / packets, latency=mean, jitter=jitter,
                          miss_rate=(packets - in_time) / packets, miss_count=self._late + self._missed)
