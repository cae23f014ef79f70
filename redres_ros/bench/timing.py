"""Times of interleaved calls, so that a slow moment of the machine affects all alike."""

import gc
import random
import time
from collections.abc import Callable, Hashable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from typing import TypeVar

import numpy as np

K = TypeVar('K', bound=Hashable)

BLOCK = 10  # calls of one candidate before it is the next one's turn
# calls of a block that are not counted: the caches still hold the candidate before
COLD = 2


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
