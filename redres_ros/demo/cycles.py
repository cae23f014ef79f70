"""Counts the robot's cycles by outcome, from its recording."""

from collections.abc import Iterable
from dataclasses import dataclass
from itertools import pairwise

from redres_ros.demo.log import COMMANDS, STATES, stamped
from redres_ros.graph.mcap_file import RecordedMessage

_NEXT = 2e9  # [ns] after the last state that counts, in which the next one comes
_QUIET = 0.95  # fraction of commands in time on a computer that does nothing else
_HELD_UP = 1.5  # cycles between two states, beyond which the robot's clock stood still


@dataclass(frozen=True)
class CycleCounts:
    """How many cycles of the robot had which outcome.

    Attributes:
        in_time: The command came within the cycle.
        waited_for: It came later, but before the next state: the robot's clock stood still.
        late: It came after the next state.
        missed: It never came.
        stood_still: Total time for which the clock stood still [s].
    """

    in_time: int
    waited_for: int
    late: int
    missed: int
    stood_still: float

    @property
    def total(self) -> int:
        """Number of all states."""
        return self.in_time + self.waited_for + self.late + self.missed

    @property
    def rows(self) -> list[tuple[str, ...]]:
        """Rows of a table."""
        kinds = {
            'commands in time': self.in_time,
            'late, and the clock waited': self.waited_for,
            'commands too late': self.late,
            'commands missing': self.missed,
        }
        total = max(self.total, 1)
        rows: list[tuple[str, ...]] = [
            ('cycles of the robot',),
            ('total', f'{self.total}; the simulated clock paused for {self.stood_still:.3f} s'),
        ]
        rows += [(name, f'{count} ({count / total:.2%})') for name, count in kinds.items()]
        if self.in_time < _QUIET * total:
            rows.append(('why', 'this computer was busy; no motion is lost while the clock pauses'))
        return rows


def count_cycles(
    messages: Iterable[RecordedMessage], period: float, stamps: tuple[int, int]
) -> CycleCounts:
    """How many commands came in time, late, or not at all.

    Args:
        messages: Messages of the robot's recording.
        period: Period of its states [s]; infinite in lock-step, where there is no clock.
        stamps: Stamps of the first and the last state that count [ns].
    """
    sent: dict[int, int] = {}
    returned: dict[int, int] = {}
    for stamp, message in stamped(messages, stamps[1] + _NEXT):
        if message.topic == STATES:
            sent.setdefault(stamp, message.time)
        elif message.topic == COMMANDS and message.is_received:
            returned.setdefault(stamp, message.time)
    order = [stamp for stamp in sorted(sent) if stamps[0] <= stamp <= stamps[1]]
    after = dict(pairwise(sorted(sent)))
    counts = dict.fromkeys(('in_time', 'waited_for', 'late', 'missed'), 0)
    stood_still = 0.0
    for stamp in order:
        cycle = period
        if stamp in after:
            cycle = (sent[after[stamp]] - sent[stamp]) / 1e9
        if cycle > _HELD_UP * period:
            stood_still += cycle - period
        latency = (returned[stamp] - sent[stamp]) / 1e9 if stamp in returned else None
        counts[_kind(latency, period, cycle)] += 1
    return CycleCounts(**counts, stood_still=stood_still)


def _kind(latency: float | None, period: float, cycle: float) -> str:
    """The outcome of a cycle of this length [s]; the latency [s] is None without a command."""
    if latency is None:
        return 'missed'
    if latency > cycle:
        return 'late'
    return 'in_time' if latency <= period else 'waited_for'
