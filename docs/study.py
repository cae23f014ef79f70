"""Many motions: runs a study and keeps its results, and finds which damping is good.

Run it with: python docs/study.py docs/studies/laws.yaml laws.parquet
"""

import argparse
import json
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, fields, replace
from itertools import product
from pathlib import Path
from typing import Any, get_type_hints

import numpy as np

from redres_ros import Case, Effort, Result, batch
from redres_ros.files.yaml import read_yaml
from redres_ros.simulation.report import progress_bar

DAMPINGS = (0.0, 1.0, 2.0, 5.0, 10.0, 20.0, 50.0, 100.0)  # k_d [1/s]
GOOD = 1.25  # times the least peak of a task


def cases_of(study: Mapping[str, Any]) -> list[Case]:
    """All combinations of the values of a study, task by task."""
    values = dict(study)
    seeds = range(values.pop('seeds'))
    if isinstance(values['limits'][0], str):
        values['limits'] = [values['limits']]  # one set of limits
    choices = [value if isinstance(value, list) else [value] for value in values.values()]
    return [
        Case(seed=seed, **dict(zip(values, chosen, strict=True)))
        for seed in seeds
        for chosen in product(*choices)
    ]


def write_results(results: Sequence[Result], path: Path) -> None:
    """Write results as a Parquet file, one row each."""
    import pyarrow
    from pyarrow import parquet

    parquet.write_table(pyarrow.Table.from_pylist([_as_row(each) for each in results]), path)


def read_results(path: Path) -> list[Result]:
    """The results in a file."""
    from pyarrow import parquet

    return [_as_result(row) for row in parquet.read_table(path).to_pylist()]


def _as_row(result: Result) -> dict[str, Any]:
    case = {
        name: ','.join(value) if isinstance(value, tuple) else value
        for name, value in vars(result.case).items()
    }
    case['gains'] = json.dumps(dict(result.case.gains), sort_keys=True)
    figures = {name: getattr(result.effort, name, None) for name in get_type_hints(Effort)}
    others = {name: value for name, value in vars(result).items() if name not in ('case', 'effort')}
    return case | figures | others


def _as_result(row: Mapping[str, Any]) -> Result:
    case = {each.name: row[each.name] for each in fields(Case)}
    for name in ('limits', 'preferences', 'secondary_tasks', 'plugins'):
        case[name] = tuple(filter(None, case[name].split(',')))
    case['gains'] = json.loads(case['gains'])
    effort = None
    if row['finished'] is not None:
        effort = Effort(**{each.name: row[each.name] for each in fields(Effort)})
    others = [each.name for each in fields(Result) if each.name not in ('case', 'effort')]
    return Result(Case(**case), effort, **{name: row[name] for name in others})


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
    base: Case, laws: Sequence[str], tasks: int, progress: Callable[[float], None]
) -> list[Trials]:
    """Every law with every damping on the same random tasks, whose seeds are 0, 1, 2 and so on."""
    cases = [
        replace(base, law=law, gains={'damping': damping}, seed=seed)
        for seed, law, damping in product(range(tasks), laws, DAMPINGS)
    ]
    results = {}
    for result in batch(cases):
        results[repr(result.case)] = result
        progress(len(results) / len(cases))
    ordered = [results[repr(case)] for case in cases]
    shape = (tasks, len(laws), len(DAMPINGS))
    peaks = np.full(len(cases), np.inf)
    for place, result in enumerate(ordered):
        if result.effort is not None and result.finished:
            peaks[place] = result.effort.acceleration
    peaks = peaks.reshape(shape)
    kept = np.reshape([each.within_limits for each in ordered], shape)
    return [
        Trials(law, np.array(DAMPINGS), peaks[:, at], kept[:, at]) for at, law in enumerate(laws)
    ]


def main() -> None:
    """Run a study."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument('study', type=Path)
    parser.add_argument('out', type=Path)
    options = parser.parse_args()
    cases = cases_of(read_yaml(options.study))
    results = []
    with progress_bar(f'{len(cases)} motions') as progress:
        for result in batch(cases):
            results.append(result)
            progress(len(results) / len(cases))
    write_results(results, options.out)


if __name__ == '__main__':
    main()
