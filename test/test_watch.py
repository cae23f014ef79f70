"""`redres watch`: what its page says, and that it receives the nodes."""

import io
import subprocess
import sys

import pytest

pytest.importorskip('rclpy', reason='needs ROS 2: pip install .[test]')

from rich.console import Console

from redres_ros.graph.monitor import STALE, LastValue, NodeHealth
from redres_ros.graph.watch import _JointBar, _line, _page

FULL = {
    'sim': LastValue(NodeHealth('in command', True), 100.0),
    'sim/session_state': LastValue('CMD', 90.0),
    'sim/stop_reason': LastValue('', 90.0),
    'planner': LastValue(NodeHealth('moving', True), 100.0),
    'planner/state': LastValue('moving', 95.0),
    'planner/task_error': LastValue(0.00025, 100.0),
    'planner/progress': LastValue(0.43, 100.0),
    'controller': LastValue(NodeHealth('commanding', True), 100.0),
    'controller/law': LastValue('minimum_torque', 100.0),
    'controller/tip_pose': LastValue((0.1, -0.2, 0.3), 100.0),
    'controller/joint_torque_norm': LastValue(42.5, 100.0),
}


def text_of(received: dict[str, LastValue], now: float, joints: tuple[_JointBar, ...] = ()) -> str:
    """The page as plain text."""
    console = Console(width=120, record=True, file=io.StringIO())
    console.print(_page(received, now, 7, joints))
    return console.export_text()


def line_of(text: str, label: str) -> str:
    return next(line for line in text.splitlines() if label in line)


def test_where_nobody_is_the_page_says_so_and_what_to_do() -> None:
    text = text_of({}, 100.0)
    assert 'No node of redres_ros runs' in text
    assert 'domain 7' in text
    assert '--domain' in text
    assert 'singular' not in text  # no table of dashes


def test_values_have_units() -> None:
    text = text_of(FULL, 100.5)
    assert '0.25 mm' in line_of(text, 'task error')
    assert '42.5 Nm' in line_of(text, 'joint torque')
    assert '43 %' in line_of(text, 'progress')
    assert '+0.1000  -0.2000  +0.3000 m' in line_of(text, ' tip ')
    assert 'silent' not in text


def test_a_robot_that_has_stopped_comes_first() -> None:
    stopped = {**FULL, 'sim/stop_reason': LastValue('protective stop: joint 1', 100.0)}
    lines = text_of(stopped, 100.5).splitlines()
    at = next(number for number, line in enumerate(lines) if 'The robot has stopped' in line)
    assert 'protective stop: joint 1' in lines[at]
    assert at < next(number for number, line in enumerate(lines) if 'session' in line)
    assert 'The robot has stopped' not in text_of(FULL, 100.5)


def test_a_node_that_has_gone_is_marked_and_no_other() -> None:
    received = dict(FULL)  # the tip is where the robot's own states say
    own = [source for source in FULL if source.startswith('controller')]
    for source in set(own) - {'controller/tip_pose'}:
        received[source] = LastValue(received[source].value, 100.0 - 2.0 * STALE)
    text = text_of(received, 100.5)
    assert 'controller: silent for 6 s' in text
    assert text.count('silent for') == 1
    assert text_of(FULL, 112.0).count('silent for 12 s') == 3


def test_a_joint_stands_where_it_is_in_its_range_beside_the_limits_that_act() -> None:
    low = _JointBar('shoulder', 0.0, -1.0, ())
    high = _JointBar('elbow', 1.2, 2.0, ('acceleration', 'position'))
    text = text_of(FULL, 100.5, (low, _JointBar('middle', 0.5, 0.0, ()), high))
    bars = [line_of(text, name) for name in ('shoulder', 'middle', 'elbow')]
    before = [bar.partition('●')[0].count('─') for bar in bars]
    after = [bar.partition('●')[2].count('─') for bar in bars]
    assert before[0] == after[2] == 0 and before[1] == after[1] > 0
    assert 'acceleration   position' in bars[2] and 'acceleration' not in bars[0]
    assert '+114.6°' in bars[2]


def test_a_line_reports_what_matters_most_and_who_is_not_there() -> None:
    there = {
        source: received for source, received in FULL.items() if not source.startswith('planner')
    }
    assert _line(there, 100.5, 7) == (
        'session CMD, stop reason none, planner no message, law minimum_torque'
    )
    assert 'controller silent for 12 s' in _line(FULL, 112.0, 7)
    assert _line({}, 100.0, 7) == 'no node in domain 7'


WATCH = [sys.executable, '-m', 'redres_ros.cli', 'watch', '--domain']


def watch_until(domain: int, *words: str) -> subprocess.CompletedProcess[str]:
    """What is shown by looks, each twice as long as the one before, until all words are among it.

    On a busy machine it takes long for the nodes to start, and for each look to find them.
    """
    for duration in ('2', '4', '8', '16', '32'):
        options = [*WATCH, str(domain), '--duration', duration]
        done = subprocess.run(options, capture_output=True, text=True, timeout=150.0, check=False)
        if all(word in done.stdout for word in words):
            break
    return done


@pytest.mark.slow
def test_a_reader_of_lines_gets_one_at_once_and_may_leave() -> None:
    from redres_ros.nodes.runtime import own_domain

    streams = {'stdout': subprocess.PIPE, 'stderr': subprocess.PIPE}
    with own_domain() as domain:
        process = subprocess.Popen([*WATCH, str(domain)], text=True, **streams)
        assert process.stdout.readline() == f'no node in domain {domain}\n'
        process.stdout.close()
        assert process.wait(60.0) == 1
        assert process.stderr.read() == ''


@pytest.mark.slow
def test_it_receives_the_nodes_and_reports_their_end(tmp_path) -> None:
    from redres_ros.demo.processes import NodeProcess
    from redres_ros.nodes.runtime import own_domain

    with own_domain() as domain:
        loop = {'rate': 100.0}
        nodes = [NodeProcess(name, tmp_path / name, loop) for name in ('controller', 'sim')]
        try:
            done = watch_until(domain, 'CMD', 'joint velocity', 'lwr_a3_joint')
        finally:
            for node in nodes:
                node.end()
    assert done.returncode == 0
    lines, title, shown = done.stdout.partition('redres watch, ROS domain')
    assert title and len(lines.splitlines()) >= 2
    assert 'CMD' in line_of(shown, 'session')
    assert 'rad/s' in line_of(shown, 'joint velocity')
    assert 'planner: no message' in shown
    assert '●' in line_of(shown, 'lwr_a3_joint')
