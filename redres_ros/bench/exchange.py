"""States that went out and answers that came back: how long that took, how many were late or lost."""

import time
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from redres_ros.bench.timing import Times

# [s] of /proc/<pid>/stat: Linux counts in hundredths for user space, whatever the kernel's HZ
_TICK = 1.0 / 100.0


@dataclass(frozen=True)
class Exchange:
    """What became of N states that went out at a rate of 1/period.

    latencies: (N,) from a state's way out to its answer's arrival [s]; infinite where none came.
    processors: share of a core that each process took meanwhile, by name. skipped: cycles in which
    the robot itself was held up and sent nothing.
    """

    period: float
    latencies: np.ndarray
    processors: Mapping[str, float]
    skipped: int = 0

    @classmethod
    def joined(cls, parts: Iterable['Exchange']) -> 'Exchange':
        """Repetitions of the same as one; at least one of them, all of one period."""
        parts = list(parts)
        latencies = np.concatenate([part.latencies for part in parts])
        names = parts[0].processors
        shares = {
            name: float(
                np.average(
                    [part.processors[name] for part in parts],
                    weights=[len(part.latencies) for part in parts],
                )
            )
            for name in names
        }
        return cls(parts[0].period, latencies, shares, sum(part.skipped for part in parts))

    @property
    def times(self) -> Times:
        """Of the answers that came."""
        return Times(self.latencies[np.isfinite(self.latencies)])

    @property
    def late(self) -> float:
        """Share of the states that were not answered within their cycle; NaN if none went out."""
        return float(np.mean(self.latencies > self.period)) if len(self.latencies) else float('nan')

    @property
    def lost(self) -> float:
        """Share of the states that were never answered, which are late as well."""
        return float(np.mean(~np.isfinite(self.latencies))) if len(self.latencies) else float('nan')

    @property
    def kept(self) -> float:
        """Share of all cycles, skipped ones included, whose state was answered within its cycle;
        NaN of none.
        """
        return (1.0 - self.late) * len(self.latencies) / max(len(self.latencies) + self.skipped, 1)

    def figures(self) -> dict[str, object]:
        """For the file of results."""
        times = self.times
        quantiles = {
            name: 1e6 * times.quantile(share)
            for name, share in (
                ('median_us', 0.5),
                ('p99_us', 0.99),
                ('p99_9_us', 0.999),
                ('max_us', 1.0),
            )
        }
        processors = {name: 100.0 * share for name, share in self.processors.items()}
        return {
            **quantiles,
            'answered_in_cycle_percent': 100.0 * (1.0 - self.late),
            'lost_percent': 100.0 * self.lost,
            'states': len(self.latencies),
            'cycles_skipped': self.skipped,
            'processor_percent_of_a_core': processors,
        }


class Stopwatch:
    """Notes when the states `first` ... `first + count - 1` go out and when the first answer to
    each comes back.
    """

    def __init__(self, first: int, count: int) -> None:
        self._first = first
        self._count = count
        self._out = np.full(count, np.inf)
        self._back = np.full(count, np.inf)  # [s]

    def out(self, tick: int, ago: float = 0.0) -> None:
        """The state of a tick goes out now, or went out some time ago [s]."""
        if 0 <= tick - self._first < self._count:
            self._out[tick - self._first] = time.perf_counter() - ago

    def back(self, tick: int) -> None:
        """The answer to the state of a tick is here."""
        place = tick - self._first
        if 0 <= place < self._count and self._back[place] == np.inf:
            self._back[place] = time.perf_counter()

    @property
    def latencies(self) -> np.ndarray:
        """Of the states that went out, (N,) [s]; infinite where no answer came."""
        sent = np.isfinite(self._out)
        return self._back[sent] - self._out[sent]

    def exchange(self, period: float, processors: Mapping[str, float]) -> Exchange:
        """All that was noted, for states that should have gone out every `period` [s]."""
        out = self._out[np.isfinite(self._out)]
        due = round((out[-1] - out[0]) / period) + 1 if len(out) else 0
        return Exchange(period, self.latencies, processors, max(due - len(out), 0))


class ProcessorMeter:
    """Share of a core that processes take, by name, from the moment when it is made."""

    def __init__(self, processes: Mapping[str, int]) -> None:
        self._processes = dict(processes)
        self._begun, self._before = time.perf_counter(), self._seconds()

    def shares(self) -> dict[str, float]:
        """Mean since then."""
        elapsed = time.perf_counter() - self._begun
        return {
            name: (after - self._before[name]) / elapsed for name, after in self._seconds().items()
        }

    def _seconds(self) -> dict[str, float]:
        return {name: processor_seconds(pid) for name, pid in self._processes.items()}


def processor_seconds(pid: int) -> float:
    """Processor time of a process so far, all its threads, in user space and the kernel [s]; NaN if
    it is gone.
    """
    try:
        fields = Path(f'/proc/{pid}/stat').read_text().rpartition(')')[2].split()
    except OSError:
        return float('nan')
    return (int(fields[11]) + int(fields[12])) * _TICK  # utime and stime, see proc(5)
