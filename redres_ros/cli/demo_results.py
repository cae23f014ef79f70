"""What `redres demo` prints before and after a run, and the files that it writes."""

import argparse
from collections.abc import Iterable
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING

from redres_ros.cli.files import prepare
from redres_ros.cli.parser import OptionError

if TYPE_CHECKING:
    from redres_ros.demo.demo import Demo
    from redres_ros.demo.figures import MotionFigures
    from redres_ros.demo.outcome import Outcome
    from redres_ros.demo.processes import DemoOptions
    from redres_ros.robot_model import RobotModel

_PAGE = '.html'
_MESSAGES = '.mcap'
_FILMS = {'.mp4': 'imageio_ffmpeg', '.webp': 'PIL', '.gif': 'PIL'}  # and what writes them


def before(options: 'DemoOptions', model: 'RobotModel') -> str:
    """An introduction to a run.

    Args:
        options: Options of the demo.
        model: Model of the arm.
    """
    joints = len(model.joint_names)
    nodes = 'three ROS 2 nodes in one process' if options.composed else 'three ROS 2 nodes'
    if options.teleop:
        return (
            f'A simulated operator steers the tip of an arm with {joints} joints to goals, for '
            f'{options.teleop:g} s, by {nodes} at {options.rate:g} Hz. The operator knows nothing '
            'of the joints. Where limits act, translation and rotation are scaled separately, so '
            'that the arm seldom stops.'
        )
    matter = 'this choice decides how smoothly the arm moves'
    if options.task == 'rectangle':  # a task of the paper's arm
        matter = (
            'near the stretched arm, 7 s into the task, it decides whether the arm gets through'
        )
    return (
        f'A simulated arm with {joints} joints moves its tip along a task, '
        f'controlled by {nodes} at {options.rate:g} Hz. '
        'Infinitely many joint motions execute the task. '
        f'In every cycle the law {options.law} chooses one; {matter}.'
    )


def after(outcome: 'Outcome', options: 'DemoOptions', robot: str) -> str:
    """Two sentences on the result of a run; empty if there is nothing to add.

    Args:
        outcome: Outcome of the run.
        options: Options of the demo.
        robot: That of the task.
    """
    if outcome.motion is None or outcome.interrupted:
        return ''
    if outcome.stop_reason.startswith('timing'):
        return (
            'The robot stopped the arm because commands came too late: this computer was too busy. '
            'Try again, or use --lockstep, which waits for every command.'
        )
    # What follows was measured with the paper's task and arm.
    is_papers = (options.task, robot) == ('rectangle', 'lwr4_paper')
    within_limits = 'none' not in options.parameters.get('limits', ())
    if outcome.stop_reason:
        text = (
            'The robot stopped the arm, as a real one would: the law asked for more than the '
            'joints can do.'
        )
        if not within_limits:
            text += ' Within limits (without --limits none) the arm slows down there instead.'
        if is_papers and options.law == 'minimum_velocity':
            text += ' --law minimum_acceleration passes smoothly.'
        return text
    if not outcome.succeeded:
        return ''
    acceleration, at = outcome.motion.acceleration
    if outcome.goals:
        return (
            f'The operator reached {outcome.goals.reached} goals and gave up '
            f'{outcome.goals.given_up}. For comparison: --scaling task scales all of a task '
            'velocity by one factor, and the arm stops far more often.'
        )
    text = (
        f'The arm finished the task, {_how_well(outcome, outcome.motion)}. '
        f'The joint acceleration peaked at {acceleration:.1f} rad/s² after {at:.1f} s.'
    )
    if is_papers and options.law != 'minimum_velocity':
        text += (
            ' For comparison: redres demo --law minimum_velocity --limits none takes the least '
            'velocity in every cycle, and is stopped.'
        )
    return text


def _how_well(outcome: 'Outcome', motion: 'MotionFigures') -> str:
    """How far the tip was from its path; in contact, where it yields, the force instead."""
    import numpy as np

    forces = np.linalg.norm(outcome.forces[:, 1:], axis=1)
    if forces.any():
        return f'pressing with {np.median(forces[forces > 0.0]):.1f} N (median) while it touched'
    return f'at most {1e3 * motion.path_deviation[0]:.1f} mm off its path'


