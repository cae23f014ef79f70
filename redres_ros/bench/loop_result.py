"""The loop over DDS at several rates: what was measured, as a table, and which goals it keeps."""

from collections.abc import Mapping
from dataclasses import dataclass

from redres_ros.bench.exchange import Exchange
from redres_ros.bench.goals import Goal

UDP = 'udp'
ECHO = 'echo'
INSIDE = 'inside'
CONTROLLER = 'controller'
WEIGHTED = 'weighted'
GRAPH = 'graph'
COMPOSED = 'composed'
WORDS = {
    UDP: 'bare UDP echo',
    ECHO: 'bare echo node',
    INSIDE: 'bare echo in one process',
    CONTROLLER: 'controller, minimum_acceleration',
    WEIGHTED: 'controller, dynamically_consistent',
    GRAPH: 'sim, planner, controller',
    COMPOSED: 'the same in one process',
}
NOMINAL = 500.0
FAST = 1000.0  # [Hz] rates that have goals of their own


@dataclass(frozen=True)
class LoopResult:
    """Exchanges by rate [Hz] and kind, the kinds being those of WORDS."""

    exchanges: Mapping[float, Mapping[str, Exchange]]

    def goals(self) -> list[Goal]:
        """Those of the rates that were measured."""
        return [goal for rate, kinds in self.exchanges.items() for goal in _goals(rate, kinds)]

    def table(self) -> str:
        """One line a rate and kind."""
        heads = ('median', 'p99', 'p99.9', 'max')
        lines = [
            f'{"state out to command in [us]":<38}'
            + ''.join(f'{head:>8}' for head in heads)
            + f'{"in cycle":>10}{"lost":>8}{"skipped":>9}  processor [% of a core]'
        ]
        for rate, kinds in self.exchanges.items():
            lines.append(f'-- {rate:g} Hz')
            lines += [f'{WORDS[kind]:<38}{_line(exchange)}' for kind, exchange in kinds.items()]
        return '\n'.join(lines)

    def figures(self) -> dict[str, object]:
        """For the file of results."""
        return {
            f'{rate:g}_Hz': {kind: exchange.figures() for kind, exchange in kinds.items()}
            for rate, kinds in self.exchanges.items()
        }


def _line(exchange: Exchange) -> str:
    times = exchange.times
    cells = ''.join(f'{1e6 * times.quantile(share):8.0f}' for share in (0.5, 0.99, 0.999, 1.0))
    shares = ', '.join(f'{name} {100.0 * share:.0f}' for name, share in exchange.processors.items())
    return f'{cells}{1.0 - exchange.late:10.2%}{exchange.lost:8.2%}{exchange.skipped:9d}  {shares}'


def _goals(rate: float, kinds: Mapping[str, Exchange]) -> list[Goal]:
    at = f'at {rate:g} Hz'
    goals = []
    echo = kinds.get(ECHO)
    for kind in (CONTROLLER, WEIGHTED):
        if kind in kinds and echo:
            got = kinds[kind].times.median / echo.times.median
            goals += [
                Goal(f"{WORDS[kind]} {at}: median by the echo's", got, 1.25),
                Goal(
                    f"{WORDS[kind]} {at}: late cycles by the echo's",
                    _ratio(kinds[kind].late, echo.late),
                    1.25,
                ),
            ]
        if kind in kinds and rate == NOMINAL:
            goals.append(
                Goal(
                    f'{WORDS[kind]} {at}: percent of a core',
                    100.0 * kinds[kind].processors[kind],
                    20.0,
                )
            )
    for kind in (CONTROLLER, GRAPH):
        if kind in kinds and rate == FAST:
            goals.append(
                Goal(
                    f'{WORDS[kind]} {at}: percent answered in the cycle',
                    100.0 * (1.0 - kinds[kind].late),
                    95.0,
                    at_most=False,
                )
            )
    if COMPOSED in kinds and rate == NOMINAL:
        goals.append(Goal(f'in one process {at}: percent late', 100.0 * kinds[COMPOSED].late, 0.5))
        if echo:
            got = kinds[COMPOSED].times.median / echo.times.median
            goals.append(Goal(f"in one process {at}: median by the two-process echo's", got, 0.6))
    return goals


def _ratio(got: float, by: float) -> float:
    """1 where both are 0."""
    return got / by if by else float('inf') if got else 1.0
