"""A parameter with a misspelt name is reported when a node starts, and no other one is."""

from collections.abc import Iterator

import pytest

pytest.importorskip('rclpy', reason='needs ROS 2: pip install .[test]')

from own_ros import ros
from rclpy.node import Node
from rclpy.parameter import Parameter

from redres_ros.nodes import runtime
from redres_ros.nodes.parameters import misspelt

GIVEN = {
    'law': 'minimum_velocity',
    'limit_scael': 0.5,
    'camera.exposure': 3.0,
    'target_timeout': 1.0,  # of the planner
}


@pytest.fixture(scope='module')
def node() -> Iterator[Node]:
    """One with three parameters, started with four."""
    with ros():
        overrides = [Parameter(name, value=value) for name, value in GIVEN.items()]
        node = Node('arm', parameter_overrides=overrides)
        node.declare_parameter('law', '')
        node.declare_parameter('limit_scale', 1.0)
        node.declare_parameter('state_timeout', 0.1)
        yield node
        node.destroy_node()


def test_the_nearest_name_is_reported(node):
    assert misspelt([node]) == {'limit_scael': 'limit_scale'}


def test_what_another_node_of_the_process_has_is_not_misspelt(node):
    other = Node('other')
    other.declare_parameter('limit_scael', 1.0)
    assert misspelt([node, other]) == {}
    other.destroy_node()


def test_a_misspelt_parameter_is_reported_in_one_line(node, monkeypatch):
    lines: list[str] = []

    class Log:
        warning = lines.append
        info = print  # of what was compiled

    monkeypatch.setattr(node, 'get_logger', Log)
    runtime._log_start([node], [])
    (line,) = lines
    assert 'limit_scael' in line and 'limit_scale' in line and '\n' not in line
    assert 'exposure' not in line
