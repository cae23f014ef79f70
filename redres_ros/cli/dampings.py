"""`redres dampings`: how much null-space damping is good for an arm."""

import argparse
from typing import Any

from redres_ros.cli.options import add_laws, add_robot
from redres_ros.cli.parser import OptionError, add_command, option

_LAWS = 'minimum_acceleration'


def add(commands: Any) -> None:
    """Declare the subcommand."""
    dampings = add_command(
        commands,
        'dampings',
        'the damping that suits an arm, from many random tasks, without ROS',
        '--robot iiwa7 --tasks 20 --period 0.01',
    )
    add_robot(dampings, 'lwr4_paper')
    add_laws(dampings, _LAWS, 'names of `redres laws`')
    option(dampings, '--tasks', 'N', 'random tasks', 200, within=(1, 100_000, ''))
    option(dampings, '--period', 'S', 'sampling time T [s]', 0.005, within=(1e-4, 0.01, 's'))
    dampings.set_defaults(run=_dampings)


def _dampings(options: argparse.Namespace) -> int:
    from redres_ros.simulation.case import Case
    from redres_ros.simulation.report import print_tables, progress_bar
    from redres_ros.simulation.summary import damping_table, sweep

    laws = _laws(options.laws)
    base = Case(
        options.robot,
        T=options.period,
        tip_frame=options.tip or '',
        elbow_frame=options.elbow or '',
        dynamics=options.dynamics,
    )
    with progress_bar(f'{options.tasks} tasks') as progress:
        results = sweep(base, laws, options.tasks, progress)
    title = f'{options.tasks} random tasks, {options.robot}, T = {1e3 * options.period:g} ms'
    print_tables(*(damping_table(trials, title) for trials in results))
    return 0


def _laws(text: str) -> list[str]:
    """The laws' names. Raises RedresError for an unknown one, or one without damping."""
    from redres_ros.laws import make_law

    names = [name.strip() for name in text.split(',')]
    for name in names:
        if not make_law(name).has_memory:
            raise OptionError(f'--law {text}; {name} has no velocity history, and so no damping')
    return names
