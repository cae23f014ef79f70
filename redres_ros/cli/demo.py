"""`redres demo`: planner, controller and fake arm as nodes."""

import argparse
import os
import signal
import textwrap
from pathlib import Path
from typing import TYPE_CHECKING, Any, NoReturn

from redres_ros.cli.files import made
from redres_ros.cli.options import DEMO_LIMITS, DURATIONS, add_motion, add_out
from redres_ros.cli.parser import OptionError, add_command, option
from redres_ros.errors import RangeError

if TYPE_CHECKING:
    from redres_ros.demo.demo import Demo

_SWITCHES = (0.0, 1e6)  # [s] after the task began
_WIDTH = 100  # columns of what is said in sentences
_LOGS = [f'{name}.log' for name in ('sim', 'controller', 'planner', 'composed')]


def add(commands: Any) -> None:
    """Declare the subcommand."""
    demo = add_command(
        commands,
        'demo',
        'planner, controller and fake arm as ROS 2 nodes, in real time',
        '--law minimum_velocity --limits none  # the robot stops it',
        '--switch minimum_weighted_torque@6.5  # another law during the motion',
        '--robot my_arm.urdf --tip tool0  # your arm',
        '--task wipe  # press on a table, slide, lift, while the elbow is pushed',
        '--view  # steer it in a browser',
        '--save motion.html  # a page that replays the motion',
    )
    add_motion(demo, limits=DEMO_LIMITS)
    _add_run(demo.add_argument_group('run'))
    _add_results(demo)
    demo.set_defaults(run=_demo)


def _add_run(group: Any) -> None:
    """How the nodes run, and for how long."""
    plant = 'physics, or an ideal arm that follows every command exactly'
    lockstep = 'as fast as possible and deterministic, instead of in real time'
    duration = 'repeat the task, by default side_to_side, for this long [s]; 0: once'
    domain = 'ROS domain; default: one that is free on this machine'
    switch = 'switch the law during the motion; may be repeated'
    option(group, '--period', 'S', 'sampling time T [s]', 0.002)
    option(group, '--switch', 'LAW@SECONDS', switch, action='append')
    option(group, '--plant', None, plant, 'mujoco', choices=('mujoco', 'ideal'))
    group.add_argument('--lockstep', action='store_true', help=lockstep)
    group.add_argument('--composed', action='store_true', help='the three nodes in one process')
    option(group, '--duration', 'S', duration, 0.0, within=DURATIONS)
    option(group, '--domain', 'ID', domain, type=int)


def _add_results(parser: Any) -> None:
    """Display and files of the run."""
    view = 'a page in the browser to see and steer the nodes, which run until Ctrl-C'
    save = 'a page that replays the motion in any browser'
    shown = parser.add_argument_group('display')
    shown.add_argument('--view', action='store_true', help=view)
    files = parser.add_argument_group('files')
    add_out(files, 'redres_demo', 'plot, data and logs')
    option(files, '--save', 'FILE.html', save, type=Path)


def _demo(options: argparse.Namespace) -> int:
    from redres_ros.cli.demo_results import after, before, check_page, write_results
    from redres_ros.files.processes import handle, handled
    from redres_ros.nodes.runtime import own_domain
    from redres_ros.simulation.report import progress_bar

    if options.save is not None:
        check_page(options.save)
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
        ending = demo.run(progress, _say)
    if ending.interrupted:
        print(f'ended; results go to {options.out}, unless Ctrl-C comes again', flush=True)
    # No process is left to end, and a library would turn the exception into another error.
    with handled(_end_at_once, signal.SIGINT, signal.SIGTERM):
        outcome = demo.outcome(ending)
        write_results(outcome, demo, options)
        _say(after(outcome, demo.options, demo.task.robot))
    if outcome.interrupted:
        return 130
    return 0 if outcome.succeeded else 1


def _make_demo(options: argparse.Namespace) -> 'Demo':
    """The run that is asked for. Raises RedresError for what a node would refuse."""
    from redres_ros.cli.controller import find_law, in_use, make_controller, node_parameters
    from redres_ros.cli.gains import check_gains
    from redres_ros.cli.task import find_motion
    from redres_ros.demo.demo import Demo
    from redres_ros.demo.processes import DemoOptions

    motion = find_motion(options, 'side_to_side' if options.duration else 'rectangle')
    switches = tuple(map(_switch, options.switch or ()))
    check_gains(options, in_use(options, options.law, *(name for name, _ in switches)))
    wanted = DemoOptions(
        motion.name,
        options.law,
        _rate(options.period),
        options.dynamics,
        switches,
        options.lockstep,
        options.composed,
        options.duration,
        _page_parameters(options) if options.view else None,
        {'plant': options.plant, **node_parameters(options, motion)},
    )
    out = made(options.out, 'motion.csv', 'motion.png', 'contact.png', 'summary.json', *_LOGS)
    demo = Demo(wanted, motion.task, motion.model, lambda law: find_law(options, law), out)
    make_controller(options, motion, find_law(options, options.law), options.period)
    return demo


def _rate(period: float) -> float:
    """Cycles a second [Hz] of a sampling time [s]. Raises RangeError for one that no node takes."""
    from redres_ros.loop.cycle_counter import RATES

    slowest, fastest = RATES
    if not 1.0 / fastest <= period <= 1.0 / slowest:
        raise RangeError('--period', period, 1.0 / fastest, 1.0 / slowest, 's')
    return 1.0 / period


def _page_parameters(options: argparse.Namespace) -> dict[str, Any]:
    """Parameters of the node that serves the page."""
    from redres_ros.demo.demo import START_PATIENCE

    parameters: dict[str, Any] = {'patience': START_PATIENCE}
    if options.plugin:
        parameters['plugins'] = tuple(map(os.path.abspath, options.plugin))
    return parameters


def _say(text: str) -> None:
    """Print some sentences; nothing for none."""
    if text:
        print(textwrap.fill(text, _WIDTH), flush=True)


def _end_at_once(number: int, _: object) -> NoReturn:
    """End the process at a signal, in place of an exception."""
    os._exit(128 + number)


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
