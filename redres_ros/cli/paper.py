"""`redres compare` and `redres reproduce`: the paper's laws side by side, its figures and its
claims.
"""

import argparse
from pathlib import Path
from typing import Any

from redres_ros.cli.options import Help, OptionError, add_loop, made

_LAWS = 'minimum_velocity,minimum_acceleration,minimum_weighted_torque'


def add(commands: Any) -> None:
    """Declare the subcommands."""
    compare = commands.add_parser(
        'compare', help='laws side by side on a task, without ROS', formatter_class=Help
    )
    compare.add_argument(
        '--laws',
        default=_LAWS,
        metavar='A,B,...',
        help='names from `redres laws`, each with a damping of its own if wished, '
        'as minimum_acceleration@5',
    )
    compare.add_argument(
        '--damping',
        type=float,
        metavar='K_D',
        help='of the laws that have none of their own; default: 10',
    )
    add_loop(compare)
    compare.add_argument(
        '--out',
        type=Path,
        default=Path('redres_compare'),
        metavar='DIR',
        help='directory for plot and data',
    )
    compare.set_defaults(run=_compare)
    reproduce = commands.add_parser(
        'reproduce', help="the paper's figures and claims, without ROS", formatter_class=Help
    )
    reproduce.add_argument(
        '--out',
        type=Path,
        default=Path('redres_reproduce'),
        metavar='DIR',
        help='directory for figures and table',
    )
    reproduce.set_defaults(run=_reproduce)


def _compare(options: argparse.Namespace) -> int:
    from redres_ros.controller import Controller
    from redres_ros.laws import make_law
    from redres_ros.robot_model import RobotModel
    from redres_ros.simulation.closed_loop import run
    from redres_ros.simulation.comparison import Effort, draw, table
    from redres_ros.simulation.report import progress_bar
    from redres_ros.waypoints import load_task

    task = load_task(options.task)
    out = made(options.out)
    model = RobotModel.named(task.robot, dynamics=options.dynamics)
    recordings = {}
    laws = [_law_and_damping(text, options.damping) for text in options.laws.split(',')]
    controllers = {
        f'{name}, k_d = {law.damping:g} 1/s': Controller(model, law, options.period)
        for name, law in ((name, make_law(name, **gains)) for name, gains in laws)
    }
    for label, controller in controllers.items():
        with progress_bar(label) as progress:
            recordings[label] = run(controller, task, progress=progress)
        recordings[label].write_csv(out / f'{label.split(",")[0]}_{controller.law.damping:g}.csv')
    draw(
        recordings,
        f'{options.task}, T = {1e3 * options.period:g} ms, ideal arm',
        out / 'comparison.png',
    )
    print(table({label: Effort.of(recording, model) for label, recording in recordings.items()}))
    print(f'plot {out}/comparison.png, every tick in {out}/*.csv')
    return 0 if all(recording.finished for recording in recordings.values()) else 1


def _law_and_damping(text: str, damping: float | None) -> tuple[str, dict[str, float]]:
    name, at, own = text.strip().partition('@')
    try:
        return name, {'damping': float(own)} if at else {} if damping is None else {
            'damping': damping
        }
    except ValueError:
        raise OptionError(
            f'--laws {text}; expected a name or NAME@DAMPING, as minimum_acceleration@5'
        ) from None


def _reproduce(options: argparse.Namespace) -> int:
    from redres_ros.paper.claims import CLAIMS, check_all, table, write_csv
    from redres_ros.paper.figures import Runs, draw_all
    from redres_ros.simulation.report import progress_bar

    runs = Runs()
    out = made(options.out)
    with progress_bar('figures') as progress:
        draw_all(out, progress, runs)
    with progress_bar('claims') as progress:
        findings = check_all(CLAIMS, runs, progress)
    write_csv(findings, out / 'claims.csv')
    print(table(findings))
    print(f'figures {out}/figure_*.png, table {out}/claims.csv')
    return 0
