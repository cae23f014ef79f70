"""Times of interleaved calls, so that a slow moment of the machine affects all alike, and of round
trips from states to commands.
"""

import gc
import random
import time
from collections.abc import Callable, Hashable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from typing import TypeVar

import numpy as np

K = TypeVar('K', bound=Hashable)

BLOCK = 10  # calls of one candidate before it is the next one's turn
# calls of a block that are not counted: the caches still hold the candidate before
COLD = 2

_QUANTILES = {'median_us': 0.5, 'p99_us': 0.99, 'p99_9_us': 0.999, 'max_us': 1.0}


@dataclass(frozen=True)
class Times:
    """Samples (N,) [s] of one candidate."""

    samples: np.ndarray

    @property
    def median(self) -> float:
        """[s]; NaN without samples."""
        return self.quantile(0.5)

    @property
    def p99(self) -> float:
        """[s]; NaN without samples."""
        return self.quantile(0.99)

    def quantile(self, fraction: float) -> float:
        """The smallest sample that this fraction does not exceed [s]; NaN without samples."""
        if not len(self.samples):
            return float('nan')
        return float(np.quantile(self.samples, fraction, method='higher'))

    def figures(self) -> dict[str, float]:
        """For the file of results, in microseconds."""
        return {
            'median_us': 1e6 * self.median,
            'p99_us': 1e6 * self.p99,
            'samples': len(self.samples),
        }


@dataclass(frozen=True)
class RoundTrips:
    """The round trips of N states, one every period.

    Attributes:
        period: [s].
        latencies: From a state's way out to its command's arrival, (N,) [s]; infinite where none
            came.
        skipped: Cycles in which the robot itself was held up and sent nothing.
        processors: Fraction of a core that each process took meanwhile, by name.
    """

    period: float
    latencies: np.ndarray
    skipped: int
    processors: Mapping[str, float]

    @classmethod
    def from_times(
        cls,
        period: float,
        sent: Sequence[float],
        returned: Sequence[float],
        processors: Mapping[str, float],
    ) -> 'RoundTrips':
        """From the times at which states were sent, and those of their commands.

        Args:
            period: At which states should go out [s].
            sent: Instants in their order [s].
            returned: When the commands for the same states came [s]; infinite: never.
            processors: Fraction of a core by name.
        """
        due = round((sent[-1] - sent[0]) / period) + 1 if len(sent) else 0
        latencies = np.array(returned) - np.array(sent)
        return cls(period, latencies, max(due - len(sent), 0), processors)

    @classmethod
    def joined(cls, parts: Sequence['RoundTrips']) -> 'RoundTrips':
        """Merges repetitions; at least one, all of one period."""
        latencies = np.concatenate([part.latencies for part in parts])
        counts = [len(part.latencies) for part in parts]
        processors = {}
        for name in parts[0].processors:
            fractions = [part.processors[name] for part in parts]
            processors[name] = float(np.average(fractions, weights=counts))
        skipped = sum(part.skipped for part in parts)
        return cls(parts[0].period, latencies, skipped, processors)

    @property
    def times(self) -> Times:
        """Of the commands that came."""
        return Times(self.latencies[np.isfinite(self.latencies)])

    @property
    def in_cycle(self) -> float:
        """Fraction of the states whose command came within their cycle; NaN if none went out."""
        return _fraction(self.latencies <= self.period)

    @property
    def lost(self) -> float:
        """Fraction of the states for which no command came; NaN if none went out."""
        return _fraction(~np.isfinite(self.latencies))

    def figures(self) -> dict[str, object]:
        """For the file of results."""
        processors = {name: 100.0 * fraction for name, fraction in self.processors.items()}
        return {
            **{name: 1e6 * self.times.quantile(fraction) for name, fraction in _QUANTILES.items()},
            'in_cycle_percent': 100.0 * self.in_cycle,
            'lost_percent': 100.0 * self.lost,
            'states': len(self.latencies),
            'cycles_skipped': self.skipped,
            'processor_percent_of_a_core': processors,
        }


def measure(
    calls: Mapping[K, Callable[[int], object]],
    rounds: int,
    progress: Callable[[float], None] | None = None,
) -> dict[K, Times]:
    """The times of the calls, block by block in turn.

    The order changes every round, so that no call always finds the caches as the same other one
    left them. A first round is not counted.

    Args:
        calls: By name. Each gets the number of its turn, 0, 1, 2, ..., to pick its input by.
        rounds: Blocks of each call.
        progress: Called with the fraction done, 0 to 1.
    """
    samples: dict[K, list[int]] = {name: [] for name in calls}
    order = list(calls.items())
    shuffle = random.Random(0).shuffle
    with _undisturbed():
        for turn in range(-1, rounds):
            shuffle(order)
            for name, call in order:
                times = _block(call, max(turn, 0) * BLOCK)
                if turn >= 0:
                    samples[name] += times[COLD:]
            if progress:
                progress((turn + 1) / rounds)
    return {
        name: Times(1e-9 * np.array(times, dtype=np.float64)) for name, times in samples.items()
    }


def _block(call: Callable[[int], object], first: int) -> list[int]:
    """Times of a block of calls [ns]."""
    clock = time.perf_counter_ns
    times = []
    for number in range(first, first + BLOCK):
        begun = clock()
        call(number)
        times.append(clock() - begun)
    return times


@contextmanager
def _undisturbed() -> Iterator[None]:
    """No garbage collection: it would be charged to the candidate that runs."""
    gc.collect()
    gc.disable()
    try:
        yield
    finally:
        gc.enable()


def _fraction(which: np.ndarray) -> float:
    return float(np.mean(which)) if len(which) else float('nan')
