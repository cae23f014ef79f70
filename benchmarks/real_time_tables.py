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

PAGE = Path(__file__).parents[1] / 'docs' / 'real_time.md'


def main() -> int:
    """Read the file that the command line names, and rewrite the page."""
    measured = json.loads(Path(sys.argv[1]).read_text())
    page = PAGE.read_text()
    page = replace(page, 'machine', machine(measured['machine']))
    if 'tick' in measured:
        page = replace(page, 'tick', tick_table(measured['tick']))
        page = replace(page, 'goals', goals_table(measured['tick']))
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
    versions = figures['versions']
    names = ('numpy', 'pin', 'mujoco', 'ros-jazzy-rclpy', 'embodik', 'pin-pink', 'mink')
    packages = ', '.join(f'{name} {versions[name]}' for name in names if name in versions)
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


def goals_table(figures: Mapping[str, Any]) -> str:
    """What was aimed at, as ratios of medians, and what came of it."""
    laws = {name: times['median_us'] for name, times in figures['laws'].items()}
    peers = {name: times['median_us'] for name, times in figures['peers'].items()}
    floor = figures['pinocchio']['kinematics, M and n']['median_us']
    least = laws['minimum_velocity']
    weighted = max(
        laws[name]
        for name in ('minimum_kinetic_energy', 'dynamically_consistent', 'minimum_torque')
    )
    idle = laws['minimum_velocity, limits idle']
    acting = laws['minimum_velocity, limits acting']
    goals = (
        ('minimum_velocity by embodik', least / peers['embodik'], 0.9),
        ('with limits that do not act, by embodik', idle / peers['embodik'], 1.0),
        ('with limits that act, by embodik', acting / peers['embodik, limits acting'], 1.5),
        ("the slowest M-weighted law, by Pinocchio's J, M and n", weighted / floor, 3.3),
        ('two priorities, by one task', laws['minimum_velocity, two priorities'] / least, 1.5),
    )
    rows = [
        (name, f'{measured:.2f}', f'at most {goal}', 'met' if measured <= goal else 'missed')
        for name, measured, goal in goals
    ]
    return table(('ratio of medians', 'measured', 'goal', ''), rows)


def loop_table(figures: Mapping[str, Any]) -> str:
    """All rates and all who answer."""
    rows = []
    for rate, kinds in figures.items():
        for name, trips in kinds.items():
            shares = trips['processor_percent_of_a_core'].items()
            rows.append(
                (
                    rate.replace('_', ' '),
                    name,
                    f'{trips["median_us"]:.0f} µs',
                    f'{trips["p99_us"]:.0f} µs',
                    f'{trips["p99_9_us"]:.0f} µs',
                    f'{trips["answered_in_cycle_percent"]:.2f} %',
                    str(trips['cycles_skipped']),
                    ', '.join(f'{process} {share:.0f} %' for process, share in shares),
                )
            )
    heads = ('rate', 'answered by', 'median', 'p99', 'p99.9', 'in cycle', 'skipped', 'of a core')
    return table(heads, rows)


def table(heads: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """A table in Markdown."""
    lines = [heads, ['---'] * len(heads), *rows]
    return '\n'.join(f'| {" | ".join(cells)} |' for cells in lines)


if __name__ == '__main__':
    sys.exit(main())
