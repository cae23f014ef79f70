"""What nodes do so that a command comes in time."""

import time
from collections.abc import Iterator
from pathlib import Path

import pytest

pytest.importorskip('rclpy', reason='needs ROS 2: pip install .[test]')

import rclpy
from own_ros import ros
from rclpy.node import Node
from sensor_msgs.msg import JointState

from redres_ros.nodes import real_time
from redres_ros.nodes.planner import PlannerNode, WaitingPlannerNode


@pytest.fixture
def context(request: pytest.FixtureRequest) -> Iterator[None]:
    """A context with a parameter of the nodes."""
    with ros('--log-level', 'fatal', '-p', request.param):
        yield


@pytest.mark.parametrize(
    ('context', 'cls', 'slept'),
    [
        ('rate:=500.0', WaitingPlannerNode, [0.15 / 500.0]),
        ('lockstep:=true', WaitingPlannerNode, []),  # the controller waits for it
        ('rate:=500.0', PlannerNode, []),  # as in one process: the others would sleep, too
    ],
    indirect=['context'],
)
def test_only_a_planner_that_nobody_waits_for_leaves_time(
    context: None,
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


@pytest.mark.parametrize('context', ['keep_awake:=true'], indirect=True)
def test_a_node_that_keeps_the_processors_awake_asks_for_a_latency_of_zero(
    context: None, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    device = tmp_path / 'latency'
    device.touch()
    monkeypatch.setattr(real_time, 'LATENCY', device)
    node = Node('arm')
    real_time.ask_kernel(node)
    assert device.read_bytes() == bytes(4)
    node.destroy_node()


@pytest.mark.parametrize('context', ['keep_awake:=true'], indirect=True)
def test_without_permission_one_line_says_which_to_give(
    context: None, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(real_time, 'LATENCY', Path('/nowhere/latency'))
    rclpy.logging.set_logger_level('arm', rclpy.logging.LoggingSeverity.WARN)
    node = Node('arm')
    real_time.ask_kernel(node)
    node.destroy_node()
    [line] = capfd.readouterr().err.splitlines()
    assert 'sudo chmod o+w /nowhere/latency' in line
