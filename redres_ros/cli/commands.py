"""`redres reproduce`, `laws`, `view`, `watch` and `check`."""

import argparse
import inspect
from functools import partial
from importlib import import_module
from pathlib import Path
from typing import Any

from redres_ros.cli.options import (
    DURATIONS,
    OptionError,
    add_command,
    add_graph,
    add_out,
    check_writable,
    graph_name,
    option,
    read_settings,
)
from redres_ros.errors import UnknownNameError

_HEADS = {
    'law': 'laws, --law NAME: the quantity to minimise',
    'preference': 'preferences, --prefer NAME=GAIN: a joint-space objective in the null space',
    'task': 'tasks, --secondary NAME: secondary tasks, in order of priority',
    'limit': 'limits, --limits A,B: what every command keeps',
}


def add(commands: Any) -> None:
    claims = "the paper's figures and claims, without ROS"
    reproduce = add_command(commands, _reproduce, claims, '--out figures')
    add_out(reproduce, 'directory for figures and table', Path('redres_reproduce'))

    add_command(
        commands,
        _laws,
        'laws, preferences, tasks and limits with their gains, and arms, by name',
        '# all of them',
        '--plugin my_laws.py  # and those in this file',
    )

    page = 'a page in the browser: see and steer running nodes'
    view = add_command(commands, _view, page, '--domain 42')
    port = 'port of the page on this computer; if it is taken, the next free one'
    option(view, '--port', 'N', port, 8080)
    add_graph(view)

    watch = add_command(
        commands,
        _watch,
        'the live state of running nodes; switches their law',
        '--domain 42',
        '--set law=minimum_velocity  # another law, and its effect',
        '--set limit_scale=0.5 --duration 0  # sets it, and ends',
        '--duration 10 > watch.txt  # not in a terminal: once a second',
    )
    parameters = 'first set these parameters of the controller, all or none'
    end = 'end after this time [s]; default: run until Ctrl-C'
    option(watch, '--set', 'NAME=VALUE', parameters, nargs='+', action='extend')
    option(watch, '--duration', 'S', end, type=float, within=DURATIONS)
    add_graph(watch)

    check = add_command(
        commands,
        _check,
        'what is missing before a connected arm may move',
        '--robot iiwa7 --rate 100  # before the controller is started',
        '# beside a running controller',
    )
    robot = "the arm, while no controller runs yet; default: the controller's"
    option(check, '--duration', 'S', 'how long to observe the graph [s]', 4.0, within=(0.5, 60.0))
    option(check, '--robot', 'NAME|FILE.urdf|topic', robot)
    option(check, '--tip', 'FRAME', 'link that carries out the task, with --robot', '')
    option(check, '--rate', 'HZ', 'rate of the states [Hz], with --robot', 500.0)
    option(check, '--states', 'TOPIC', 'topic of the states', 'joint_states', type=graph_name)
    add_graph(check)


def _reproduce(options: argparse.Namespace) -> int:
    from redres_ros.paper.claim import tables, write_csv
    from redres_ros.paper.claims import CLAIMS
    from redres_ros.paper.figures import draw_all
    from redres_ros.paper.runs import Runs
    from redres_ros.simulation.report import print_tables, progress_bar

    import_module('scipy')  # an extra, asked for before a minute has passed
    runs = Runs()
    out = options.out
    check_writable(out / 'claims.csv')
    with progress_bar('simulations and experiments') as progress:
        runs.prepare(progress)
    with progress_bar('figures') as progress:
        draw_all(out, progress, runs)
    findings = {claim: claim.measure(runs) for claim in CLAIMS}
    write_csv(findings, out / 'claims.csv')
    print_tables(*tables(findings))
    print(f'figures {out}/figure_*.png, table {out}/claims.csv')
    print(
        f'simulations with the {runs.model.arm.dynamics} of Section 5.2, '
        f'experiments with the {runs.experiment_model.arm.dynamics} arm'
    )
    return 0


def _laws(options: argparse.Namespace) -> int:
    from redres_ros.laws import LAWS
    from redres_ros.limits import LIMITS
    from redres_ros.preferences import PREFERENCES
    from redres_ros.robots import ARMS
    from redres_ros.simulation.report import facts, print_tables
    from redres_ros.tasks import TASKS

    shown = []
    gains: dict[str, Any] = {}
    for table in (LAWS, PREFERENCES, TASKS, LIMITS):
        rows = []
        for name, cls in table.items():
            first, _, _ = (inspect.getdoc(cls) or '').partition('\n\n')
            rows.append((name, ' '.join(first.split())))
        shown.append(facts(rows, title=_HEADS[table.kind]))
        gains |= {gain.key: gain for gain in table.gains()}
    rows = [
        (key, f'{gain.parameter.description}; default: {_shown(gain.default)}')
        for key, gain in gains.items()
    ]
    shown.append(facts(rows, title='gains, --set NAME=VALUE'))
    rows = []
    for name, arm in ARMS.items():
        moved = ''
        if arm.base_offset or arm.tool_offset:
            moved = f', base {arm.base_offset:g} m higher, tool of {arm.tool_offset:g} m'
        rows.append((name, f'{len(arm.start)} joints, task {arm.task}{moved}'))
    title = 'robots, --robot NAME: arms; or any other from its URDF file'
    print_tables(*shown, facts(rows, title=title))
    return 0


def _shown(default: Any) -> str:
    if isinstance(default, float):
        return f'{default:g}'
    if isinstance(default, tuple):
        return f'[{", ".join(map(str, default))}]' if default else 'the start'
    return f'{default}' or 'none'


def _view(options: argparse.Namespace) -> int:
    from redres_ros.view.page import main

    words = ['--ros-args', '-p', f'port:={options.port}']
    if options.namespace:
        words += ['-r', f'__ns:=/{options.namespace.lstrip("/")}']
    return main(['redres view', *words], options.domain)


def _watch(options: argparse.Namespace) -> int:
    from redres_ros.graph.watch import Watch
    from redres_ros.nodes.runtime import spun

    texts = options.set or []
    settings = read_settings(texts)
    law, at, _ = str(settings.get('law', '')).partition('@')
    if at:
        expected = f'two settings, such as law={law} horizon=2'
        raise OptionError(f'--set law={settings["law"]}; expected {expected}')
    with spun(lambda: Watch(options.namespace), options.domain) as node:
        if settings:
            present = node.client.parameters('controller')
            for name in sorted(settings.keys() - set(present)):
                raise UnknownNameError('parameter of the controller', name, present)
            node.client.set_parameters('controller', settings)
            print(f'controller: {", ".join(texts)}', flush=True)
            if options.duration == 0.0:
                return 0
        node.run(options.duration)
        return 0 if node.values else 1


def _check(options: argparse.Namespace) -> int:
    from redres_ros.loop.cycle_counter import RATES
    from redres_ros.nodes.runtime import spun
    from redres_ros.parameter import Parameter, check_value
    from redres_ros.preflight.snapshot import SnapshotNode
    from redres_ros.preflight.verdicts import FAULT, ExpectedArm, judge

    check_value('rate', options.rate, Parameter('', *RATES))
    arm = ExpectedArm(options.robot, options.tip, options.rate) if options.robot else None
    make = partial(SnapshotNode, options.namespace, options.states)
    with spun(make, options.domain) as node:
        seen = node.look(options.duration)
    verdicts = judge(seen, arm)
    for verdict in verdicts:
        print(verdict)
    faults = sum(verdict.level == FAULT for verdict in verdicts)
    print(f'faults: {faults}; do not move the arm yet' if faults else 'nothing is missing')
    return 1 if faults else 0
