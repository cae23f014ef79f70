"""`redres check`: look at a running graph, and say what is missing before the arm moves."""

import argparse
from typing import TYPE_CHECKING, Any

from redres_ros.cli.options import add_domain, add_namespace, topic_name
from redres_ros.cli.parser import add_command
from redres_ros.errors import RangeError

if TYPE_CHECKING:
    from redres_ros.preflight.verdict import ExpectedArm

_SHORTEST = 0.5  # [s]
_LONGEST = 60.0


def add(commands: Any) -> None:
    """Declare the subcommand."""
    check = add_command(
        commands,
        'check',
        'what is missing before a connected arm may move',
        '--robot iiwa7 --rate 100  # before the controller is started',
        '# beside a controller that runs',
    )
    check.add_argument(
        '--duration', type=float, default=4.0, metavar='S', help='for how long to look'
    )
    check.add_argument(
        '--robot',
        metavar='NAME|FILE.urdf|topic',
        help="the arm, where no controller runs yet; default: the controller's",
    )
    check.add_argument(
        '--tip', metavar='FRAME', help='link that carries out the task, with --robot'
    )
    check.add_argument(
        '--rate', type=float, default=500.0, metavar='HZ', help='states a second, with --robot'
    )
    check.add_argument(
        '--states',
        type=topic_name,
        default='joint_states',
        metavar='TOPIC',
        help='where the states are published',
    )
    add_domain(check)
    add_namespace(check)
    check.set_defaults(run=_check)


def _check(options: argparse.Namespace) -> int:
    from redres_ros.loop.cycle_counter import RATES
    from redres_ros.nodes.discovery import joined_domain
    from redres_ros.nodes.runtime import spun
    from redres_ros.preflight.graph import judge
    from redres_ros.preflight.graph_snapshot import SnapshotNode
    from redres_ros.preflight.verdict import Level

    if not _SHORTEST <= options.duration <= _LONGEST:
        raise RangeError('duration', options.duration, _SHORTEST, _LONGEST, 's')
    if not RATES[0] <= options.rate <= RATES[1]:
        raise RangeError('rate', options.rate, *RATES, 'Hz')
    wanted = _wanted(options)

    def make() -> SnapshotNode:
        return SnapshotNode(options.namespace, options.states)

    with joined_domain(options.domain), spun(make) as node:
        seen = node.look(options.duration)
    verdicts = judge(seen, wanted)
    for verdict in verdicts:
        print(verdict)
    faults = sum(verdict.level is Level.FAULT for verdict in verdicts)
    print(f'faults: {faults}; do not move the arm yet' if faults else 'nothing is missing')
    return 1 if faults else 0


def _wanted(options: argparse.Namespace) -> 'ExpectedArm | None':
    from redres_ros.preflight.verdict import ExpectedArm

    if options.robot is None:
        return None
    return ExpectedArm(options.robot, options.tip or '', options.rate)
