"""What nodes do so that an answer comes in time."""

import os
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path

import pytest

pytest.importorskip('rclpy', reason='needs ROS 2: pip install .[test]')

import rclpy
from graph_helpers import await_that, is_running
from rclpy.node import Node
from sensor_msgs.msg import JointState

from redres_ros.demo.processes import own_domain
from redres_ros.nodes import awake, real_time
from redres_ros.nodes.planner import LonePlannerNode, PlannerNode


@pytest.fixture
def ros(request: pytest.FixtureRequest) -> Iterator[None]:
    """A context with a parameter of the nodes."""
    with own_domain():
        rclpy.init(args=['--ros-args', '--log-level', 'fatal', '-p', request.param])
        yield
        rclpy.shutdown()


@pytest.mark.parametrize(
    ('ros', 'cls', 'slept'),
    [
        ('rate:=500.0', LonePlannerNode, [0.15 / 500.0]),
        ('lockstep:=true', LonePlannerNode, []),  # the controller waits for it
        ('rate:=500.0', PlannerNode, []),  # as in one process: the others would sleep, too
    ],
    indirect=['ros'],
)
def test_only_a_planner_that_nobody_waits_for_leaves_time(
    ros: None,
    cls: type[PlannerNode],
    slept: list[float],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    planner = cls()
    pauses: list[float] = []
    monkeypatch.setattr(time, 'sleep', pauses.append)
    planner._on_state(JointState())
    assert pauses == pytest.approx(slept)
    planner.destroy_node()


@pytest.mark.parametrize('ros', ['keep_awake:=true'], indirect=True)
def test_a_node_that_keeps_the_processors_awake_asks_for_a_latency_of_zero(
    ros: None, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    device = tmp_path / 'latency'
    device.touch()
    monkeypatch.setattr(awake, 'LATENCY', device)
    node = Node('arm')
    real_time.ask_kernel(node)
    assert device.read_bytes() == bytes(4)
    node.destroy_node()


# Tells how the processors are kept awake and by which processes, and ends when it is told to.
STARTER = """
import os
from pathlib import Path
from redres_ros.nodes import awake
awake.LATENCY = Path('/nowhere')
os.sched_setaffinity(0, [min(os.sched_getaffinity(0))])
print(awake.keep_awake())
print(*[loop.pid for loop in awake._loops], flush=True)
input()
"""


def test_without_permission_a_loop_that_makes_way_to_all_others_keeps_a_processor_awake() -> None:
    starter = subprocess.Popen(
        [sys.executable, '-c', STARTER], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
    )
    assert 'lowest priority' in starter.stdout.readline()
    [loop] = map(int, starter.stdout.readline().split())
    await_that(lambda: os.sched_getscheduler(loop) == os.SCHED_IDLE, 'the least priority')
    assert os.sched_getaffinity(loop) == os.sched_getaffinity(starter.pid)
    assert os.getsid(loop) == loop  # Ctrl-C at the terminal does not reach it
    starter.kill()
    starter.communicate()
    await_that(lambda: not is_running(loop), 'the loop to end with whom it serves')


@pytest.mark.parametrize(
    ('says', 'has'), [('max 100000\n', False), ('50000 100000\n', True), (None, False)]
)
def test_loops_would_use_up_a_quota_of_processor_time(
    says: str | None, has: bool, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    if says:
        (tmp_path / 'cpu.max').write_text(says)
    monkeypatch.setattr(awake, 'LATENCY', Path('/nowhere'))
    monkeypatch.setattr(awake, '_groups', lambda: [tmp_path / 'inner', tmp_path])
    assert awake.may_keep_awake() is not has
    if has:
        with pytest.raises(OSError, match='quota'):
            awake.keep_awake()
