"""`redres simulate`: one law in the paper's ideal loop."""

import argparse
from pathlib import Path
from typing import Any

from redres_ros.cli.options import Help, add_law, add_loop, damping
from redres_ros.errors import RangeError


def add(commands: Any) -> None:
    """Declare the subcommand."""
    simulate = commands.add_parser(
        'simulate', help="the paper's ideal loop, without ROS", formatter_class=Help
    )
    add_law(simulate)
    add_loop(simulate)
    simulate.add_argument(
        '--switching', metavar='RULE', help="at_rest or within_tolerance; default: the task's own"
    )
    simulate.add_argument(
        '--switch-time',
        type=float,
        default=0.0,
        metavar='S',
        help='blend the start over this time [s]',
    )
    simulate.add_argument(
        '--delay',
        type=int,
        default=0,
        metavar='TICKS',
        help='the arm uses each reference this many ticks late',
    )
    simulate.add_argument(
        '--out', type=Path, metavar='FILE.csv', help='write every tick at full precision'
    )
    simulate.set_defaults(run=_simulate)


def _simulate(options: argparse.Namespace) -> int:
    from dataclasses import replace

    from redres_ros.controller import Controller
    from redres_ros.laws import make_law
    from redres_ros.robot_model import RobotModel
    from redres_ros.simulation.closed_loop import run
    from redres_ros.simulation.report import peaks, progress_bar
    from redres_ros.waypoints import load_task

    task = load_task(options.task)
    if options.switching:
        task = replace(task, switching=options.switching)
    if not 0 <= options.delay <= 1000:
        raise RangeError('delay', options.delay, 0, 1000, 'ticks')
    model = RobotModel.named(task.robot, dynamics=options.dynamics)
    law = make_law(options.law, **damping(options, options.period))
    controller = Controller(model, law, options.period, switch_time=options.switch_time)
    with progress_bar(f'{options.law}, T = {1e3 * options.period:g} ms') as progress:
        recording = run(controller, task, delay=options.delay, progress=progress)
    if options.out:
        recording.write_csv(options.out)
    print(peaks({options.law: recording}))
    print(
        f'{recording.ending}'
        + (f'; {len(recording.data)} rows in {options.out}' if options.out else '')
    )
    return 0 if recording.finished else 1
