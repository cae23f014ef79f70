"""`redres demo`: planner, controller and fake arm as nodes, and what they did in files."""

import argparse
import os
import signal
import textwrap
from dataclasses import replace
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Any, NoReturn

from redres_ros.cli.options import (
    DEMO_LIMITS,
    DURATIONS,
    OptionError,
    add_command,
    add_motion,
    check_writable,
    made,
    option,
)
from redres_ros.errors import RangeError

if TYPE_CHECKING:
    from redres_ros.demo.demo import Demo, DemoOptions
    from redres_ros.demo.outcome import Outcome
    from redres_ros.robot_model import RobotModel

_SWITCHES = (0.0, 1e6)  # [s] after the task began
_WIDTH = 100  # columns of what is said in sentences
_LOGS = [f'{name}.log' for name in ('sim', 'controller', 'planner', 'composed')]


def add(commands: Any) -> None:
    """Declare the subcommand."""
    demo = add_command(
        commands,
        _demo,
        'planner, controller and fake arm as ROS 2 nodes, in real time',
        '--law minimum_velocity --limits none  # the robot stops it',
        '--switch minimum_weighted_torque@6.5  # another law during the motion',
        '--robot my_arm.urdf --tip tool0  # your arm',
        '--task wipe  # press on a table, slide, lift, while the elbow is pushed',
        '--view  # steer it in a browser',
        '--save motion.html  # a page that replays the motion',
    )
    add_motion(demo, limits=DEMO_LIMITS)
    run = demo.add_argument_group('run')
    plant = 'physics, or an ideal arm that follows every command exactly'
    lockstep = 'as fast as possible and deterministic, instead of in real time'
    duration = 'repeat the task, by default side_to_side, for this long [s]; 0: once'
    domain = 'ROS domain; default: one that is free on this machine'
    switch = 'switch the law during the motion; may be repeated'
    option(run, '--period', 'S', 'sampling time T [s]', 0.002)
    option(run, '--switch', 'LAW@SECONDS', switch, action='append')
    option(run, '--plant', None, plant, 'mujoco', choices=('mujoco', 'ideal'))
    run.add_argument('--lockstep', action='store_true', help=lockstep)
    run.add_argument('--composed', action='store_true', help='the three nodes in one process')
    option(run, '--duration', 'S', duration, 0.0, within=DURATIONS)
    option(run, '--domain', 'ID', domain, type=int)

    results = demo.add_argument_group('display and files')
    view = 'a page in the browser to see and steer the nodes, which run until Ctrl-C'
    results.add_argument('--view', action='store_true', help=view)
    option(results, '--out', 'DIR', 'directory for plot, data and logs', Path('redres_demo'))
    save = 'a page that replays the motion in any browser'
    option(results, '--save', 'FILE.html', save, type=Path)


def _demo(options: argparse.Namespace) -> int:
    from redres_ros.files.processes import handle, handled
    from redres_ros.nodes.runtime import own_domain
    from redres_ros.simulation.report import progress_bar

    if options.save is not None:
        _check_page(options.save)
    demo = _make_demo(options)
    handle(signal.default_int_handler, signal.SIGTERM)  # as Ctrl-C, which keeps the results
    with (
        own_domain(options.domain) as domain,
        progress_bar(f'{options.law} at {demo.options.rate:g} Hz') as progress,
    ):
        _say(before(demo.options, demo.model))
        print(
            f'ROS domain {domain}; in another terminal: redres watch --domain {domain}', flush=True
        )
        demo.run(progress, _say)
    if demo.interrupted:
        print(f'ended; results go to {options.out}, unless Ctrl-C comes again', flush=True)
    # No process is left to end, and a library would turn the exception into another error.
    with handled(_end_at_once, signal.SIGINT, signal.SIGTERM):
        outcome = demo.outcome()
        _write_results(outcome, demo, options)
        _say(after(outcome, demo.options, demo.task.robot))
    if outcome.interrupted:
        return 130
    return 0 if outcome.ending == 'finished' else 1


def _make_demo(options: argparse.Namespace) -> 'Demo':
    """The run that is asked for. Raises RedresError for what a node would refuse."""
    from redres_ros.cli.motion import find_motion, node_parameters
    from redres_ros.demo.demo import START_PATIENCE, Demo, DemoOptions
    from redres_ros.loop.cycle_counter import RATES

    slowest, fastest = RATES
    if not 1.0 / fastest <= options.period <= 1.0 / slowest:
        raise RangeError('--period', options.period, 1.0 / fastest, 1.0 / slowest, 's')
    default = 'side_to_side' if options.duration else 'rectangle'
    switches = tuple(map(_switch, options.switch or ()))
    motion = find_motion(options, [options.law, *(law for law, _ in switches)], default)
    page: dict[str, Any] = {'patience': START_PATIENCE}  # parameters of the node that serves it
    if options.plugin:
        page['plugins'] = tuple(map(os.path.abspath, options.plugin))
    demo_options = DemoOptions(
        motion.name,
        options.law,
        1.0 / options.period,
        options.dynamics,
        switches,
        options.lockstep,
        options.composed,
        options.duration,
        page if options.view else None,
        {'plant': options.plant, **node_parameters(motion)},
    )
    out = made(options.out, 'motion.csv', 'motion.png', 'contact.png', 'summary.json', *_LOGS)
    demo = Demo(
        demo_options,
        motion.task,
        motion.model,
        lambda law: motion._replace(case=replace(motion.case, law=law)).law,
        out,
    )
    motion.controller()
    return demo


