"""`redres watch`: what its page says, and that it receives the nodes."""

import io
import subprocess
import sys
from types import SimpleNamespace

import pytest

pytest.importorskip('rclpy', reason='needs ROS 2: pip install .[test]')

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from graph_helpers import graph
from rich.console import Console

from redres_ros.graph import monitor
from redres_ros.graph.monitor import GraphMonitor, NodeHealth
from redres_ros.graph.watch import _page

VALUES = {
    'sim/session_state': 'CMD',
    'sim/stop_reason': '',
    'planner/state': 'moving',
    'planner/task_error': 0.00025,
    'planner/progress': 0.43,
    'controller/law': 'minimum_torque',
    'controller/tip_pose': '+0.1000  -0.2000  +0.3000',
    'controller/joint_torque_norm': 42.5,
}
WELL = {
    'sim': NodeHealth('in command', True),
    'planner': NodeHealth('moving', True),
    'controller': NodeHealth('commanding', True),
}


def text_of(values: dict[str, object], health: dict[str, NodeHealth] = WELL) -> str:
    console = Console(width=120, record=True, file=io.StringIO())
    console.print(_page(values, health, 7))
    return console.export_text()


def line_of(text: str, label: str) -> str:
    return next(line for line in text.splitlines() if label in line)


def test_where_nobody_is_the_page_says_so_and_what_to_do() -> None:
    text = text_of({})
    assert 'No node of redres_ros runs' in text
    assert 'domain 7' in text
    assert '--domain' in text
    assert 'singular' not in text  # no table of dashes


def test_values_have_units() -> None:
    text = text_of(VALUES)
    assert '0.25 mm' in line_of(text, 'task error')
    assert '42.5 Nm' in line_of(text, 'joint torque')
    assert '43 %' in line_of(text, 'progress')
    assert '+0.1000  -0.2000  +0.3000 m' in line_of(text, ' tip ')


def test_a_robot_that_has_stopped_comes_first() -> None:
    stopped = {**VALUES, 'sim/stop_reason': 'protective stop: joint 1'}
    lines = text_of(stopped).splitlines()
    at = next(number for number, line in enumerate(lines) if 'The robot has stopped' in line)
    assert 'protective stop: joint 1' in lines[at]
    assert at < next(number for number, line in enumerate(lines) if 'session' in line)
    assert 'The robot has stopped' not in text_of(VALUES)


def test_a_report_counts_for_three_seconds(monkeypatch: pytest.MonkeyPatch) -> None:
    with graph(lambda: GraphMonitor('test')) as (node, _):
        status = DiagnosticStatus(name='planner', message='moving', level=DiagnosticStatus.OK)
        node._on_diagnostics(DiagnosticArray(status=[status]))
        node.keep('planner/state', 'moving')
        assert node.health()['sim'] == NodeHealth('no message', None)
        assert node.health()['planner'] == NodeHealth('moving', True)
        later = node._reports['planner'][1] + 6.0
        monkeypatch.setattr(monitor, 'time', SimpleNamespace(monotonic=lambda: later))
        assert node.health()['planner'] == NodeHealth('silent for 6 s', None)
        assert node.word('planner/state') == ''


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
def test_a_reader_of_the_page_gets_it_at_once_and_may_leave() -> None:
    from redres_ros.nodes.runtime import own_domain

    streams = {'stdout': subprocess.PIPE, 'stderr': subprocess.PIPE}
    with own_domain() as domain:
        process = subprocess.Popen([*WATCH, str(domain)], text=True, **streams)
        assert process.stdout.readline() == f'redres watch, ROS domain {domain}\n'
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
            done = watch_until(domain, 'CMD', 'joint velocity', 'joint positions')
        finally:
            for node in nodes:
                node.end()
    assert done.returncode == 0
    pages = done.stdout.split('redres watch, ROS domain')
    assert len(pages) > 2
    shown = pages[-1]
    assert 'CMD' in line_of(shown, 'session')
    assert 'rad/s' in line_of(shown, 'joint velocity')
    assert 'planner: no message' in shown
    assert '+104.1 +114.6' in line_of(shown, 'joint positions')
