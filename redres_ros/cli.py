"""The command `redres`."""

import argparse
import math
import signal
import sys
from pathlib import Path
from typing import Any

from redres_ros.errors import FileError, RangeError, RedresError

_REMEDY = "install everything with: pip install 'redres_ros[ros]'"


class OptionError(RedresError):
    """An option whose text cannot be read."""


def main(arguments: list[str] | None = None) -> int:
    """Run one subcommand; 0 only when the thing asked for happened, 1 when it did not, 2 for a wrong command line."""
    options = _parser().parse_args(arguments)
    try:
        return options.run(options)
    except ModuleNotFoundError as error:
        if (error.name or '').startswith('redres_ros'):
            raise
        print(f'redres {options.command}: the package {error.name} is not installed; {_REMEDY}', file=sys.stderr)
        return 1
    except RedresError as error:
        print(f'redres {options.command}: {error}', file=sys.stderr)
        return 1
    except BrokenPipeError:  # the reader of our output, as in `redres laws | head`, has gone
        sys.stderr.close()
        return 1
    except KeyboardInterrupt:
        return 130


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(prog='redres', description='Redundancy resolution for arms behind a position interface.')
    commands = parser.add_subparsers(dest='command', required=True, metavar='COMMAND')
    _add_demo(commands)
    _add_simulate(commands)
    _add_compare(commands)
    reproduce = commands.add_parser('reproduce', help="the paper's figures and claims, without ROS", formatter_class=_Help)
    reproduce.add_argument('--out', type=Path, default=Path('redres_reproduce'), metavar='DIR', help='directory for figures and table')
    reproduce.set_defaults(run=_reproduce)
    laws = commands.add_parser('laws', help='the laws and their equations')
    laws.set_defaults(run=_laws)
    law = commands.add_parser('law', help='switch the law of a running controller')
    law.add_argument('name', metavar='NAME', help='see `redres laws`')
    law.add_argument('--damping', type=float, metavar='K_D', help='null-space damping [1/s]; default: as it is')
    _add_domain(law)
    law.set_defaults(run=_law)
    watch = commands.add_parser('watch', help='the live state of running nodes')
    watch.add_argument('--duration', type=float, metavar='S', help='end after this time; default: with Ctrl-C')
    _add_domain(watch)
    watch.set_defaults(run=_watch)
    return parser


def _add_simulate(commands: Any) -> None:
    simulate = commands.add_parser('simulate', help="the paper's ideal loop, without ROS", formatter_class=_Help)
    _add_law(simulate)
    _add_loop(simulate)
    simulate.add_argument('--switching', metavar='RULE', help="at_rest or within_tolerance; default: the task's own")
    simulate.add_argument('--switch-time', type=float, default=0.0, metavar='S', help='blend the start over this time [s]')
    simulate.add_argument('--delay', type=int, default=0, metavar='TICKS', help='the arm uses each reference this many ticks late')
    simulate.add_argument('--out', type=Path, metavar='FILE.csv', help='write every tick at full precision')
    simulate.set_defaults(run=_simulate)


def _add_compare(commands: Any) -> None:
    compare = commands.add_parser('compare', help='laws side by side on a task, without ROS', formatter_class=_Help)
    compare.add_argument('--laws', default='minimum_velocity,minimum_acceleration,minimum_weighted_torque', metavar='A,B,...',
                         help='names from `redres laws`, each with a damping of its own if wished, as minimum_acceleration@5')
    compare.add_argument('--damping', type=float, metavar='K_D', help='of the laws that have none of their own; default: 10')
    _add_loop(compare)
    compare.add_argument('--out', type=Path, default=Path('redres_compare'), metavar='DIR', help='directory for plot and data')
    compare.set_defaults(run=_compare)


def _add_loop(parser: argparse.ArgumentParser) -> None:
    parser.add_argument('--period', type=float, default=0.001, metavar='S', help='sampling time T [s]')
    parser.add_argument('--task', default='rectangle', metavar='NAME|FILE.yaml', help='points to pass')
    parser.add_argument('--dynamics', metavar='NAME', help="cylinders (Section 5.2) or lwr; default: the task's robot's own")


def _add_demo(commands: Any) -> None:
    demo = commands.add_parser('demo', help='planner, controller and fake arm as ROS 2 nodes, in real time', formatter_class=_Help)
    _add_law(demo)
    demo.add_argument('--rate', type=float, default=500.0, metavar='HZ', help='cycles per second')
    demo.add_argument('--task', default='rectangle', metavar='NAME|FILE.yaml', help='points to pass')
    demo.add_argument('--dynamics', default='lwr', metavar='NAME', help='lwr (identified) or cylinders, of arm and controller alike')
    demo.add_argument('--switch', action='append', default=[], metavar='LAW@SECONDS', help='switch the law on the way; may be repeated')
    demo.add_argument('--plant', default='mujoco', choices=('mujoco', 'ideal'), help='physics, or an arm that goes exactly where it is told')
    demo.add_argument('--lockstep', action='store_true', help='as fast as it goes and deterministic, instead of in real time')
    demo.add_argument('--domain', type=int, metavar='ID', help='ROS domain; default: one that nobody uses on this machine')
    demo.add_argument('--out', type=Path, default=Path('redres_demo'), metavar='DIR', help='directory for plot, data and logs')
    demo.set_defaults(run=_demo)


