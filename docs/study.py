"""Many motions: runs a study and keeps its results.

Run it with: python docs/study.py docs/studies/laws.yaml laws.parquet
"""

import argparse
import json
from collections.abc import Mapping, Sequence
from dataclasses import fields
from itertools import product
from pathlib import Path
from typing import Any, get_type_hints

from redres_ros import Case, Effort, Result, batch
from redres_ros.files.text import read_yaml
from redres_ros.simulation.report import progress_bar


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
    for name in ('limits', 'preferences', 'secondary_tasks'):
        case[name] = tuple(filter(None, case[name].split(',')))
    case['gains'] = json.loads(case['gains'])
    effort = None
    if row['finished'] is not None:
        effort = Effort(**{each.name: row[each.name] for each in fields(Effort)})
    others = [each.name for each in fields(Result) if each.name not in ('case', 'effort')]
    return Result(Case(**case), effort, **{name: row[name] for name in others})


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
