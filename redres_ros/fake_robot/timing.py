"""Timing of a client: statistics over the last packets, the resulting quality, counts since the
start.
"""

import math
from collections import deque
from collections.abc import Mapping
from dataclasses import dataclass
from enum import IntEnum
from typing import NamedTuple

from redres_ros.fake_robot.quality import Statistics, Threshold
from redres_ros.fake_robot.robot_clock import NANOSECONDS

WINDOW = 100  # packets

_HOUR = 3600.0  # [s] a longer latency, or one that is no number, counts as this


@dataclass(frozen=True)
class Counts:
    """Counts of cycles by their outcome, since the start.

    Attributes:
        cycles: in_time + late + missed.
        in_time: Commands in time.
        late: Commands that came late.
        missed: No command came.
        longest_run: Most cycles in a row without a command in time.
        bridged: Cycles in command mode whose command was extrapolated.
        refused: Messages that were no valid command.
    """

    cycles: int = 0
    in_time: int = 0
    late: int = 0
    missed: int = 0
    longest_run: int = 0
    bridged: int = 0
    refused: int = 0


class TimingMonitor:
    """Monitors the timing of one client, packet by packet.

    Recording only counts; the figures are computed when they are asked for.

    Args:
        period: The cycle [s].
        thresholds: Thresholds of every quality but the worst, best first.
    """

    def __init__(self, period: float, thresholds: Mapping[IntEnum, Threshold]) -> None:
        self._thresholds = {
            quality: threshold.seconds(period) for quality, threshold in thresholds.items()
        }
        self._worst = min(type(next(iter(thresholds))))
        self._latenesses: deque[int | None] = deque([None] * WINDOW)  # of the last packets
        self._latencies = _Latencies()
        self._responses = 0
        self._newly_in_time = 0  # among the last packets
        self._age = 0
        self._run = 0
        self._longest_run = 0
        self._in_time = 0
        self._late = 0
        self._missed = 0
        self._verdict: _Verdict | None = None  # on the packets so far; None: not asked for yet

    def record(self, lateness: int | None, latency: float) -> None:
        """Enter one cycle.

        Args:
            lateness: Lateness of its command [cycles]; 0: in time, None: no command.
            latency: Time from the state to its command [s].
        """
        self._enter(lateness)
        if lateness is None:
            self._missed += 1
            self._age += 1
        else:
            self._latencies.append(latency)
            self._in_time += lateness == 0
            self._late += lateness > 0
            self._age = lateness
        self._run = 0 if lateness == 0 else self._run + 1
        self._longest_run = max(self._longest_run, self._run)
        self._verdict = None

    @property
    def age(self) -> int:
        """Cycles by which the newest command is too old: they have to be bridged."""
        return self._age

    @property
    def silent(self) -> bool:
        """Whether none of the last WINDOW packets got a command."""
        return self._responses == 0

    @property
    def statistics(self) -> Statistics:
        """The five figures as they stand."""
        return Statistics(*self._judge().figures, miss_count=self._late + self._missed)

    @property
    def quality(self) -> IntEnum:
        """The best quality whose threshold the statistics meet; before any packet the worst."""
        return self._judge().quality

    @property
    def at_fault(self) -> str:
        """Which statistic keeps the quality from being the next better one; empty for the best."""
        return self._judge().at_fault

    @property
    def complaint(self) -> str:
        """The same in words, with the figure and what the next better quality asks for."""
        _, quality, at_fault = self._judge()
        if not at_fault:
            return ''
        return self._thresholds[type(quality)(quality + 1)].describe(
            at_fault, getattr(self.statistics, at_fault)
        )

    def counts(self, bridged: int, refused: int) -> Counts:
        """Counts of cycles by their outcome, so far.

        Args:
            bridged: Cycles that were bridged, which the session knows.
            refused: Commands that were refused, likewise.
        """
        cycles = self._in_time + self._late + self._missed
        return Counts(
            cycles, self._in_time, self._late, self._missed, self._longest_run, bridged, refused
        )

    def _enter(self, lateness: int | None) -> None:
        oldest = self._latenesses.popleft()
        self._latenesses.append(lateness)
        self._responses += (lateness is not None) - (oldest is not None)
        self._newly_in_time += (lateness == 0) - (oldest == 0)

    def _judge(self) -> '_Verdict':
        if self._verdict is None:
            self._verdict = self._find()
        return self._verdict

    def _find(self) -> '_Verdict':
        """The best quality first, as it is the usual one."""
        figures = self._figures()
        at_fault = ''
        for quality, threshold in self._thresholds.items():
            breach = threshold.breach(*figures)
            if not breach:
                return _Verdict(figures, quality, at_fault)
            at_fault = breach
        return _Verdict(figures, self._worst, at_fault)

    def _figures(self) -> tuple[float, float, float, float]:
        """Response rate, latency [s], jitter [s] and miss rate."""
        packets = min(self._in_time + self._late + self._missed, WINDOW)
        if not packets:
            return 0.0, 0.0, 0.0, 0.0
        return (
            self._responses / packets,
            *self._latencies.mean_and_deviation(),
            (packets - self._newly_in_time) / packets,
        )


class _Verdict(NamedTuple):
    """The verdict on the packets so far."""

    figures: tuple[float, float, float, float]
    quality: IntEnum
    at_fault: str


class _Latencies:
    """Mean and standard deviation of the last WINDOW latencies, from running sums of whole
    nanoseconds: these are exact.
    """

    def __init__(self) -> None:
        self._last: deque[int] = deque()  # [ns]
        self._sum = 0
        self._sum_of_squares = 0  # [ns], [ns^2]

    def append(self, latency: float) -> None:
        """Enter a latency [s]; beyond WINDOW the oldest is dropped."""
        if not abs(latency) <= _HOUR:
            latency = _HOUR
        newest = round(NANOSECONDS * latency)
        oldest = self._last.popleft() if len(self._last) == WINDOW else 0
        self._last.append(newest)
        self._sum += newest - oldest
        self._sum_of_squares += newest * newest - oldest * oldest

    def mean_and_deviation(self) -> tuple[float, float]:
        """Both in [s]; 0 before the first."""
        n = max(len(self._last), 1)
        variance = n * self._sum_of_squares - self._sum * self._sum  # [ns^2], n^2 times
        return self._sum / (n * NANOSECONDS), math.sqrt(variance) / (n * NANOSECONDS)