def check_files(paths: Iterable[Path]) -> None:
    """Make the folders of files; refuse those that could not be written at the end, or whose
    libraries are missing.

    Raises OptionError, FileError or ImportError.
    """
    libraries = {**_FILMS, _PAGE: 'viser', _MESSAGES: 'mcap'}
    for path in paths:
        if path.suffix not in libraries:
            endings = ', '.join(libraries)
            raise OptionError(f'--save {path}; expected a name that ends in one of {endings}')
        import_module(libraries[path.suffix])
        prepare(path)


def recording_in(paths: Iterable[Path]) -> Path | None:
    """The file among these that takes all messages. Raises OptionError for a second one."""
    wanted = [path for path in paths if path.suffix == _MESSAGES]
    if len(wanted) > 1:
        raise OptionError(f'--save {wanted[1]}; the messages go to {wanted[0]} already')
    return wanted[0] if wanted else None


def write_results(outcome: 'Outcome', demo: 'Demo', options: argparse.Namespace) -> None:
    """Table to the terminal; summary.json, motion.csv and motion.png to the directory.

    After Ctrl-C there is no picture. To load what draws, and to draw, would take most of the time
    until the terminal is free again.

    Args:
        outcome: Outcome of the run.
        demo: The run.
        options: The command line.
    """
    from redres_ros.simulation.report import print_tables

    out = options.out
    outcome.write_json(out / 'summary.json')
    if outcome.motion:
        outcome.recording.write_csv(out / 'motion.csv')
    print_tables(outcome.table(demo.title))
    if outcome.motion:
        picture = out / 'motion.png'
        picture.unlink(missing_ok=True)  # that of a run before
        if not outcome.interrupted:
            _draw(outcome, demo, picture)
            print(f'plot {picture}')
            _draw_forces(outcome, demo, out / 'contact.png')
        print(f'data {out}/motion.csv')
        for path in options.save or ():
            _save(outcome, demo, path)
    else:
        print('no plot and no data: the task did not begin')


def _save(outcome: 'Outcome', demo: 'Demo', path: Path) -> None:
    """Write a requested file; that of the messages exists already."""
    kind = 'messages'
    if path.suffix in _FILMS:
        from redres_ros.view.film import FilmedMotion, write_film

        filmed = FilmedMotion(outcome.recording, demo.title, demo.options.law)
        write_film([filmed], demo.model, demo.task, path)
        kind = 'film'
    elif path.suffix == _PAGE:
        from redres_ros.view.saved import write_page

        write_page(outcome.recording, demo.model, demo.task, demo.title, path)
        kind = 'page'
    print(f'{kind} {path}')


def _draw_forces(outcome: 'Outcome', demo: 'Demo', path: Path) -> None:
    """Draw the forces, if any were measured."""
    path.unlink(missing_ok=True)  # that of a run before
    if not outcome.forces[:, 1:].any():  # after the column of times
        return
    from redres_ros.simulation.drawing import in_symbols
    from redres_ros.simulation.plots import draw_contact

    draw_contact(outcome.forces, outcome.recording, demo.model, in_symbols(demo.title), path)
    print(f'forces {path}')


def _draw(outcome: 'Outcome', demo: 'Demo', path: Path) -> None:
    """The motion; and what another law would do with an ideal arm on a path that it passes once."""
    from redres_ros.controller import Controller
    from redres_ros.simulation.closed_loop import run
    from redres_ros.simulation.drawing import in_symbols
    from redres_ros.simulation.plots import Remarks, draw_motion

    beside = {}
    if not outcome.endurance and not outcome.goals:
        laws = ['minimum_velocity', 'minimum_acceleration']
        other = next(law for law in laws if law != demo.options.law)
        controller = Controller(demo.model, demo.law(other), outcome.recording.T)
        beside[other] = run(controller, demo.task)
    draw_motion(
        outcome.recording,
        demo.model,
        demo.task,
        in_symbols(demo.title),
        path,
        Remarks(beside, outcome.stop_reason, outcome.switches, demo.options.law),
    )
