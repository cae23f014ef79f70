"""Draws docs/evidence.png and writes the tables of docs/choosing_a_law.md from results of a study.

Run it with: python docs/make_evidence.py docs/studies/{laws,long,ahead}.parquet
The results come from: python docs/study.py docs/studies/laws.yaml laws.parquet
Results from elsewhere are first kept in docs/studies, with rounded figures.
"""

import argparse
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from functools import cache
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow
from make_numbers import markdown, write
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from pyarrow import parquet
from study import read_results

from redres_ros import LAWS, Case, Result, RobotModel
from redres_ros.simulation.colours import law_colour

FOLDER = Path(__file__).parent
PAGE = FOLDER / 'choosing_a_law.md'
STUDIES = FOLDER / 'studies'

FIRST = 'minimum_velocity'  # the pseudoinverse, which the others are compared with
DEFAULT = 'minimum_acceleration'
ORDER = ('robot', 'task', 'limits', 'seed', 'law')  # of the rows: neighbours are alike
KINDS = {'random': 'random', 'near_singular': 'nearly singular'}
BAND = (0.1, 0.9)  # quantiles
PEAK = 'peak |ddq|'
SQUARE = 'integral of |ddq|^2'
RATIOS: dict[str, Callable[[Any], float]] = {  # figures of a finished result, by their heads
    PEAK: lambda result: result.effort.acceleration,
    'RMS |ddq|': lambda result: (result.effort.squared_acceleration / result.duration) ** 0.5,
    'peak |tau|': lambda result: result.effort.torque,
    'kinetic energy': lambda result: result.effort.kinetic_energy,
    SQUARE: lambda result: result.effort.squared_acceleration,
}
SHOWN = (PEAK, 'RMS |ddq|', 'peak |tau|', 'kinetic energy')
AHEAD = '@horizon=2'  # as the command line has it
GREEDY = [law for law in LAWS if not law.endswith('ahead')]

Task = tuple[str, str, int]  # arm, kind, seed
Pair = tuple[Result, Result]  # of one task: under a law, and under the first one


def main() -> None:
    """Read, draw and write."""
    parser = argparse.ArgumentParser()
    parser.add_argument('short', type=Path)
    parser.add_argument('long', type=Path)
    parser.add_argument('ahead', type=Path)
    options = parser.parse_args()
    short = read_results(kept(options.short))
    long = read_results(kept(options.long))
    ahead = read_results(kept(options.ahead))
    draw(short).savefig(FOLDER / 'evidence.png', dpi=110)
    blocks = {
        'evidence_sample': sample(short, long),
        'evidence_ahead': ahead_table(ahead),
        'evidence_long': long_table(long),
    }
    write(blocks, [PAGE])


def kept(path: Path) -> Path:
    """The file in STUDIES that holds these results, with four digits of each figure.

    All digits would take three times the space, and no table shows more than four.
    """
    target = STUDIES / path.name
    if path.resolve() != target:
        whole = parquet.read_table(path).sort_by([(name, 'ascending') for name in ORDER])
        columns = [_rounded(whole[name]) for name in whole.column_names]
        rounded = pyarrow.table(columns, names=whole.column_names)
        parquet.write_table(rounded, target, compression='zstd', compression_level=19)
    return target


def _rounded(column: pyarrow.ChunkedArray) -> pyarrow.ChunkedArray | pyarrow.Array:
    """The column, its floating point numbers with four digits."""
    if column.type != pyarrow.float64():
        return column
    digits = [None if each is None else float(f'{each:.4g}') for each in column.to_pylist()]
    return pyarrow.array(digits)


def sample(short: Sequence[Result], long: Sequence[Result]) -> str:
    """How many tasks the tables stand on: random and nearly singular ones, and long ones."""
    fewest, *_, most = sorted(_counts(short))
    tasks = f'{most:,}' if fewest == most else f'{fewest:,} to {most:,}'
    return (
        f'Of each arm, kind and law there are {tasks} tasks, and {min(_counts(long))} '
        f'long ones:\n{len(short) + len(long):,} motions.\n'
    )


def _counts(results: Sequence[Result]) -> list[int]:
    """The number of tasks of each arm, law and kind, with limits and without."""
    cases = [each.case for each in results]
    return [*Counter((case.robot, _name(case), case.limits, case.task) for case in cases).values()]


def pairs(results: Sequence[Result], limited: bool) -> dict[str, list[Pair]]:
    """Each law's motions beside those of the first law on the same task."""
    chosen = [each for each in results if bool(each.case.limits) == limited]
    firsts = {_task(each): each for each in chosen if each.case.law == FIRST}
    found: dict[str, list[Pair]] = {name: [] for law in GREEDY for name in (law, law + AHEAD)}
    for each in chosen:
        if _task(each) in firsts:
            found[_name(each.case)].append((each, firsts[_task(each)]))
    return {name: found[name] for name in found if found[name]}


def _name(case: Case) -> str:
    """Of a law."""
    return case.law + (AHEAD if case.gains.get('horizon') else '')


