"""Statistics of many motions: each law relative to the first one, each damping relative to
the best.
"""

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, fields, replace
from itertools import product
from typing import Any

import numpy as np
from rich.table import Table

from redres_ros.simulation.batch import Result, batch
from redres_ros.simulation.case import Case
from redres_ros.simulation.comparison import plain
from redres_ros.simulation.report import table

_BAND = (0.1, 0.9)  # quantiles that a table shows beside the median
_ALIKE = 1.05  # ratio of two medians that hardly differ
DAMPINGS = (0.0, 1.0, 2.0, 5.0, 10.0, 20.0, 50.0, 100.0)  # k_d [1/s]
GOOD = 1.25  # times the least peak of a task
_MOST = 0.9  # of the tasks, if there are enough of them
_SHOWN = ('robot', 'law', 'T', 'limits', 'task', 'seed')  # in the title, or in rows

RATIOS: dict[str, Callable[[Result], float]] = {  # by their heads
    'peak |ddq|': lambda result: _effort(result, 'acceleration'),
    'RMS |ddq|': lambda result: _root_mean_square(result, 'squared_acceleration'),
    'peak |tau|': lambda result: _effort(result, 'torque'),
    'RMS |tau|': lambda result: _root_mean_square(result, 'squared_torque'),
    'kinetic energy': lambda result: _effort(result, 'kinetic_energy'),
}


@dataclass
class Summary:
    """Results of one law on many tasks, by task."""

    results: dict[str, Result] = field(default_factory=dict)

    def fraction(self, holds: Callable[[Result], bool]) -> float:
        """The fraction of all motions for which something holds."""
        return float(np.mean([holds(result) for result in self.results.values()]))

    def median(self, figure: Callable[[Result], float]) -> float:
        """The median of a figure over the finished motions; NaN if there is none."""
        values = [figure(result) for result in self.results.values() if _finished(result)]
        return float(np.nanmedian(values)) if np.isfinite(values).any() else np.nan

    def ratios(self, others: 'Summary', figure: Callable[[Result], float]) -> np.ndarray:
        """This law's figure over another's, of each task that both finish.

        Args:
            others: Summary of the other law.
            figure: Computes the figure from the result of one motion.
        """
        both = [task for task in self.results if _finished(others.results.get(task))]
        return np.array(
            [
                figure(self.results[task]) / figure(others.results[task])
                for task in both
                if _finished(self.results[task])
            ]
        )


def summaries(results: Iterable[Result]) -> dict[str, dict[str, Summary]]:
    """Results by all that their cases have in common but law, damping and seed; below it by law."""
    groups: dict[str, dict[str, Summary]] = {}
    for result in sorted(results, key=lambda result: result.case.law != 'minimum_velocity'):
        laws = groups.setdefault(_title(result.case), {})
        laws.setdefault(_label(result), Summary()).results[f'{result.case.seed}'] = result
    return groups


def _title(case: Case) -> str:
    """Arm, kind of task, sampling time and limits, and whatever is not as it is by default."""
    limits = ', '.join(case.limits) or 'none'
    parts = [case.robot, case.task, f'T = {1e3 * case.T:g} ms', f'limits: {limits}']
    gains = {name: value for name, value in case.gains.items() if name != 'damping'}
    other = replace(case, gains=gains)
    for each in fields(Case):
        value = getattr(other, each.name)
        if each.name not in _SHOWN and value and value != each.default:
            parts.append(f'{each.name.replace("_", " ")}: {_plain(value)}')
    return ', '.join(parts)


def _plain(value: Any) -> str:
    """A field of a case, to be read."""
    if isinstance(value, Mapping):
        return ' '.join(f'{name} = {value[name]}' for name in sorted(value))
    return ' '.join(value) if isinstance(value, tuple) else f'{value}'


def summary_tables(groups: Mapping[str, Mapping[str, Summary]]) -> list[Table]:
    """A table for each arm and kind of task, with the ratios of each law to the first; the groups
    are as `summaries` makes them.
    """
    return [_table(title, laws) for title, laws in groups.items()]


def _table(title: str, laws: Mapping[str, Summary]) -> Table:
    first, *_ = laws
    rows = []
    for law, summary in laws.items():
        ratios = [_shown(summary.ratios(laws[first], figure)) for figure in RATIOS.values()]
        rows.append(
            [
                law,
                f'{summary.fraction(_finished):.0%}',
                f'{summary.fraction(_within):.0%}',
                *ratios,
                f'{summary.median(lambda result: result.time_lost):.3f}',
                _or_dash(summary.median(lambda result: result.closure)),
            ]
        )
    heads = ('law', 'finished', 'within limits', *RATIOS, 'time lost [s]', 'closure [rad]')
    motions = len(laws[first].results)
    note = f'{motions} tasks; ratios to {first}: median (10 to 90 %); {conclusion(laws)}'
    return table(heads, rows, title=title, note=note)


