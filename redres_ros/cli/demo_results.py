"""What `redres demo` prints before and after a run, and the files that it writes."""

import argparse
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING

from redres_ros.cli.files import prepare
from redres_ros.cli.parser import OptionError

if TYPE_CHECKING:
    from redres_ros.demo.demo import Demo
    from redres_ros.demo.outcome import MotionFigures, Outcome
    from redres_ros.demo.processes import DemoOptions
    from redres_ros.robot_model import RobotModel

_PAGE = '.html'


def before(options: 'DemoOptions', model: 'RobotModel') -> str:
    """An introduction to a run.

    Args:
        options: Options of the demo.
        model: Model of the arm.
    """
    joints = len(model.joint_names)
    nodes = 'three ROS 2 nodes in one process' if options.composed else 'three ROS 2 nodes'
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


def check_page(path: Path) -> None:
    """Refuse a page that could not be written at the end, or without what makes it.

    Raises OptionError, FileError or ImportError.
    """
    if path.suffix != _PAGE:
        raise OptionError(f'--save {path}; expected a name that ends in {_PAGE}')
    import_module('viser')
    prepare(path)


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
        if options.save is not None:
            from redres_ros.view.scene import write_page

            write_page(outcome.recording, demo.model, demo.task, demo.title, options.save)
            print(f'page {options.save}')
    else:
        print('no plot and no data: the task did not begin')


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
    if not outcome.endurance:
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
