"""Statistics of many motions: each law relative to the first one."""

from collections.abc import Callable, Iterable, Mapping

import numpy as np
from rich.table import Table

from redres_ros.simulation.batch import Result
from redres_ros.simulation.comparison import plain
from redres_ros.simulation.report import table

_BAND = (0.1, 0.9)  # quantiles that a table shows beside the median
_ALIKE = 1.05  # ratio of two medians that hardly differ

Results = Mapping[int, Result]  # of one law, by the seeds of its tasks

RATIOS: dict[str, Callable[[Result], float]] = {  # by their heads
    'peak |ddq|': lambda result: _effort(result, 'acceleration'),
    'RMS |ddq|': lambda result: _root_mean_square(result, 'squared_acceleration'),
    'peak |tau|': lambda result: _effort(result, 'torque'),
    'RMS |tau|': lambda result: _root_mean_square(result, 'squared_torque'),
    'kinetic energy': lambda result: _effort(result, 'kinetic_energy'),
}


def summary_tables(results: Iterable[Result]) -> list[Table]:
    """A table for each kind of task, with the ratios of each law to the first one.

    The results differ in task, law, damping and seed alone.
    """
    groups: dict[str, dict[str, dict[int, Result]]] = {}
    for result in sorted(results, key=lambda result: result.case.law != 'minimum_velocity'):
        laws = groups.setdefault(_title(result), {})
        laws.setdefault(_label(result), {})[result.case.seed] = result
    return [_table(title, laws) for title, laws in groups.items()]


def _title(result: Result) -> str:
    case = result.case
    limits = ', '.join(case.limits) or 'none'
    return f'{case.robot}, {case.task}, T = {1e3 * case.T:g} ms, limits: {limits}'


def _label(result: Result) -> str:
    damping = result.case.gains.get('damping')
    return result.case.law if damping is None else f'{result.case.law}, k_d = {plain(damping)} 1/s'


def _table(title: str, laws: Mapping[str, Results]) -> Table:
    first, *_ = laws
    rows = []
    for law, results in laws.items():
        ratios = [_shown(_ratios(results, laws[first], figure)) for figure in RATIOS.values()]
        finished = [each for each in results.values() if each.finished]
        within = [each for each in finished if each.within_limits]
        rows.append(
            [
                law,
                f'{len(finished) / len(results):.0%}',
                f'{len(within) / len(results):.0%}',
                *ratios,
                _median(each.time_lost for each in finished),
                _median(each.closure for each in finished),
            ]
        )
    heads = ('law', 'finished', 'within limits', *RATIOS, 'time lost [s]', 'closure [rad]')
    motions = len(laws[first])
    note = f'{motions} tasks; ratios to {first}: median (10 to 90 %); {conclusion(laws)}'
    return table(heads, rows, title=title, note=note)


def conclusion(laws: Mapping[str, Results]) -> str:
    """What the peaks of acceleration say about the choice of a law, in a sentence; the laws are
    compared with the first of them.
    """
    first, *others = laws
    medians = {}
    for law in others:
        ratios = _ratios(laws[law], laws[first], RATIOS['peak |ddq|'])
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


def _ratios(results: Results, others: Results, figure: Callable[[Result], float]) -> np.ndarray:
    """A figure over that of other results, of each task that both finish."""
    both = [
        seed for seed in results.keys() & others if results[seed].finished and others[seed].finished
    ]
    return np.array([figure(results[seed]) / figure(others[seed]) for seed in both])


def _effort(result: Result, name: str) -> float:
    return float(getattr(result.effort, name))


def _root_mean_square(result: Result, name: str) -> float:
    return float(np.sqrt(_effort(result, name) / result.duration))


def _median(values: Iterable[float]) -> str:
    """The median of the values that are no NaN, or a dash."""
    numbers = [value for value in values if np.isfinite(value)]
    return f'{np.median(numbers):.3f}' if numbers else '-'


def _shown(ratios: np.ndarray) -> str:
    if not len(ratios):
        return '-'
    low, high = np.quantile(ratios, _BAND)
    return f'{np.median(ratios):.3f} ({low:.2f}–{high:.2f})'