def conclusion(laws: Mapping[str, Summary]) -> str:
    """What the peaks of acceleration say about the choice of a law, in a sentence; the laws are
    compared with the first of them.
    """
    first, *others = laws
    medians = {}
    for law in others:
        ratios = laws[law].ratios(laws[first], RATIOS['peak |ddq|'])
        if len(ratios):
            medians[law] = float(np.median(ratios))
    if not medians:
        return 'one law alone says nothing about the choice'
    law = min(medians, key=medians.__getitem__)
    if 1.0 / _ALIKE < medians[law] < _ALIKE:
        return (
            'on half of these tasks the best law changes the peak of acceleration by less than 5 %'
        )
    return f'the median peak of acceleration is {medians[law]:.2f} times with {law}'


def _label(result: Result) -> str:
    damping = result.case.gains.get('damping')
    return result.case.law if damping is None else f'{result.case.law}, k_d = {plain(damping)} 1/s'


def _effort(result: Result, name: str) -> float:
    return float(getattr(result.effort, name))


def _root_mean_square(result: Result, name: str) -> float:
    return float(np.sqrt(_effort(result, name) / result.duration))


def _finished(result: Result | None) -> bool:
    return result is not None and result.finished


def _within(result: Result) -> bool:
    return result.finished and result.within_limits


def _or_dash(value: float) -> str:
    return '-' if np.isnan(value) else f'{value:.3f}'


def _shown(ratios: np.ndarray) -> str:
    if not len(ratios):
        return '-'
    low, high = np.quantile(ratios, _BAND)
    return f'{np.median(ratios):.3f} ({low:.2f}–{high:.2f})'


@dataclass(frozen=True)
class Trials:
    """One law on many tasks.

    Args:
        law: Its name.
        dampings: (d,) [1/s].
        peaks: (tasks, d) largest |ddq| [rad/s^2]; infinite where the last point was not reached.
        kept: (tasks, d) whether no joint went beyond a limit of its own.
    """

    law: str
    dampings: np.ndarray
    peaks: np.ndarray
    kept: np.ndarray

    @property
    def ratios(self) -> np.ndarray:
        """Peaks over the least one of the same task, (tasks, d), where any damping ends it."""
        least = self.peaks.min(axis=1)
        ended = np.isfinite(least)
        return self.peaks[ended] / least[ended, None]

    @property
    def good(self) -> np.ndarray:
        """Fraction of the tasks on which a damping is within GOOD times of the best, (d,)."""
        return (self.ratios <= GOOD).mean(axis=0)

    def resolves(self, fraction: float) -> bool:
        """Whether there are enough tasks to distinguish that quantile from the maximum."""
        return len(self.ratios) * (1.0 - fraction) >= 1.0 - 1e-9

    def quantiles(self, fraction: float) -> np.ndarray:
        """Quantiles of the ratios, (d,)."""
        return np.quantile(self.ratios, fraction, axis=0, method='inverted_cdf')


def sweep(
    base: Case,
    laws: Sequence[str],
    tasks: int,
    progress: Callable[[float], None],
    dampings: Sequence[float] = DAMPINGS,
) -> list[Trials]:
    """Every law with every damping on the same random tasks, on all processors.

    Args:
        base: The arm and the sampling time.
        laws: Names in LAWS.
        tasks: How many; their seeds are 0, 1, 2 and so on.
        progress: Called with the fraction done, 0 to 1.
        dampings: k_d [1/s], up to 1/T.

    Raises:
        RedresError: No such law, or a damping out of its range.
    """
    cases = [
        replace(base, law=law, gains={'damping': damping}, seed=seed)
        for seed, law, damping in product(range(tasks), laws, dampings)
    ]
    results = {}
    for result in batch(cases):
        results[repr(result.case)] = result
        progress(len(results) / len(cases))
    ordered = [results[repr(case)] for case in cases]
    shape = (tasks, len(laws), len(dampings))
    largest = [_effort(each, 'acceleration') if each.finished else np.inf for each in ordered]
    peaks = np.reshape(largest, shape)
    kept = np.reshape([each.within_limits for each in ordered], shape)
    return [
        Trials(law, np.array(dampings), peaks[:, at], kept[:, at]) for at, law in enumerate(laws)
    ]


def damping_table(trials: Trials, title: str) -> Table:
    """One row a damping.

    Args:
        trials: Trials of one law.
        title: What was tried.
    """
    fraction = _MOST if trials.resolves(_MOST) else 1.0
    most = trials.quantiles(fraction)
    columns = (trials.good, trials.quantiles(0.5), most, trials.kept.mean(axis=0))
    rows = [
        [f'{damping:g}', f'{good:.0%}', f'{half:.2f}', f'{most:.3g}', f'{kept:.0%}']
        for damping, good, half, most, kept in zip(trials.dampings, *columns, strict=True)
    ]
    heads = (
        'k_d [1/s]',
        f'within {GOOD:g} x the best',
        'median of peak / best',
        'nine in ten below' if fraction < 1.0 else 'largest',
        'joints within limits',
    )
    return table(heads, rows, title=f'{trials.law}, {title}')
