"""`redres compare`: laws side by side on a task."""

import argparse
import signal
from collections.abc import Iterable
from contextlib import suppress
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from redres_ros.cli.options import DEMO_LIMITS, add_loop, add_motion, add_out
from redres_ros.cli.parser import NONE, OptionError, add_command, option
from redres_ros.errors import RangeError

if TYPE_CHECKING:
    from redres_ros.cli.task import WantedMotion
    from redres_ros.laws import Law
    from redres_ros.simulation.effort import Effort
    from redres_ros.simulation.recording import Recording

_LAWS = 'minimum_velocity,minimum_acceleration,minimum_weighted_torque'
_PICTURES = ('comparison', 'limits')
_MOST_TASKS = 1_000_000
_CLEAR = 1.5  # ratio of two peaks of acceleration that differ clearly


@dataclass(frozen=True)
class _Contender:
    """One law of the comparison; damping [1/s] None: that of the options."""

    options: argparse.Namespace
    name: str
    damping: float | None

    @property
    def law(self) -> 'Law':
        """The law with its gains."""
        from redres_ros.cli.controller import find_law

        return find_law(self.options, self.name, self.damping)

    @property
    def label(self) -> str:
        """Its label in tables and plots, such as 'minimum_acceleration, k_d = 5 1/s'."""
        from redres_ros.simulation.comparison import label

        return label(self.law)

    @property
    def file_name(self) -> str:
        """Name of its data file, such as minimum_acceleration_5.csv."""
        from redres_ros.simulation.comparison import plain

        law = self.law
        return f'{self.name}_{plain(law.damping)}.csv' if law.has_memory else f'{self.name}.csv'


def add(commands: Any) -> None:
    """Declare the subcommand."""
    compare = add_command(
        commands,
        'compare',
        'laws side by side on a task, without ROS',
        '--law minimum_velocity,minimum_acceleration@5 --period 0.004',
        '--limits position,velocity,acceleration --limit-scale 0.5',
        '--robot fr3 --tasks 50 --kind near_singular --period 0.005',
    )
    add_motion(compare, several_laws=_LAWS)
    many = compare.add_argument_group('many tasks')
    tasks = 'compare on this many random tasks instead of one'
    kinds = 'random (default), near_singular, long (a minute there and back), or task files'
    option(many, '--tasks', 'N', tasks, type=int)
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
    from dataclasses import replace

    from redres_ros.cli.controller import case_of, in_use
    from redres_ros.cli.gains import check_gains
    from redres_ros.files.processes import handle
    from redres_ros.simulation.batch import batch
    from redres_ros.simulation.random_tasks import RANDOM_TASKS
    from redres_ros.simulation.report import print_tables, progress_bar
    from redres_ros.simulation.summary import summary_tables

    if options.task:
        raise OptionError(f'--task {options.task} is one task; --tasks makes random ones')
    if not 1 <= options.tasks <= _MOST_TASKS:
        raise RangeError('tasks', options.tasks, 1, _MOST_TASKS)
    contenders = _contenders(options)
    check_gains(options, in_use(options, *(each.name for each in contenders.values())))
    tasks = [
        (kind, seed)
        for kind in (options.kind or 'random').split(',')
        for seed in range(options.tasks if kind in RANDOM_TASKS else 1)
    ]
    cases = [
        replace(case_of(options, each.law), task=kind, seed=seed)
        for kind, seed in tasks
        for each in contenders.values()
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
    from redres_ros.cli.controller import in_use, make_controller
    from redres_ros.cli.files import made, pictures
    from redres_ros.cli.gains import check_gains
    from redres_ros.cli.task import find_contrast
    from redres_ros.simulation.comparison import draw_limit_usage, picture, tables
    from redres_ros.simulation.drawing import DRAWINGS, save
    from redres_ros.simulation.parallel import in_parallel
    from redres_ros.simulation.report import print_tables, progress_bar

    motion = find_contrast(options)
    contenders = _contenders(options)
    check_gains(options, in_use(options, *(each.name for each in contenders.values())))
    for contender in contenders.values():
        make_controller(options, motion, contender.law, options.period)
    norms, limits = pictures(options.out, *_PICTURES)
    if writes_data := options.out.suffix not in DRAWINGS:
        made(options.out, *(each.file_name for each in contenders.values()))
    with progress_bar(f'{len(contenders)} laws') as progress:
        runs = [(contender, motion) for contender in contenders.values()]
        results = in_parallel(_run, runs, progress)
    recordings: dict[str, Recording] = {}
    efforts: dict[str, Effort] = {}
    for (label, contender), (recording, effort) in zip(contenders.items(), results, strict=True):
        if writes_data:
            recording.write_csv(options.out / contender.file_name)
        recordings[label] = recording
        efforts[label] = effort
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
        print(_on_searched_task(efforts.values()))
    for remark in motion.model.arm.remarks():
        print(remark)
    return 0 if all(recording.finished for recording in recordings.values()) else 1


def _contenders(options: argparse.Namespace) -> dict[str, _Contender]:
    """The laws to compare, by their labels. Raises OptionError if one is named twice."""
    contenders: dict[str, _Contender] = {}
    for text in options.laws.split(','):
        name, at, own = text.strip().partition('@')
        try:
            contender = _Contender(options, name, float(own) if at else None)
        except ValueError:
            raise OptionError(
                f'--law {text}; expected a name or NAME@DAMPING, such as minimum_acceleration@5'
            ) from None
        if at and not contender.law.has_memory:
            raise OptionError(f'--law {text}; {name} has no velocity history, and so no damping')
        if contender.label in contenders:
            raise OptionError(f'--law {options.laws}; {contender.label} is named twice')
        contenders[contender.label] = contender
    return contenders


def _on_searched_task(efforts: 'Iterable[Effort]') -> str:
    """What the peaks of acceleration are worth on a path that was searched for, in a line."""
    peaks = [effort.acceleration for effort in efforts if effort.finished]
    if peaks and max(peaks) < _CLEAR * min(peaks):
        return (
            f'no law differs by more than {_CLEAR:g} times from another, though a path was '
            'searched for on which they do'
        )
    return 'this path was searched for; on random ones: --tasks 20 --kind random,near_singular'


def _run(run_of: tuple[_Contender, 'WantedMotion']) -> tuple['Recording', 'Effort']:
    """The motion of one law; works in a process of its own."""
    from redres_ros.cli.controller import make_controller
    from redres_ros.simulation.closed_loop import run
    from redres_ros.simulation.effort import Effort

    contender, motion = run_of
    options = contender.options
    controller = make_controller(options, motion, contender.law, options.period)
    recording = run(controller, motion.task, greedy=options.greedy)
    return recording, Effort.of(recording, motion.model)
