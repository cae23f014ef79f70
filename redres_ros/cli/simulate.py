"""`redres simulate`: one law in the paper's ideal loop."""

import argparse
from pathlib import Path
from typing import Any

from redres_ros.cli.options import add_loop, add_motion
from redres_ros.cli.parser import add_command, option


def add(commands: Any) -> None:
    """Declare the subcommand."""
    simulate = add_command(
        commands,
        'simulate',
        "the paper's ideal loop, without ROS",
        '--law minimum_velocity --out motion.csv',
        '--limits position,velocity,acceleration --period 0.002',
        '--prefer posture=4 --task my_task.yaml',
    )
    add_motion(simulate)
    loop = add_loop(simulate)
    switching = (
        'when the next segment begins: at_rest, or within_tolerance of the point; '
        "default: the task's own"
    )
    option(loop, '--switching', 'RULE', switching)
    option(loop, '--switch-time', 'S', 'blend the start of the motion over this time [s]', 0.0)
    delay = 'the arm uses each reference this many ticks late'
    option(loop, '--delay', 'TICKS', delay, 0, within=(0, 1000, 'ticks'))
    option(loop, '--out', 'FILE.csv', 'write every tick at full precision', type=Path)
    simulate.set_defaults(run=_simulate)


def _simulate(options: argparse.Namespace) -> int:
    from dataclasses import replace

    from redres_ros.cli.files import check_writable
    from redres_ros.cli.motion import find_contrast
    from redres_ros.simulation.closed_loop import run
    from redres_ros.simulation.report import peaks, print_tables, progress_bar

    motion = find_contrast(options, [options.law])
    task = motion.task
    if options.switching:
        task = replace(task, switching=options.switching)
    controller = motion.controller(options.switch_time)
    if options.out:
        check_writable(options.out)
    with progress_bar(f'{options.law}, T = {1e3 * options.period:g} ms') as progress:
        recording = run(
            controller, task, delay=options.delay, greedy=options.greedy, progress=progress
        )
    if options.out:
        recording.write_csv(options.out)
    print_tables(peaks({options.law: recording}))
    print(f'{recording.ending}; {motion.title}')
    if options.out:
        print(f'{len(recording.data)} rows in {options.out}')
    for remark in motion.model.arm.remarks():
        print(remark)
    return 0 if recording.finished else 1