def ahead_table(results: Sequence[Result]) -> str:
    """Least acceleration without a horizon and with one, beside the first law on the same tasks."""
    heads = (
        'tasks | law | ∫‖q̈‖² | worst | peak ‖q̈‖ | within the limits without any '
        '| limits on: mean time lost [s]'
    )
    found = [pairs(results, limited) for limited in (False, True)]
    rows = []
    for kind, name in product(KINDS, (FIRST, DEFAULT, DEFAULT + AHEAD)):
        free, limited = ([p for p in each[name] if p[0].case.task == kind] for each in found)
        squares = ratios(free, SQUARE)
        rows.append(
            [
                f'{len(free)} {KINDS[kind]}' if name == FIRST else '',
                f'`{name}`',
                shown(squares),
                f'{max(squares):.3g}',
                shown(ratios(free, PEAK)),
                _finished([each for each, _ in free]),
                f'{np.mean([each.time_lost for each, _ in limited if each.finished]):.4f}',
            ]
        )
    return markdown(heads, rows)


def long_table(results: Sequence[Result]) -> str:
    """All laws on long tasks, with limits."""
    heads = (
        'law | finished | peak ‖q̈‖ | RMS ‖q̈‖ | peak ‖τ‖ | energy '
        '| closure [rad] | mean time lost [s]'
    )
    rows = []
    for name, found in pairs(results, limited=True).items():
        closures = [each.closure for each, _ in found if each.finished]
        cells = [
            f'`{name}`',
            _finished([each for each, _ in found]),
            *(shown(ratios(found, head)) for head in SHOWN),
            f'{np.median(closures):.2f}',
            _time_lost([each for each, _ in found]),
        ]
        rows.append(cells)
    return markdown(heads, rows)


def distances(results: Sequence[Result]) -> dict[Task, float]:
    """The smallest singular value on each path over the reach, of the first law without limits."""
    return {
        _task(each): each.min_singular_value / _reach(each.case.robot)
        for each, _ in pairs(results, limited=False)[FIRST]
    }


def ratios(found: Sequence[Pair], head: str) -> list[float]:
    """Ratios of a figure of RATIOS, of the tasks that both laws finish."""
    return [RATIOS[head](law) / RATIOS[head](first) for law, first in _both(found)]


def shown(values: Sequence[float]) -> str:
    """Median and band."""
    if not len(values):
        return '–'
    low, high = np.quantile(values, BAND)
    return f'{np.median(values):.3g} ({low:.3g}–{high:.3g})'


def draw(results: Sequence[Result]) -> Figure:
    """Ratios of the peaks of acceleration over the distance from singularities, a panel a law."""
    laws = [law for law in GREEDY if law != FIRST]
    figure = Figure(figsize=(11.0, 6.0), layout='constrained')
    axes = figure.subplots(2, 3, sharex=True, sharey=True)
    found = {limited: pairs(results, limited) for limited in (False, True)}
    near = distances(results)
    for ax, law in zip(axes.flat, laws, strict=False):
        _draw_law(ax, found[False][law], found[True][law], near, law_colour(law))
        ax.set_title(law, fontsize='medium')
        ax.grid(alpha=0.3)
    axes[0, 2].tick_params(labelbottom=True)  # nothing is drawn below it
    axes.flat[-1].axis('off')
    entries = axes.flat[0].get_legend_handles_labels()
    axes.flat[-1].legend(*entries, loc='center', markerscale=3)
    figure.supxlabel('smallest singular value along the path / reach, under minimum_velocity')
    figure.supylabel(f'peak acceleration / that of {FIRST}')
    return figure


def _draw_law(
    ax: Axes, free: Sequence[Pair], limited: Sequence[Pair], near: Mapping[Task, float], colour: str
) -> None:
    """A point for each task that both laws finish, without limits and with them."""
    for found, style in (
        (free, {'marker': '.', 'ms': 2, 'color': colour, 'label': 'without limits'}),
        (limited, {'marker': 'x', 'ms': 2, 'mew': 0.4, 'color': '0.35', 'label': 'with limits'}),
    ):
        x = [near[_task(first)] for _, first in _both(found)]
        ax.loglog(x, ratios(found, PEAK), ls='', alpha=0.5, **style)
    ax.axhline(1.0, color='0.2', lw=0.8)
    ax.set(xlim=(1e-4, 1.0), ylim=(1e-2, 1e6))


def _both(found: Sequence[Pair]) -> list[Pair]:
    """Pairs of which both motions finish."""
    return [pair for pair in found if pair[0].finished and pair[1].finished]


def _finished(results: Sequence[Result]) -> str:
    """Of those that finish and stay within the limits."""
    kept = [each.finished and each.within_limits for each in results]
    return f'{np.mean(kept):.0%}' if kept else '–'


def _time_lost(results: Sequence[Result]) -> str:
    return f'{np.mean([each.time_lost for each in results if each.finished]):.2f}'


def _task(result: Result) -> Task:
    """What distinguishes a task from the others."""
    return result.case.robot, result.case.task, result.case.seed


@cache
def _reach(robot: str) -> float:
    return RobotModel.named(robot).reach


if __name__ == '__main__':
    main()
