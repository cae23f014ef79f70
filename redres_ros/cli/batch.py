"""`redres batch`: many motions on all processors, from a file that says which."""

import argparse
from pathlib import Path
from typing import Any

from redres_ros.cli.parser import add_command, option


def add(commands: Any) -> None:
    """Declare the subcommand."""
    batch = add_command(
        commands, 'batch', 'many motions on all processors, without ROS', 'study.yaml'
    )
    option(batch, 'file', 'FILE.yaml', 'fields of a case; values in lists are combined', type=Path)
    out = 'file of results; those in it already are not computed again; default: FILE.csv'
    option(batch, '--out', 'FILE.csv|FILE.parquet', out, type=Path)
    batch.set_defaults(run=_batch)


def _batch(options: argparse.Namespace) -> int:
    from redres_ros.cli.files import check_writable
    from redres_ros.errors import FileError
    from redres_ros.files.yaml import read_yaml
    from redres_ros.simulation.case import grid
    from redres_ros.simulation.report import print_tables
    from redres_ros.simulation.results_file import ResultsFile, run_cases
    from redres_ros.simulation.summary import summaries, summary_tables

    values = read_yaml(options.file)
    if not isinstance(values, dict):
        raise FileError(f'{options.file} holds no fields of a case, such as law: minimum_velocity')
    cases = grid(values)
    out = options.out or options.file.with_suffix('.csv')
    check_writable(out)
    with ResultsFile(out) as file:
        left = [case for case in cases if case not in file]
        if len(left) < len(cases):
            print(f'{out} holds {len(cases) - len(left)} of {len(cases)} motions')
        results = run_cases(left, file)
        earlier = file.results()
    if results or earlier:
        print_tables(*summary_tables(summaries([*earlier, *results])))
    print(f'{len(results)} of {len(left)} motions added to {out}')
    failed = [result for result in results if result.error]
    for result in failed[:3]:
        print(f'{result.case.law}, {result.case.robot}, seed {result.case.seed}: {result.error}')
    return 0 if len(results) == len(left) and not failed else 1