def _add_domain(parser: argparse.ArgumentParser) -> None:
    parser.add_argument('--domain', type=int, metavar='ID', help='ROS domain of a running `redres demo`; default: ROS_DOMAIN_ID')


class _Help(argparse.ArgumentDefaultsHelpFormatter):
    """Shows defaults, but not those that are None."""

    def _get_help_string(self, action: argparse.Action) -> str | None:
        return action.help if action.default is None else super()._get_help_string(action)


def _add_law(parser: argparse.ArgumentParser) -> None:
    parser.add_argument('--law', default='minimum_acceleration', metavar='NAME', help='see `redres laws`')
    damping = parser.add_mutually_exclusive_group()
    damping.add_argument('--damping', type=float, metavar='K_D', help='null-space damping k_d [1/s], 0 to 1/T; default: 10')
    damping.add_argument('--forgetting-factor', type=float, metavar='LAMBDA', help='the same as lambda = 1 - k_d T, 0 to 1')


def _simulate(options: argparse.Namespace) -> int:
    from dataclasses import replace

    from redres_ros.controller import Controller
    from redres_ros.experiments.closed_loop import run
    from redres_ros.experiments.report import peaks, progress_bar
    from redres_ros.laws import make_law
    from redres_ros.robot_model import RobotModel
    from redres_ros.tasks import load_task

    task = load_task(options.task)
    if options.switching:
        task = replace(task, switching=options.switching)
    if not 0 <= options.delay <= 1000:
        raise RangeError('delay', options.delay, 0, 1000, 'ticks')
    model = RobotModel.named(task.robot, dynamics=options.dynamics)
    law = make_law(options.law, **_damping(options, options.period))
    controller = Controller(model, law, options.period, switch_time=options.switch_time)
    with progress_bar(f'{options.law}, T = {1e3 * options.period:g} ms') as progress:
        recording = run(controller, task, delay=options.delay, progress=progress)
    if options.out:
        recording.write_csv(options.out)
    print(peaks({options.law: recording}))
    print(f'{recording.ending}' + (f'; {len(recording.data)} rows in {options.out}' if options.out else ''))
    return 0 if recording.finished else 1


def _damping(options: argparse.Namespace, T: float) -> dict[str, float]:
    """k_d from either way of giving it; empty when neither is given."""
    if options.forgetting_factor is None:
        return {} if options.damping is None else {'damping': options.damping}
    if not T > 0.0:
        raise RangeError('period', T, 1e-5, 1.0, 's')
    if not 0.0 <= options.forgetting_factor <= 1.0:
        raise RangeError('forgetting factor', options.forgetting_factor, 0.0, 1.0)
    return {'damping': (1.0 - options.forgetting_factor) / T}


def _demo(options: argparse.Namespace) -> int:
    from redres_ros.experiments.report import progress_bar
    from redres_ros.laws import make_law
    from redres_ros.nodes.demo import Demo, DemoOptions
    from redres_ros.nodes.graph import own_domain
    from redres_ros.tasks import load_task

    task = load_task(options.task)
    damping = _damping(options, 1.0 / options.rate if options.rate else math.inf)
    law = make_law(options.law, **damping)
    wanted = DemoOptions(options.task, options.law, law.damping, options.rate, options.dynamics,
                         tuple(map(_switch, options.switch)), options.lockstep, {'plant': options.plant})
    demo = Demo(wanted, task, _made(options.out))
    signal.signal(signal.SIGTERM, lambda *_: sys.exit(143))  # by way of the clean-up
    with own_domain(options.domain) as domain, progress_bar(f'{options.law} at {options.rate:g} Hz') as progress:
        print(f'ROS domain {domain}; look at it from another terminal with: redres watch --domain {domain}', flush=True)
        outcome = demo.run(progress)
    _write_demo(outcome, demo, task, options.out)
    return 0 if outcome.succeeded else 1


