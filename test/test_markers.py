"""What onlookers get, and that it costs nothing while nobody looks."""

from types import SimpleNamespace

import numpy as np
import pytest

pytest.importorskip('rclpy', reason='needs ROS 2: pip install .[test]')

from std_msgs.msg import Float64
from visualization_msgs.msg import Marker, MarkerArray

from redres_ros.nodes.markers import show_obstacles, show_traces
from redres_ros.nodes.topics import Telemetry
from redres_ros.robots.scene import touched

WAYPOINTS = np.array([[0.5, 0.0, 0.5], [0.6, 0.1, 0.4]])


class Listened:
    """Node, publisher and timer in one: somebody listens from the first look on."""

    def __init__(self) -> None:
        self.listeners = 1
        self.sent: list[MarkerArray] = []
        self.publish = self.sent.append

    def create_publisher(self, *given: object) -> 'Listened':
        return self

    def get_subscription_count(self) -> int:
        return self.listeners

    def create_timer(self, period: float, look: object, clock: object) -> None:
        self.look = look


def shown(node: Listened) -> dict[str, Marker]:
    node.look()
    return {marker.ns: marker for marker in node.sent[-1].markers}


def test_traces_grow_to_a_length_and_the_task_has_its_points() -> None:
    node = Listened()
    path: list[tuple[np.ndarray, np.ndarray]] = []
    show_traces(node, 'world', WAYPOINTS, lambda: path[-1] if path else ())
    assert shown(node).keys() == {'task'}  # no line without two points
    for k in range(150):
        path.append((np.array([k * 1e-3, 0.0, 0.5]), np.array([0.0, 0.0, k * 1e-3])))
        markers = shown(node)
    tip, elbow, task = (markers[name] for name in ('tip', 'elbow', 'task'))
    assert [point.x for point in tip.points] == [x[0] for x, _ in path[-100:]]
    assert [point.z for point in elbow.points] == [point.x for point in tip.points]
    assert [[p.x, p.y, p.z] for p in task.points] == WAYPOINTS.tolist()
    assert {marker.header.frame_id for marker in (tip, elbow, task)} == {'world'}


def test_while_nobody_listens_nothing_is_computed_or_sent() -> None:
    node = Listened()
    node.listeners = 0
    show_traces(node, 'world', WAYPOINTS, lambda: pytest.fail('it was'))
    node.look()
    assert node.sent == []


def test_the_balls_that_the_arm_is_kept_from_are_shown_while_the_limit_is_on() -> None:
    node = Listened()
    parameters = {'limits': ['position'], 'scene.obstacles': 'floor 0; sphere 0.5 0.1 0.4 0.1'}
    node.get_parameter = lambda name: SimpleNamespace(value=parameters[name])
    show_obstacles(node, 'world')
    node.look()
    assert node.sent[-1].markers == []
    parameters['limits'] = ['position', 'collision']
    node.look()
    floor, ball = node.sent[-1].markers
    assert (ball.pose.position.x, ball.scale.x, ball.scale.y) == (0.5, 0.2, 0.2)
    assert (floor.type, floor.header.frame_id) == (Marker.CUBE, 'world')
    assert floor.id != ball.id
    assert floor.lifetime.sec > 1.0  # what is not published again disappears


@pytest.mark.parametrize(
    ('shape', 'kind', 'up'), [('table', Marker.CUBE, 1.0), ('wall', Marker.CUBE, 0.0)]
)
def test_the_surface_that_the_tip_can_touch_is_shown(shape: str, kind: int, up: float) -> None:
    node = Listened()
    parameters = {'contact_shape': shape, 'contact_position': [0.4, 0.0, 0.3]}
    node.get_parameter = lambda name: SimpleNamespace(value=parameters[name])
    show_obstacles(node, 'world', touched, 'contact')
    node.look()
    [surface] = node.sent[-1].markers
    assert (surface.type, surface.ns, surface.pose.position.x) == (kind, 'contact', 0.4)
    turn = surface.pose.orientation
    assert 1.0 - 2.0 * (turn.x**2 + turn.y**2) == pytest.approx(up)  # z of its normal


def test_a_value_is_made_only_while_its_topic_has_a_subscriber() -> None:
    node = Listened()
    node.listeners = 0
    telemetry = Telemetry(node, {'speaker/loudness': Float64})
    telemetry.publish('loudness', lambda: pytest.fail('it was'))
    node.listeners = 1
    node.look()
    telemetry.publish('loudness', lambda: 0.5)
    assert node.sent == [Float64(data=0.5)]
