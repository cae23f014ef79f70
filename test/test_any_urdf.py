"""An arm of which there is nothing but a URDF, as the nodes and the demo take it."""

import os
import signal
from pathlib import Path

import pytest
from programs import run_python

pytest.importorskip('rclpy', reason='needs ROS 2: pip install .[test]')

from graph_helpers import PATIENCE, await_that, log_lines, nodes
from std_msgs.msg import String
from test_urdf import PARTS, urdf

from redres_ros.nodes.topics import LATCHED
from redres_ros.robots import arm_from_urdf

pytestmark = pytest.mark.slow

# A linear axis below an arm with a gripper; the base stands beside the root link.
RAIL = (
    PARTS['yaw']
    .replace('"revolute"', '"prismatic"')
    .replace('axis xyz="0 0 1"', 'axis xyz="0 1 0"')
)
TEXT = urdf(yaw=RAIL)
LOCKSTEP = {'lockstep': True, 'rate': 100.0, 'tip_frame': 'tip'}


@pytest.fixture
def path(tmp_path: Path) -> Path:
    """The arm's file, in a directory without anything else."""
    folder = tmp_path / "somebody's arms: #1"
    folder.mkdir()
    file = folder / 'my arm.urdf'
    file.write_text(TEXT)
    return file


@pytest.mark.nightly
def test_one_command_moves_the_arm_of_a_file(path: Path, tmp_path: Path) -> None:
    out = tmp_path / 'out'
    options = ['--robot', path.name, '--tip', 'tip', '--lockstep', '--period', '0.01', '--out', out]
    done = run_python('-m', 'redres_ros.cli', 'demo', *options, cwd=path.parent)
    assert done.returncode == 0, done.stdout + done.stderr
    assert [file.name for file in path.parent.iterdir()] == [path.name]
    head, first = (out / 'motion.csv').read_text().splitlines()[:2]
    n = 4
    start = [float(word) for word in first.split(',')[1 : 1 + n]]
    assert head.split(',')[1 : 2 + n] == ['q1', 'q2', 'q3', 'q4', 'dq1']
    assert start == pytest.approx(arm_from_urdf(TEXT, 'tip').start, abs=1e-6)


def test_planner_and_controller_take_the_arm_that_is_published(path: Path, tmp_path: Path) -> None:
    asked = LOCKSTEP | {'robot': 'topic'}
    sim = LOCKSTEP | {'robot': str(path), 'plant': 'ideal', 'monitor_time': 0.0}
    parameters = {'sim': sim, 'controller': asked, 'planner': asked | {'autostart': True}}
    with nodes(tmp_path, **parameters) as (probe, _):
        reported = probe.listen(String, 'planner/state', LATCHED)
        await_that(
            lambda: 'finished' in {message.data for message in reported}, 'the end of the task'
        )
    assert any('no acceleration limits; assumed' in line for line in log_lines(tmp_path, 'planner'))


def test_while_nobody_publishes_an_arm_a_node_says_what_it_waits_for_and_can_be_ended(tmp_path):
    with nodes(tmp_path, controller={'robot': 'topic'}) as (_, processes):
        log = tmp_path / 'controller.log'
        await_that(lambda: 'waiting for a URDF on /robot_description' in log.read_text(), 'a line')
        os.kill(processes['controller'].pid, signal.SIGTERM)
        assert processes['controller'].wait(PATIENCE) == 130
    assert 'Traceback' not in log.read_text()
