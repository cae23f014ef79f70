"""`redres demo`: planner, controller and fake arm as nodes."""

import argparse
import math
import signal
import sys
from pathlib import Path
from typing import Any

from redres_ros.cli.files import made
from redres_ros.cli.options import OptionError, add_motion
from redres_ros.errors import RangeError

_SWITCHES = (0.0, 1e6)  # [s] after the task began
_LOGS = ('sim.log', 'controller.log', 'planner.log', 'composed.log')  # what the nodes print


def add(commands: Any) -> None:
    """Declare the subcommand."""
    demo = commands.add_parser(
        'demo', help='planner, controller and fake arm as ROS 2 nodes, in real time'
    )
    add_motion(demo)
    demo.add_argument('--rate', type=float, default=500.0, metavar='HZ', help='cycles per second')
    demo.add_argument(
        '--switch',
        action='append',
        default=(),
        metavar='LAW@SECONDS',
        help='switch the law on the way; may be repeated',
    )
    demo.add_argument(
        '--plant',
        default='mujoco',
        choices=('mujoco', 'ideal'),
        help='physics, or an arm that goes exactly where it is told',
    )
    demo.add_argument(
        '--lockstep',
        action='store_true',
        help='as fast as it goes and deterministic, instead of in real time',
    )
    demo.add_argument('--composed', action='store_true', help='the three nodes in one process')
    demo.add_argument(
        '--duration',
        type=float,
        default=0.0,
        metavar='S',
        help='repeat the task for so long, by default the one named side_to_side; 0: once',
    )
    demo.add_argument(
        '--domain',
        type=int,
        metavar='ID',
        help='ROS domain; default: one that nobody uses on this machine',
    )
    demo.add_argument(
        '--out',
        type=Path,
        default=Path('redres_demo'),
        metavar='DIR',
        help='directory for plot, data and logs',
    )
    demo.set_defaults(run=_demo)


def _demo(options: argparse.Namespace) -> int:
    from redres_ros.cli.wanted import (
        check_gains,
        find_law,
        find_task,
        node_parameters,
        task_name,
    )
    from redres_ros.demo.demo import Demo, DemoOptions
    from redres_ros.demo.processes import own_domain
    from redres_ros.simulation.report import progress_bar

    if not 0.0 <= options.duration <= 1e6:
        raise RangeError('duration', options.duration, 0.0, 1e6, 's')
    name = task_name(options, 'side_to_side' if options.duration else 'rectangle')
    task, _ = find_task(options, name)
    law = find_law(options, options.law, 1.0 / options.rate if options.rate else math.inf)
    check_gains(options, {options.law, *(law for law, _ in map(_switch, options.switch))})
    wanted = DemoOptions(
        name,
        options.law,
        law.damping,
        options.rate,
        options.dynamics,
        tuple(map(_switch, options.switch)),
        options.lockstep,
        options.composed,
        options.duration,
        {'plant': options.plant, **node_parameters(options)},
    )
    demo = Demo(wanted, task, made(options.out, 'motion.csv', 'motion.png', *_LOGS))
    signal.signal(signal.SIGTERM, lambda *_: sys.exit(143))  # by way of the clean-up
    with (
        own_domain(options.domain) as domain,
        progress_bar(f'{options.law} at {options.rate:g} Hz') as progress,
    ):
        look = f'redres watch --domain {domain}'
        print(f'ROS domain {domain}; look at it from another terminal with: {look}', flush=True)
        outcome = demo.run(progress)
    _write(outcome, demo, task, options.out)
    return 0 if outcome.succeeded else 1


def _switch(text: str) -> tuple[str, float]:
    law, _, moment = text.partition('@')
    try:
        seconds = float(moment)
    except ValueError:
        raise OptionError(
            f'--switch {text}; expected LAW@SECONDS, as minimum_velocity@4.5'
        ) from None
    if not _SWITCHES[0] <= seconds <= _SWITCHES[1]:
        raise RangeError(f'the time of --switch {text}', seconds, *_SWITCHES, 's')
    return law, seconds


def _write(outcome: Any, demo: Any, task: Any, out: Path) -> None:
    """Table to the terminal, motion.csv and motion.png to the directory."""
    from redres_ros.controller import Controller
    from redres_ros.laws import make_law
    from redres_ros.simulation.closed_loop import run
    from redres_ros.simulation.plots import draw_motion

    outcome.recording.write_csv(out / 'motion.csv')
    gains = {'damping': outcome.law.damping}
    shown = outcome.law == make_law('minimum_velocity', **gains)
    other = 'minimum_acceleration' if shown else 'minimum_velocity'
    ideal = run(Controller(demo.model, make_law(other, **gains), outcome.recording.T), task)
    draw_motion(
        outcome.recording,
        demo.model,
        task,
        outcome.title,
        out / 'motion.png',
        beside={other: ideal},
        stopped=outcome.stop_reason,
    )
    print(outcome.table())
    print(f'plot {out}/motion.png, data {out}/motion.csv')
