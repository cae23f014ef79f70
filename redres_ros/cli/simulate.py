"""`redres simulate` and `redres compare`: motions in the paper's ideal loop, without ROS."""

import argparse
from pathlib import Path
from typing import Any

from redres_ros.cli.options import (
    DEMO_LIMITS,
    NONE,
    OptionError,
    add_command,
    add_loop,
    add_motion,
    add_out,
    check_writable,
    option,
)

_LAWS = 'minimum_velocity,minimum_acceleration,minimum_acceleration@horizon=2'


def add(commands: Any) -> None:
    simulate = add_command(
        commands,
        _simulate,
        "the paper's ideal loop, without ROS",
        '--law minimum_velocity --out motion.csv',
        '--limits position,velocity,acceleration --period 0.002',
        '--prefer posture=4 --task my_task.yaml',
    )
    add_motion(simulate)
    loop = add_loop(simulate)
    blend = 'blend the start of the motion over this time [s]'
    option(loop, '--switch-time', 'S', blend, 0.0)
    add_out(loop, 'write every tick at full precision, into motion.csv', file='motion.csv')

    compare = add_command(
        commands,
        _compare,
        'laws side by side on a task, without ROS',
        '--law minimum_velocity,minimum_acceleration@5 --period 0.004',
        '--law minimum_acceleration@2,minimum_acceleration@5  # two dampings',
        '--law minimum_acceleration@horizon=1,minimum_effort_ahead',
        '--limits position,velocity,acceleration --limit-scale 0.5',
    )
    add_motion(compare, several_laws=_LAWS)
    loop = add_loop(compare)
    add_out(loop, 'directory for plot and data', Path('redres_compare'))


def _simulate(options: argparse.Namespace) -> int:
    from redres_ros.cli.motion import find_motions
    from redres_ros.simulation.closed_loop import run
    from redres_ros.simulation.report import peak_table, print_tables, progress_bar

    [motion] = find_motions(options, [options.law])
    controller = motion.controller(options.switch_time)
    if options.out:
        check_writable(options.out)
    with progress_bar(f'{options.law}, T = {1e3 * options.period:g} ms') as progress:
        recording = run(controller, motion.task, greedy=options.greedy, progress=progress)
    if options.out:
        recording.write_csv(options.out)
    print_tables(peak_table(options.law, recording))
    print(f'{recording.ending}; {motion.title}')
    if options.out:
        print(f'{len(recording.data)} rows in {options.out}')
    for remark in motion.model.arm.remarks():
        print(remark)
    return 0 if recording.finished else 1


def _compare(options: argparse.Namespace) -> int:
    from redres_ros.cli.motion import find_motions
    from redres_ros.simulation.batch import in_parallel
    from redres_ros.simulation.closed_loop import run
    from redres_ros.simulation.optimum import best_motion
    from redres_ros.simulation.plots import draw_norms, save
    from redres_ros.simulation.recording import Effort
    from redres_ros.simulation.report import comparison_tables, label, print_tables, progress_bar

    motions = {}
    files: dict[str, Path] = {}  # of the data, such as minimum_acceleration_5.csv
    for motion in find_motions(options, [text.strip() for text in options.laws.split(',')]):
        name = label(motion.law())
        if name in motions:
            raise OptionError(f'--law {name} is named twice')
        motion.controller()
        motions[name] = motion
        short = name.replace('k_d = ', '').removesuffix(' 1/s')
        files[name] = options.out / f'{short.replace(", ", "_").replace(" ", "_")}.csv'
    picture = options.out / 'comparison.png'
    check_writable(picture, *files.values())

    with progress_bar(f'{len(motions)} laws') as progress:
        results = in_parallel(
            lambda each: run(each.controller(), each.task, greedy=options.greedy),
            list(motions.values()),
            progress,
        )
    recordings = dict(zip(motions, results, strict=True))
    efforts = {
        name: Effort.of(each, motion.model, torque=True) for name, each in recordings.items()
    }
    for name, path in files.items():
        recordings[name].write_csv(path)
    save(draw_norms(recordings, motion.title), picture)
    best = best_motion(motion.model, motion.task, results)
    print_tables(*comparison_tables(efforts, motion.title, best[0] if best else None))
    print(f'plot {picture}')
    print(f'every tick in {options.out}/*.csv')
    if options.limits == NONE:
        print(f'no limits were on; those of a demo: --limits {DEMO_LIMITS}')
    steady = [name for name, each in motions.items() if not each.law().has_memory]
    if steady and (options.prefer or options.damping is not None):
        print(f'preferences and damping do not act on {", ".join(steady)}')
    for remark in motion.model.arm.remarks():
        print(remark)
    return 0 if all(recording.finished for recording in recordings.values()) else 1