def _write_demo(outcome: Any, demo: Any, task: Any, out: Path) -> None:
    """Table to the terminal, motion.csv and motion.png to the directory."""
    from redres_ros.controller import Controller
    from redres_ros.experiments.closed_loop import run
    from redres_ros.experiments.plots import draw_motion
    from redres_ros.laws import make_law

    outcome.recording.write_csv(out / 'motion.csv')
    other = 'minimum_acceleration' if outcome.law == make_law('minimum_velocity', damping=outcome.law.damping) else 'minimum_velocity'
    ideal = run(Controller(demo.model, make_law(other, damping=outcome.law.damping), outcome.recording.T), task)
    draw_motion(outcome.recording, demo.model, task, outcome.title, out / 'motion.png', beside={other: ideal},
                stopped=outcome.stop_reason)
    print(outcome.table())
    print(f'plot {out}/motion.png, data {out}/motion.csv')


def _made(directory: Path) -> Path:
    try:
        directory.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise FileError(f'cannot make the directory {directory}: {error.strerror}') from None
    return directory


def _compare(options: argparse.Namespace) -> int:
    from redres_ros.controller import Controller
    from redres_ros.experiments.closed_loop import run
    from redres_ros.experiments.comparison import Effort, draw, table
    from redres_ros.experiments.report import progress_bar
    from redres_ros.laws import make_law
    from redres_ros.robot_model import RobotModel
    from redres_ros.tasks import load_task

    task, out = load_task(options.task), _made(options.out)
    model = RobotModel.named(task.robot, dynamics=options.dynamics)
    recordings = {}
    laws = [_law_and_damping(text, options.damping) for text in options.laws.split(',')]
    controllers = {f'{name}, k_d = {law.damping:g} 1/s': Controller(model, law, options.period)
                   for name, law in ((name, make_law(name, **gains)) for name, gains in laws)}
    for label, controller in controllers.items():
        with progress_bar(label) as progress:
            recordings[label] = run(controller, task, progress=progress)
        recordings[label].write_csv(out / f"{label.split(',')[0]}_{controller.law.damping:g}.csv")
    draw(recordings, f'{options.task}, T = {1e3 * options.period:g} ms, ideal arm', out / 'comparison.png')
    print(table({label: Effort.of(recording, model) for label, recording in recordings.items()}))
    print(f'plot {out}/comparison.png, every tick in {out}/*.csv')
    return 0 if all(recording.finished for recording in recordings.values()) else 1


def _reproduce(options: argparse.Namespace) -> int:
    from redres_ros.experiments.claims import CLAIMS, check_all, table, write_csv
    from redres_ros.experiments.figures import Runs, draw_all
    from redres_ros.experiments.report import progress_bar

    runs, out = Runs(), _made(options.out)
    with progress_bar('figures') as progress:
        draw_all(out, progress, runs)
    with progress_bar('claims') as progress:
        findings = check_all(CLAIMS, runs, progress)
    write_csv(findings, out / 'claims.csv')
    print(table(findings))
    print(f'figures {out}/figure_*.png, table {out}/claims.csv')
    return 0


def _law_and_damping(text: str, damping: float | None) -> tuple[str, dict[str, float]]:
    name, at, own = text.strip().partition('@')
    try:
        return name, {'damping': float(own)} if at else {} if damping is None else {'damping': damping}
    except ValueError:
        raise OptionError(f'--laws {text}; expected a name or NAME@DAMPING, as minimum_acceleration@5') from None


def _switch(text: str) -> tuple[str, float]:
    law, _, seconds = text.partition('@')
    try:
        return law, float(seconds)
    except ValueError:
        raise OptionError(f'--switch {text}; expected LAW@SECONDS, as minimum_velocity@4.5') from None


def _law(options: argparse.Namespace) -> int:
    from rclpy.node import Node

    from redres_ros.laws import make_law
    from redres_ros.nodes.client import set_parameters
    from redres_ros.nodes.graph import joined_domain
    from redres_ros.nodes.runtime import spun

    gains = {} if options.damping is None else {'damping': options.damping}
    make_law(options.name, **gains)
    with joined_domain(options.domain), spun(lambda: Node('redres_law')) as node:
        set_parameters(node, 'controller', {'law': options.name, **gains})
    print(f'controller: {options.name}' + ''.join(f', {gain} {value:g} 1/s' for gain, value in gains.items()))
    return 0


def _watch(options: argparse.Namespace) -> int:
    import threading

    from redres_ros.nodes.graph import joined_domain
    from redres_ros.nodes.runtime import spun
    from redres_ros.nodes.watch import Watch, watch

    with joined_domain(options.domain), spun(Watch) as node:
        watch(node, threading.Event(), options.duration)
        return 0 if node.heard else 1


def _laws(options: argparse.Namespace) -> int:
    import inspect

    from redres_ros.laws import LAWS

    for name, law in LAWS.items():
        print(f'{name:<26}{inspect.getdoc(law)}')
    return 0


if __name__ == '__main__':
    sys.exit(main())
