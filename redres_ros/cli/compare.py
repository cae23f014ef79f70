"""`redres compare`: laws side by side on a task, or on many random ones."""

import argparse
import signal
from contextlib import suppress
from dataclasses import replace
from typing import TYPE_CHECKING, Any

from redres_ros.cli.options import DEMO_LIMITS, add_loop, add_motion, add_out
from redres_ros.cli.parser import NONE, OptionError, add_command, option

if TYPE_CHECKING:
    from redres_ros.simulation.batch import Case
    from redres_ros.simulation.effort import Effort
    from redres_ros.simulation.recording import Recording

_LAWS = 'minimum_velocity,minimum_acceleration,minimum_weighted_torque'
_PICTURES = ('comparison', 'limits')
_MOST_TASKS = 1_000_000
_CLEAR = 1.5  # ratio of two peaks of acceleration that differ clearly


def add(commands: Any) -> None:
    """Declare the subcommand."""
    compare = add_command(
        commands,
        'compare',
        'laws side by side on a task, without ROS',
        '--law minimum_velocity,minimum_acceleration@5 --period 0.004',
        '--law minimum_acceleration@2,minimum_acceleration@5  # two dampings',
        '--limits position,velocity,acceleration --limit-scale 0.5',
        '--robot fr3 --tasks 50 --kind near_singular --period 0.005',
    )
    add_motion(compare, several_laws=_LAWS)
    many = compare.add_argument_group('many tasks')
    tasks = 'compare on this many random tasks instead of one'
    kinds = 'random (default), near_singular, long (a minute there and back), or task files'
    option(many, '--tasks', 'N', tasks, type=int, within=(1, _MOST_TASKS, ''))
    option(many, '--kind', 'KIND|FILE.yaml,...', f'kinds of these tasks: {kinds}')
    loop = add_loop(compare)
    add_out(loop, 'redres_compare', 'plots and data', plots=True)
    compare.set_defaults(run=_compare)


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
    from redres_ros.simulation.report import print_tables, progress_bar
    from redres_ros.simulation.summary import summary_tables

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
        for result in batch(cases):
            results.append(result)
            progress(len(results) / len(cases))
    print_tables(*summary_tables(results))
    if len(results) < len(cases):
        print(f'ended after {len(results)} of {len(cases)} motions')
    return 0 if len(results) == len(cases) else 1


def _compare_one(options: argparse.Namespace) -> int:
    from redres_ros.cli.files import made, pictures
    from redres_ros.cli.motion import find_contrast
    from redres_ros.simulation.closed_loop import run
    from redres_ros.simulation.comparison import draw_limit_usage, picture, tables
    from redres_ros.simulation.drawing import DRAWINGS, save
    from redres_ros.simulation.effort import Effort
    from redres_ros.simulation.parallel import in_parallel
    from redres_ros.simulation.report import print_tables, progress_bar

    laws = _laws(options)
    motion = find_contrast(options, [name for name, _ in laws])
    contenders = _contenders(motion.case, laws)
    motions = {label: motion._replace(case=case) for label, case in contenders.items()}
    for each in motions.values():
        each.controller()
    norms, limits = pictures(options.out, *_PICTURES)
    files = {label: options.out / _file_name(case) for label, case in contenders.items()}
    writes_data = options.out.suffix not in DRAWINGS
    if writes_data:
        made(options.out, *(path.name for path in files.values()))

    def compute(label: str) -> 'tuple[Recording, Effort]':
        recording = run(motions[label].controller(), motion.task, greedy=options.greedy)
        return recording, Effort.of(recording, motion.model)

    with progress_bar(f'{len(contenders)} laws') as progress:
        results = in_parallel(compute, list(motions), progress)
    recordings = dict(zip(motions, (recording for recording, _ in results), strict=True))
    efforts = dict(zip(motions, (effort for _, effort in results), strict=True))
    if writes_data:
        for label, recording in recordings.items():
            recording.write_csv(files[label])
    title = f'{motion.title}, T = {1e3 * options.period:g} ms, limits: {options.limits}'
    save(picture(recordings, title), norms)
    save(draw_limit_usage(recordings, motion.model, options.limit_scale, title), limits)
    print_tables(*tables(efforts, title))
    print(f'plots {norms} and {limits}')
    if writes_data:
        print(f'every tick in {options.out}/*.csv')
    if options.limits == NONE:
        print(f'no limits were on; those of a demo: --limits {DEMO_LIMITS}')
    if motion.is_searched:
        print(_on_searched_task([effort.acceleration for _, effort in results if effort.finished]))
    for remark in motion.model.arm.remarks():
        print(remark)
    return 0 if all(recording.finished for recording in recordings.values()) else 1


def _laws(options: argparse.Namespace) -> list[tuple[str, float | None]]:
    """Names of the laws to compare, with dampings [1/s] of their own; None: that of the options."""
    laws: list[tuple[str, float | None]] = []
    for text in options.laws.split(','):
        name, at, own = text.strip().partition('@')
        try:
            laws.append((name, float(own) if at else None))
        except ValueError:
            raise OptionError(
                f'--law {text}; expected a name or NAME@DAMPING, such as minimum_acceleration@5'
            ) from None
    return laws


def _contenders(case: 'Case', laws: list[tuple[str, float | None]]) -> 'dict[str, Case]':
    """The cases to compare, by the labels of their laws; a damping of the case is that of all laws
    without one. Raises OptionError if one is named twice.
    """
    from redres_ros.laws import LAWS
    from redres_ros.simulation.comparison import label

    contenders: dict[str, Case] = {}
    for name, damping in laws:
        gains = dict(case.gains)
        if damping is not None:
            gains['damping'] = damping
        law = LAWS.resolve(name, gains)
        if law.has_memory:
            gains['damping'] = law.damping
        else:
            gains.pop('damping', None)
            if damping is not None:
                raise OptionError(
                    f'--law {name}@{damping:g}; {name} has no velocity history, and so no damping'
                )
        if label(law) in contenders:
            raise OptionError(f'--law {label(law)} is named twice')
        contenders[label(law)] = replace(case, law=name, gains=gains)
    return contenders


def _file_name(case: 'Case') -> str:
    """Name of its data file, such as minimum_acceleration_5.csv."""
    from redres_ros.laws import LAWS
    from redres_ros.simulation.comparison import plain

    has_damping = LAWS[case.law].has_memory
    return f'{case.law}_{plain(case.gains["damping"])}.csv' if has_damping else f'{case.law}.csv'


def _on_searched_task(peaks: list[float]) -> str:
    """What the peaks of acceleration are worth on a path that was searched for, in a line."""
    if peaks and max(peaks) < _CLEAR * min(peaks):
        return (
            f'no law differs by more than {_CLEAR:g} times from another, though a path was '
            'searched for on which they do'
        )
    return 'this path was searched for; on random ones: --tasks 20 --kind random,near_singular'
