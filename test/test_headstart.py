"""A planner in a process of its own lets the controller answer first."""

import time
from collections.abc import Iterator

import pytest

pytest.importorskip('rclpy', reason='needs ROS 2: pip install .[test]')

import rclpy
from sensor_msgs.msg import JointState

from redres_ros.demo.processes import own_domain
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
