"""`redres reproduce`: the paper's figures and claims."""

import argparse
from importlib import import_module
from typing import Any

from redres_ros.cli.options import add_out
from redres_ros.cli.parser import add_command


def add(commands: Any) -> None:
    """Declare the subcommand."""
    reproduce = add_command(
        commands, 'reproduce', "the paper's figures and claims, without ROS", '--out figures'
    )
    add_out(reproduce, 'redres_reproduce', 'figures and table')
    reproduce.set_defaults(run=_reproduce)


def _reproduce(options: argparse.Namespace) -> int:
    from redres_ros.cli.files import made
    from redres_ros.paper.claim import check_all, table, write_csv
    from redres_ros.paper.claims import CLAIMS
    from redres_ros.paper.figures import draw_all
    from redres_ros.paper.runs import Runs
    from redres_ros.simulation.report import progress_bar

    import_module('scipy')  # an extra, asked for before a minute has passed
    runs = Runs()
    out = made(options.out, 'claims.csv')
    with progress_bar('simulations and experiments') as progress:
        runs.prepare(progress)
    with progress_bar('figures') as progress:
        draw_all(out, progress, runs)
    with progress_bar('claims') as progress:
        findings = check_all(CLAIMS, runs, progress)
    write_csv(findings, out / 'claims.csv')
    print(table(findings))
    print(f'figures {out}/figure_*.png, table {out}/claims.csv')
    print(
        f'simulations with the {runs.model.arm.dynamics} of Section 5.2, '
        f'experiments with the {runs.experiment_model.arm.dynamics} arm'
    )
    return 0
