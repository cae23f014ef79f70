"""Round trips from states to commands: times, and how many were late or lost."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from redres_ros.bench.timing import Times
from redres_ros.demo.log import stamped
from redres_ros.graph.mcap_file import RecordedMessage

_QUANTILES = {'median_us': 0.5, 'p99_us': 0.99, 'p99_9_us': 0.999, 'max_us': 1.0}


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
    def from_messages(
        cls,
        period: float,
        messages: Iterable[RecordedMessage],
        window: tuple[float, float],
        processors: Mapping[str, float],
    ) -> 'RoundTrips':
        """From a recording of the robot.

        Args:
            period: At which states should go out [s].
            messages: The states that it published and the commands that it received.
            window: The instants between which states count, time of day [s].
            processors: Fraction of a core by name.
        """
        sent: dict[int, float] = {}
        returned: dict[int, float] = {}
        for stamp, message in stamped(messages):
            times = returned if message.is_received else sent
            times.setdefault(stamp, message.time / 1e9)
        counted = [stamp for stamp, at in sent.items() if window[0] <= at < window[1]]
        return cls.from_times(
            period,
            [sent[stamp] for stamp in counted],
            [returned.get(stamp, np.inf) for stamp in counted],
            processors,
        )

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


def _fraction(which: np.ndarray) -> float:
    return float(np.mean(which)) if len(which) else float('nan')
