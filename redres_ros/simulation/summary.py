"""What many motions say together: each law beside the first one, on the same tasks."""

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field, fields, replace
from typing import Any

import numpy as np
from rich.table import Table

from redres_ros.simulation.batch import Result
from redres_ros.simulation.case import Case
from redres_ros.simulation.comparison import plain
from redres_ros.simulation.report import table

_BAND = (0.1, 0.9)  # quantiles that a table shows beside the median
_ALIKE = 1.05  # ratio of two medians that hardly differ
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
        """The fraction of all motions for which something holds.

        Args:
            holds: Of one motion.
        """
        return float(np.mean([holds(result) for result in self.results.values()]))

    def median(self, figure: Callable[[Result], float]) -> float:
        """Of the finished motions; NaN where there is none.

        Args:
            figure: Of one motion.
        """
        values = [figure(result) for result in self.results.values() if _finished(result)]
        return float(np.nanmedian(values)) if np.isfinite(values).any() else np.nan

    def ratios(self, others: 'Summary', figure: Callable[[Result], float]) -> np.ndarray:
        """This law's figure over another's, of each task that both finish.

        Args:
            others: Of the other law.
            figure: Of one motion.
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
    """Results by all that their cases have in common but law, damping and seed; below it by law.

    Args:
        results: In any order.
    """
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
    """A table for each arm and kind of task, with the ratios of each law to the first.

    Args:
        groups: As `summaries` makes them.
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
    """What the peaks of acceleration say about the choice of a law, in a sentence.

    Args:
        laws: Summaries by law; the others are compared with the first.
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
    return f'{np.median(ratios):.3f} ({low:.2f} to {high:.2f})'
