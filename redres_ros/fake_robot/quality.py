"""Connection quality: its statistics, and the thresholds of each grade."""

from dataclasses import dataclass, replace
from enum import IntEnum


class Quality(IntEnum):
    """Quality of a connection as the LWR names it."""

    UNACCEPTABLE = 0
    BAD = 1
    OK = 2
    PERFECT = 3


class SunriseQuality(IntEnum):
    """Quality of a connection as Sunrise names it."""

    POOR = 0
    FAIR = 1
    GOOD = 2
    EXCELLENT = 3


class FciQuality(IntEnum):
    """Quality of a connection to a Franka arm, which reports the response rate; names are ours."""

    INSUFFICIENT = 0
    POOR = 1
    GOOD = 2
    EXCELLENT = 3


@dataclass(frozen=True)
class Statistics:
    """The five figures that FRI reports, over the last WINDOW packets.

    Attributes:
        response_rate: Fraction of cycles in which a command arrived, late or not.
        latency: Mean time from a state to its command, over the last WINDOW commands [s].
        jitter: Standard deviation of that time [s].
        miss_rate: Fraction of cycles without a command in time.
        miss_count: Cycles without a command in time since the start.
    """

    response_rate: float = 0.0
    latency: float = 0.0
    jitter: float = 0.0
    miss_rate: float = 0.0
    miss_count: int = 0


@dataclass(frozen=True)
class Threshold:
    """Thresholds of a quality: bounds on the statistics, times in units of the cycle."""

    response_rate: float
    miss_rate: float
    latency: float
    jitter: float

    def seconds(self, period: float) -> 'Threshold':
        """The same with times in seconds, for a cycle of `period` [s]."""
        return replace(self, latency=self.latency * period, jitter=self.jitter * period)

    def breach(self, response_rate: float, latency: float, jitter: float, miss_rate: float) -> str:
        """Name of the statistic that breaks its bound, empty if none does.

        NaN breaks every bound. Misses follow from commands that are lost or late, so they are named
        only if nothing else is at fault.

        Args:
            response_rate: As in Statistics, like all that follow.
            latency: Mean time to a command [s].
            jitter: Its standard deviation [s].
            miss_rate: Fraction of the cycles without a command.
        """
        if not response_rate >= self.response_rate:
            return 'response_rate'
        if not latency <= self.latency:
            return 'latency'
        if not jitter <= self.jitter:
            return 'jitter'
        return '' if miss_rate <= self.miss_rate else 'miss_rate'

    def describe(self, name: str, value: float) -> str:
        """A statistic beside its bound, in words: 'latency 9.1 ms, allowed 8 ms'.

        Args:
            name: Name of the statistic.
            value: What it is, times in [s].
        """
        bound = getattr(self, name)
        if name in ('latency', 'jitter'):
            return f'{name} {1e3 * value:.3g} ms, allowed {1e3 * bound:.3g} ms'
        asked = 'needed' if name == 'response_rate' else 'allowed'
        return f'{name.replace("_", " ")} {value:.0%}, {asked} {bound:.0%}'


def thresholds_of(qualities: type[IntEnum]) -> dict[IntEnum, Threshold]:
    """Thresholds of every quality but the worst, best first; figures of ours, since KUKA's are not
    public.
    """
    _, bad, ok, perfect = sorted(qualities)
    return {
        perfect: Threshold(response_rate=0.95, miss_rate=0.05, latency=1.0, jitter=1.0),
        ok: Threshold(response_rate=0.85, miss_rate=0.15, latency=2.0, jitter=2.0),
        bad: Threshold(response_rate=0.60, miss_rate=0.40, latency=4.0, jitter=4.0),
    }
