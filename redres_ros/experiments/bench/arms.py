"""Several arms on two cores: what was measured, and how many hold their rate."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from redres_ros.experiments.bench.exchange import Exchange
from redres_ros.experiments.bench.goals import Goal

ALL_IN_ONE, ONE_EACH, THREE_EACH = 'all arms in one process', 'a process an arm', 'three processes an arm'
HELD = 0.99  # share of the cycles in which a state goes out and is answered in time, of the worst arm


@dataclass(frozen=True)
class ArmsResult:
    """Exchanges at `rate` [Hz] of each arm, by way of composing them and number of arms."""

    rate: float
    exchanges: Mapping[str, Mapping[int, Sequence[Exchange]]]

    def held(self, way: str) -> int:
        """Largest number of arms of which every one holds the rate; 0 if not even one does."""
        return max((count for count, arms in self.exchanges[way].items() if _worst(arms) >= HELD), default=0)

    def goals(self) -> list[Goal]:
        """None were set."""
        return []

    def table(self) -> str:
        """One line a way, one column a number of arms: the worst arm's share of cycles kept."""
        counts = sorted({count for arms in self.exchanges.values() for count in arms})
        lines = [f"{f'worst arm, cycles kept at {self.rate:g} Hz, 2 cores':<40}"
                 + ''.join(f"{f'{count} arms':>10}" for count in counts) + f"{f'hold {HELD:.0%}':>12}"]
        for way, arms in self.exchanges.items():
            cells = ''.join(f'{_worst(arms[count]):10.2%}' if count in arms else f"{'-':>10}" for count in counts)
            lines.append(f'{way:<40}{cells}{self.held(way):12d}')
        return '\n'.join(lines)

    def figures(self) -> dict[str, object]:
        """For the file of results."""
        ways = {way: {f'{count} arms': [arm.figures() for arm in arms] for count, arms in counts.items()}
                for way, counts in self.exchanges.items()}
        return {'rate_hz': self.rate, **ways, 'arms_that_hold': {way: self.held(way) for way in self.exchanges}}


def _worst(arms: Sequence[Exchange]) -> float:
    return min(arm.kept for arm in arms)
