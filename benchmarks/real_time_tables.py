"""Writes what `redres bench` measured into docs/real_time.md.

    redres bench --out redres_bench
    python benchmarks/real_time_tables.py redres_bench/bench.json

The tables stand between two marks each, `<!-- tick -->` and `<!-- /tick -->`; what is between them
is replaced, the rest of the page stays.
"""

import json
import re
import sys
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

OTHER_SOLVERS = ('daqp', 'proxqp')  # pink and mink are shown with one
RATES = ('500_Hz', '1000_Hz')
ROWS = (
    'bare echo node',
    'controller, standing still',
    'planner, controller',
    'planner and controller in one process',
    'planner, controller and robot in one process',
    'bare echo node, kept awake',
    'planner, controller, kept awake',
    'planner and controller in one process, kept awake',
)
PAGE = Path(__file__).parents[1] / 'docs' / 'real_time.md'


def main() -> int:
    """Read the file that the command line names, and rewrite the page."""
    measured = json.loads(Path(sys.argv[1]).read_text())
    page = PAGE.read_text()
    page = replace(page, 'machine', machine(measured['machine']))
    if 'tick' in measured:
        page = replace(page, 'tick', tick_table(measured['tick']))
    if 'loop' in measured:
        page = replace(page, 'loop', loop_table(measured['loop']))
    PAGE.write_text(page)
    return 0


def replace(page: str, mark: str, text: str) -> str:
    """The page with another text between two marks."""
    pattern = re.compile(f'(<!-- {mark} -->).*?(<!-- /{mark} -->)', re.DOTALL)
    changed, count = pattern.subn(lambda match: f'{match[1]}\n{text}\n{match[2]}', page)
    if count != 1:
        raise SystemExit(f'{PAGE}: {count} places are marked with {mark}; expected 1')
    return changed


def machine(figures: Mapping[str, Any]) -> str:
    """One sentence."""
    versions = figures['versions'].items()
    packages = ', '.join(f'{name} {version}' for name, version in versions if name != 'redres_ros')
    return (
        f'{figures["processor"]}, {figures["cores"]} cores, Linux {figures["kernel"]}, '
        f'Python {figures["python"]}; {packages}.'
    )


def tick_table(figures: Mapping[str, Any]) -> str:
    """Medians, beside the floor and the fastest peer."""
    groups = {
        'law': figures['laws'],
        'Pinocchio': figures['pinocchio'],
        'peer': figures['peers'],
    }
    floor = figures['pinocchio']['computeAllTerms']['median_us']
    peer = figures['peers'][figures['fastest_peer']]['median_us']
    rows = []
    for kind, group in groups.items():
        for name, times in group.items():
            if any(solver in name for solver in OTHER_SOLVERS):
                continue
            median = times['median_us']
            rows.append(
                (
                    f'{kind}: {name}',
                    f'{median:.1f} µs',
                    f'{times["p99_us"]:.0f} µs',
                    f'{median / floor:.1f}',
                    f'{median / peer:.2f}',
                )
            )
    heads = ('tick', 'median', 'p99', 'by computeAllTerms', f'by {figures["fastest_peer"]}')
    return table(heads, rows)


def loop_table(figures: Mapping[str, Any]) -> str:
    """The rates and rows that say most."""
    rows = []
    for rate in RATES:
        for name in ROWS:
            if name not in figures[rate]:
                continue
            trips = figures[rate][name]
            shares = trips['processor_percent_of_a_core'].items()
            rows.append(
                (
                    rate.replace('_', ' '),
                    name,
                    f'{trips["median_us"]:.0f} µs',
                    f'{trips["p99_us"]:.0f} µs',
                    f'{trips["in_cycle_percent"]:.2f} %',
                    ', '.join(f'{process} {share:.0f} %' for process, share in shares),
                )
            )
    return table(('rate', 'commanded by', 'median', 'p99', 'in cycle', 'of a core'), rows)


def table(heads: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """A table in Markdown."""
    lines = [heads, ['---'] * len(heads), *rows]
    return '\n'.join(f'| {" | ".join(cells)} |' for cells in lines)


if __name__ == '__main__':
    sys.exit(main())
