"""`redres check`: look at a running graph, and say what is missing before the arm moves."""

import argparse
from functools import partial
from typing import Any

from redres_ros.cli.options import add_graph, topic_name
from redres_ros.cli.parser import add_command, option
from redres_ros.errors import RangeError


def add(commands: Any) -> None:
    """Declare the subcommand."""
    check = add_command(
        commands,
        'check',
        'what is missing before a connected arm may move',
        '--robot iiwa7 --rate 100  # before the controller is started',
        '# beside a running controller',
    )
    robot = "the arm, while no controller runs yet; default: the controller's"
    states = 'topic of the states'
    option(
        check, '--duration', 'S', 'how long to observe the graph [s]', 4.0, within=(0.5, 60.0, 's')
    )
    option(check, '--robot', 'NAME|FILE.urdf|topic', robot)
    option(check, '--tip', 'FRAME', 'link that carries out the task, with --robot')
    option(check, '--rate', 'HZ', 'rate of the states [Hz], with --robot', 500.0)
    option(check, '--states', 'TOPIC', states, 'joint_states', type=topic_name)
    add_graph(check)
    check.set_defaults(run=_check)


def _check(options: argparse.Namespace) -> int:
    from redres_ros.loop.cycle_counter import RATES
    from redres_ros.nodes.runtime import joined_domain, spun
    from redres_ros.preflight.snapshot import SnapshotNode
    from redres_ros.preflight.verdicts import ExpectedArm, Level, judge

    if not RATES[0] <= options.rate <= RATES[1]:
        raise RangeError('rate', options.rate, *RATES, 'Hz')
    wanted = None
    if options.robot is not None:
        wanted = ExpectedArm(options.robot, options.tip or '', options.rate)
    make = partial(SnapshotNode, options.namespace, options.states)
    with joined_domain(options.domain), spun(make) as node:
        seen = node.look(options.duration)
    verdicts = judge(seen, wanted)
    for verdict in verdicts:
        print(verdict)
    faults = sum(verdict.level is Level.FAULT for verdict in verdicts)
    print(f'faults: {faults}; do not move the arm yet' if faults else 'nothing is missing')
    return 1 if faults else 0
