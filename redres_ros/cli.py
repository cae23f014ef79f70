"""The command `redres`."""

import argparse
import sys
from pathlib import Path

from redres_ros.errors import RangeError, RedresError


def main(arguments: list[str] | None = None) -> int:
    """Run one subcommand; 0 only when the thing asked for happened, 1 when it did not, 2 for a wrong command line."""
    options = _parser().parse_args(arguments)
    try:
        return options.run(options)
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
    simulate = commands.add_parser('simulate', help="the paper's ideal loop, without ROS", formatter_class=_Help)
    _add_law(simulate)
    simulate.add_argument('--period', type=float, default=0.001, metavar='S', help='sampling time T [s]')
    simulate.add_argument('--task', default='rectangle', metavar='NAME|FILE.yaml', help='points to pass')
    simulate.add_argument('--dynamics', metavar='NAME', help="cylinders (Section 5.2) or lwr; default: the task's robot's own")
    simulate.add_argument('--switching', metavar='RULE', help="at_rest or within_tolerance; default: the task's own")
    simulate.add_argument('--switch-time', type=float, default=0.0, metavar='S', help='blend the start over this time [s]')
    simulate.add_argument('--delay', type=int, default=0, metavar='TICKS', help='the arm uses each reference this many ticks late')
    simulate.add_argument('--out', type=Path, metavar='FILE.csv', help='write every tick at full precision')
    simulate.set_defaults(run=_simulate)
    laws = commands.add_parser('laws', help='the laws and their equations')
    laws.set_defaults(run=_laws)
    return parser


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
    law = make_law(options.law, **_damping(options))
    controller = Controller(model, law, options.period, switch_time=options.switch_time)
    with progress_bar(f'{options.law}, T = {1e3 * options.period:g} ms') as progress:
        recording = run(controller, task, delay=options.delay, progress=progress)
    if options.out:
        recording.write_csv(options.out)
    print(peaks({options.law: recording}))
    print(f'{recording.ending}' + (f'; {len(recording.data)} rows in {options.out}' if options.out else ''))
    return 0 if recording.finished else 1


def _damping(options: argparse.Namespace) -> dict[str, float]:
    """k_d from either way of giving it; empty when neither is given."""
    if options.forgetting_factor is None:
        return {} if options.damping is None else {'damping': options.damping}
    if not 0.0 <= options.forgetting_factor <= 1.0:
        raise RangeError('forgetting factor', options.forgetting_factor, 0.0, 1.0)
    return {'damping': (1.0 - options.forgetting_factor) / options.period}


def _laws(options: argparse.Namespace) -> int:
    import inspect

    from redres_ros.laws import LAWS

    for name, law in LAWS.items():
        print(f'{name:<26}{inspect.getdoc(law)}')
    return 0


if __name__ == '__main__':
    sys.exit(main())
