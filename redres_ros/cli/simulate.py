"""`redres simulate` and `redres compare`: motions in the paper's ideal loop, without ROS."""

import argparse
import signal
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from redres_ros.cli.options import (
    DEMO_LIMITS,
    NONE,
    OptionError,
    add_command,
    add_loop,
    add_motion,
    check_writable,
    made,
    number_in,
    option,
)

if TYPE_CHECKING:
    from redres_ros.simulation.batch import Case
    from redres_ros.simulation.recording import Recording

_LAWS = 'minimum_velocity,minimum_acceleration,minimum_weighted_torque'
_MOST_TASKS = 1_000_000

_Laws = list[tuple[str, float | None]]  # names, and dampings [1/s]; None: that of the options


def add(commands: Any) -> None:
    """Declare the subcommands."""
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
    option(loop, '--out', 'FILE.csv', 'write every tick at full precision', type=Path)

    compare = add_command(
        commands,
        _compare,
        'laws side by side on a task, without ROS',
        '--law minimum_velocity,minimum_acceleration@5 --period 0.004',
        '--law minimum_acceleration@2,minimum_acceleration@5  # two dampings',
        '--limits position,velocity,acceleration --limit-scale 0.5',
        '--robot fr3 --tasks 50 --kind near_singular --period 0.005',
    )
    add_motion(compare, several_laws=_LAWS)
    many = compare.add_argument_group('many tasks')
    tasks = 'compare on this many random tasks instead of one'
    kinds = 'kinds of these tasks: random (default), near_singular, long (a minute there and '
    kinds += 'back), or task files'
    option(many, '--tasks', 'N', tasks, type=int, within=(1, _MOST_TASKS, ''))
    option(many, '--kind', 'KIND|FILE.yaml,...', kinds)
    loop = add_loop(compare)
    option(loop, '--out', 'DIR', 'directory for plots and data', Path('redres_compare'))


def _simulate(options: argparse.Namespace) -> int:
    from redres_ros.cli.motion import find_motion
    from redres_ros.simulation.closed_loop import run
    from redres_ros.simulation.report import peak_table, print_tables, progress_bar

    motion = find_motion(options, [options.law])
    task = motion.task
    controller = motion.controller(options.switch_time)
    if options.out:
        check_writable(options.out)
    with progress_bar(f'{options.law}, T = {1e3 * options.period:g} ms') as progress:
        recording = run(controller, task, greedy=options.greedy, progress=progress)
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
    if options.tasks is not None:
        return _compare_many(options)
    if options.kind is not None:
        raise OptionError(f'--kind {options.kind} is for many tasks; expected --tasks N as well')
    return _compare_one(options)


def _compare_many(options: argparse.Namespace) -> int:
    from redres_ros.cli.motion import find_case
    from redres_ros.files.processes import handle
    from redres_ros.simulation.batch import batch
    from redres_ros.simulation.random_tasks import RANDOM_TASKS
    from redres_ros.simulation.report import print_tables, progress_bar, summary_tables

    if options.task:
        raise OptionError(f'--task {options.task} is one task; --tasks makes random ones')
    laws = _laws(options)
    contenders = _contenders(find_case(options, [name for name, _ in laws]), laws)
    cases = [
        replace(case, task=kind, seed=seed)
        for kind in (options.kind or 'random').split(',')
        for seed in range(options.tasks if kind in RANDOM_TASKS else 1)
        for case in contenders.values()
    ]
    results = []
    handle(signal.default_int_handler, signal.SIGTERM)  # of `timeout`, or of Slurm: as Ctrl-C
    with suppress(KeyboardInterrupt), progress_bar(f'{len(cases)} motions') as progress:
        for result in batch(cases, plugins=True):  # that --plugin names
            results.append(result)
            progress(len(results) / len(cases))
    print_tables(*summary_tables(results))
    if len(results) < len(cases):
        print(f'ended after {len(results)} of {len(cases)} motions')
    return 0 if len(results) == len(cases) else 1


def _compare_one(options: argparse.Namespace) -> int:
    from redres_ros.cli.motion import find_motion
    from redres_ros.simulation.batch import in_parallel
    from redres_ros.simulation.closed_loop import run
    from redres_ros.simulation.plots import draw_norms, save
    from redres_ros.simulation.recording import Effort
    from redres_ros.simulation.report import comparison_tables, print_tables, progress_bar

    laws = _laws(options)
    motion = find_motion(options, [name for name, _ in laws])
    contenders = _contenders(motion.case, laws)
    motions = {name: motion._replace(case=case) for name, case in contenders.items()}
    for each in motions.values():
        each.controller()
    out = options.out
    files: dict[str, Path] = {}  # of the data
    picture = out / 'comparison.png'
    for name in contenders:  # such as minimum_acceleration_5.csv
        files[name] = out / f'{name.replace(", k_d = ", "_").removesuffix(" 1/s")}.csv'
    made(out, *(path.name for path in (picture, *files.values())))

    def compute(name: str) -> 'Recording':
        return run(motions[name].controller(), motion.task, greedy=options.greedy)

    with progress_bar(f'{len(motions)} laws') as progress:
        results = in_parallel(compute, list(motions), progress)
    recordings = dict(zip(motions, results, strict=True))
    efforts = {name: Effort.of(each, motion.model) for name, each in recordings.items()}
    for name, path in files.items():
        recordings[name].write_csv(path)
    title = f'{motion.title}, T = {1e3 * options.period:g} ms, limits: {options.limits}'
    save(draw_norms(recordings, title), picture)
    print_tables(*comparison_tables(efforts, title))
    print(f'plot {picture}')
    print(f'every tick in {out}/*.csv')
    if options.limits == NONE:
        print(f'no limits were on; those of a demo: --limits {DEMO_LIMITS}')
    for remark in motion.model.arm.remarks():
        print(remark)
    return 0 if all(recording.finished for recording in recordings.values()) else 1


def _laws(options: argparse.Namespace) -> _Laws:
    laws: _Laws = []
    for text in options.laws.split(','):
        name, at, own = text.strip().partition('@')
        expected = 'a name or NAME@DAMPING, such as minimum_acceleration@5'
        laws.append((name, number_in('--law', text, own, expected) if at else None))
    return laws


def _contenders(case: 'Case', laws: _Laws) -> 'dict[str, Case]':
    """The cases to compare, by the labels of their laws; a damping of the case is that of all laws
    without one. Raises OptionError if one is named twice.
    """
    from redres_ros.laws import LAWS
    from redres_ros.simulation.report import label

    contenders: dict[str, Case] = {}
    for name, damping in laws:
        gains = dict(case.gains)
        if damping is not None:
            gains['damping'] = damping
        law = LAWS.resolve(name, gains)
        if damping is not None and not law.has_memory:
            raise OptionError(
                f'--law {name}@{damping:g}; {name} has no velocity history, and so no damping'
            )
        if label(law) in contenders:
            raise OptionError(f'--law {label(law)} is named twice')
        contenders[label(law)] = replace(case, law=name, gains=gains)
    return contenders
