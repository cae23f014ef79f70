"""Finds a good damping over many random tasks and starts of one arm."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from itertools import product

import numpy as np
from rich.table import Table

from redres_ros.simulation.batch import batch
from redres_ros.simulation.case import Case
from redres_ros.simulation.report import table

DAMPINGS = (0.0, 1.0, 2.0, 5.0, 10.0, 20.0, 50.0, 100.0)  # k_d [1/s]
GOOD = 1.25  # times the least peak of a task

_MOST = 0.9  # of the tasks, if there are enough of them


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
        """Of the ratios, (d,)."""
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
    places = list(product(range(tasks), range(len(laws)), range(len(dampings))))
    cases = [
        replace(base, law=laws[law], gains={'damping': dampings[damping]}, seed=seed)
        for seed, law, damping in places
    ]
    peaks = np.full((tasks, len(laws), len(dampings)), np.inf)
    kept = np.zeros(peaks.shape, dtype=bool)
    where = {repr(case): place for case, place in zip(cases, places, strict=True)}
    for done, result in enumerate(batch(cases), 1):
        place = where[repr(result.case)]
        if result.effort is not None and result.effort.finished:
            peaks[place] = result.effort.acceleration
        kept[place] = result.within_limits
        progress(done / len(cases))
    return [
        Trials(law, np.array(dampings), peaks[:, at], kept[:, at]) for at, law in enumerate(laws)
    ]


def damping_table(trials: Trials, title: str) -> Table:
    """One row a damping.

    Args:
        trials: Of one law.
        title: Says what was tried.
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