def _switch(text: str) -> tuple[str, float]:
    law, _, moment = text.partition('@')
    try:
        seconds = float(moment)
    except ValueError:
        raise OptionError(
            f'--switch {text}; expected LAW@SECONDS, such as minimum_velocity@4.5'
        ) from None
    if not _SWITCHES[0] <= seconds <= _SWITCHES[1]:
        raise RangeError(f'the time of --switch {text}', seconds, *_SWITCHES, 's')
    return law, seconds


def _check_page(path: Path) -> None:
    """Refuse a page that could not be written at the end, or without what makes it."""
    if path.suffix != '.html':
        raise OptionError(f'--save {path}; expected a name that ends in .html')
    import_module('viser')
    check_writable(path)
    made(path.parent)


def _say(text: str) -> None:
    """Print some sentences; nothing for none."""
    if text:
        print(textwrap.fill(text, _WIDTH), flush=True)


def _end_at_once(number: int, _: object) -> NoReturn:
    """End the process at a signal, in place of an exception."""
    os._exit(128 + number)


def before(options: 'DemoOptions', model: 'RobotModel') -> str:
    """An introduction to a run."""
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
    """Two sentences on the result of a run of that robot; empty if there is nothing to add."""
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
    if outcome.ending != 'finished':
        return ''
    acceleration, at = outcome.motion['acceleration']
    text = (
        f'The arm finished the task, {_how_well(outcome, outcome.motion["path_deviation"][0])}. '
        f'The joint acceleration peaked at {acceleration:.1f} rad/s² after {at:.1f} s.'
    )
    if is_papers and options.law != 'minimum_velocity':
        text += (
            ' For comparison: redres demo --law minimum_velocity --limits none takes the least '
            'velocity in every cycle, and is stopped.'
        )
    return text


def _how_well(outcome: 'Outcome', path_deviation: float) -> str:
    """How far the tip was from its path; in contact, where it yields, the force instead."""
    import numpy as np

    forces = np.linalg.norm(outcome.forces[:, 1:], axis=1)
    if forces.any():
        return f'pressing with {np.median(forces[forces > 0.0]):.1f} N (median) while it touched'
    return f'at most {1e3 * path_deviation:.1f} mm off its path'


def _write_results(outcome: 'Outcome', demo: 'Demo', options: argparse.Namespace) -> None:
    """Table to the terminal; summary.json, motion.csv and motion.png to the directory.

    After Ctrl-C there is no picture. To load what draws, and to draw, would take most of the time
    until the terminal is free again.
    """
    from redres_ros.simulation.report import print_tables

    out = options.out
    outcome.write_json(out / 'summary.json')
    print_tables(outcome.table(demo.title))
    if not outcome.motion:
        print('no plot and no data: the task did not begin')
        return
    outcome.recording.write_csv(out / 'motion.csv')
    for name in ('motion.png', 'contact.png'):
        (out / name).unlink(missing_ok=True)  # those of a run before
    if not outcome.interrupted:
        _draw(outcome, demo, out)
    print(f'data {out}/motion.csv')
    if options.save is not None:
        from redres_ros.view.scene import write_page

        write_page(outcome.recording, demo.model, demo.task, demo.title, options.save)
        print(f'page {options.save}')


def _draw(outcome: 'Outcome', demo: 'Demo', out: Path) -> None:
    """The motion, beside what another law would do with an ideal arm on a path that it passes once;
    and the forces, if any were measured.
    """
    from redres_ros.controller import Controller
    from redres_ros.simulation.closed_loop import run
    from redres_ros.simulation.plots import Remarks, draw_contact, draw_motion

    recording = outcome.recording
    beside = {}
    if not outcome.endurance:
        laws = ['minimum_velocity', 'minimum_acceleration']
        other = next(law for law in laws if law != demo.options.law)
        beside[other] = run(Controller(demo.model, demo.law(other), recording.T), demo.task)
    remarks = Remarks(beside, outcome.stop_reason, outcome.switches, demo.options.law)
    draw_motion(recording, demo.model, demo.task, demo.title, out / 'motion.png', remarks)
    print(f'plot {out}/motion.png')
    if outcome.forces[:, 1:].any():  # after the column of times
        draw_contact(outcome.forces, recording, demo.model, demo.title, out / 'contact.png')
        print(f'forces {out}/contact.png')
