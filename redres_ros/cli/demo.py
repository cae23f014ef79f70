"""`redres demo`: planner, controller and fake arm as nodes, and what they did in files."""

import argparse
import json
import os
import signal
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, NoReturn

from redres_ros.cli.options import (
    DEMO_LIMITS,
    NONE,
    add_command,
    add_motion,
    add_out,
    check_writable,
    option,
)

if TYPE_CHECKING:
    from redres_ros.demo.demo import Demo
    from redres_ros.demo.outcome import Outcome

_LOGS = [f'{name}.log' for name in ('sim', 'controller', 'planner')]
_FILES = ('motion.csv', 'motion.png', 'contact.png', 'summary.json', *_LOGS)


def add(commands: Any) -> None:
    demo = add_command(
        commands,
        _demo,
        'planner, controller and fake arm as ROS 2 nodes, in real time',
        '--law minimum_velocity --limits none  # the robot stops it',
        '--robot my_arm.urdf --tip tool0  # your arm',
        '--task wipe  # press on a table, slide, lift, while the elbow is pushed',
        '--view  # steer it in a browser',
    )
    add_motion(demo, limits=DEMO_LIMITS)
    run = demo.add_argument_group('run')
    plant = 'physics, or an ideal arm that follows every command exactly'
    lockstep = 'as fast as possible and deterministic, instead of in real time'
    domain = 'ROS domain; default: one that is free on this machine'
    option(run, '--period', 'S', 'sampling time T [s]', 0.002)
    option(run, '--plant', None, plant, 'mujoco', choices=('mujoco', 'ideal'))
    run.add_argument('--lockstep', action='store_true', help=lockstep)
    option(run, '--domain', 'ID', domain, type=int)

    results = demo.add_argument_group('display and files')
    view = 'a page in the browser to see and steer the nodes, which run until Ctrl-C'
    results.add_argument('--view', action='store_true', help=view)
    add_out(results, 'directory for plot, data and logs', Path('redres_demo'))


def _demo(options: argparse.Namespace) -> int:
    from redres_ros.files.processes import handled
    from redres_ros.nodes.runtime import own_domain
    from redres_ros.simulation.report import progress_bar

    demo = _make_demo(options)
    signal.signal(signal.SIGTERM, signal.default_int_handler)  # as Ctrl-C, which keeps the results
    with own_domain(options.domain) as domain, progress_bar(options.law) as progress:
        print(
            f'ROS domain {domain}; in another terminal: redres watch --domain {domain}', flush=True
        )
        demo.run(progress)
    if demo.interrupted:
        print(f'ended; results go to {options.out}, unless Ctrl-C comes again', flush=True)
    # No process is left to end, and a library would turn the exception into another error.
    with handled(_end_at_once, signal.SIGINT, signal.SIGTERM):
        outcome = demo.outcome()
        _write_results(outcome, demo, options)
    if demo.interrupted:
        return 130
    return 0 if outcome.summary['task'] == 'finished' else 1


def _make_demo(options: argparse.Namespace) -> 'Demo':
    """The run that is asked for. Raises RedresError for what a node would refuse."""
    from redres_ros.cli.motion import find_motions, node_parameters
    from redres_ros.demo.demo import START_PATIENCE, Demo
    from redres_ros.laws import HORIZON
    from redres_ros.loop.cycle_counter import RATES
    from redres_ros.parameter import Parameter, check_value

    check_value('period', options.period, Parameter('', 1.0 / max(RATES), 1.0 / min(RATES)))
    [motion] = find_motions(options, [options.law])
    # As the nodes have it; in lock-step no path is sent ahead.
    gains = {'horizon': 0.0 if options.lockstep else HORIZON, **motion.case.gains}
    motion = motion._replace(case=replace(motion.case, gains=gains))
    motion.law().check_damping(options.period)
    plugins = tuple(map(os.path.abspath, options.plugin or ())) or (NONE,)
    parameters = {**node_parameters(motion), 'plugins': plugins}
    page = {'patience': START_PATIENCE, 'plugins': plugins}
    check_writable(*(options.out / name for name in _FILES))
    motion.controller()
    return Demo(
        motion.task,
        motion.model,
        motion.law,
        {**parameters, 'plant': options.plant, 'lockstep': options.lockstep},
        options.out,
        page if options.view else None,
    )


def _end_at_once(number: int, _: object) -> NoReturn:
    """End the process at a signal, in place of an exception."""
    os._exit(128 + number)


def _write_results(outcome: 'Outcome', demo: 'Demo', options: argparse.Namespace) -> None:
    """Print the table, and write the files; after Ctrl-C no picture, which takes longest."""
    from redres_ros.demo.outcome import summary_table
    from redres_ros.files.text import writing
    from redres_ros.simulation.report import print_tables

    out = options.out
    recording = outcome.recording
    file = out / 'summary.json'
    with writing(file):
        file.write_text(json.dumps(outcome.summary, indent=2) + '\n', encoding='utf-8')
    print_tables(summary_table(outcome.summary, demo.title))
    if not len(recording.data):
        print('no plot and no data: the task did not begin')
        return
    recording.write_csv(out / 'motion.csv')
    for name in ('motion.png', 'contact.png'):
        (out / name).unlink(missing_ok=True)  # those of a run before
    if not demo.interrupted:
        _draw(outcome, demo, out)
    print(f'data {out}/motion.csv')


def _draw(outcome: 'Outcome', demo: 'Demo', out: Path) -> None:
    """The motion; and the forces, if any were measured."""
    from redres_ros.simulation.plots import draw_contact, draw_motion, save

    recording, summary, forces = outcome
    law = demo.parameters['law']
    reason = summary['stop_reason']
    figure = draw_motion(recording, demo.model, demo.task, demo.title, law, reason)
    save(figure, out / 'motion.png')
    print(f'plot {out}/motion.png')
    if forces[:, 1:].any():  # after the column of times
        save(draw_contact(forces, recording, demo.model, demo.title), out / 'contact.png')
        print(f'forces {out}/contact.png')
