"""What RViz gets to show."""

from types import SimpleNamespace

import numpy as np
import pytest

pytest.importorskip('rclpy', reason='needs ROS 2: pip install .[test]')

from rclpy.parameter import Parameter
from visualization_msgs.msg import Marker, MarkerArray

from redres_ros.errors import RedresError
from redres_ros.limits.scene import WALLS, read_shapes, touched
from redres_ros.nodes.markers import show_obstacles, show_traces, take_workspace

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
    assert shown(node)['tip'].action == Marker.DELETE  # no line without two points
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
    parameters = {
        'limits': ['position'],
        'scene.obstacles': 'floor 0; sphere 0.5 0.1 0.4 0.1',
    }
    node.get_parameter = lambda name: SimpleNamespace(value=parameters[name])
    show_obstacles(node, 'world')
    node.look()
    assert node.sent[-1].markers == []
    parameters['limits'] = ['position', 'collision']
    node.look()
    floor, ball = node.sent[-1].markers
    assert (ball.pose.position.x, ball.scale.x, ball.scale.y) == (0.5, 0.2, 0.2)
    assert (floor.type, floor.header.frame_id) == (Marker.CUBE, 'world')
    parameters['limits'] = ['position']
    node.look()
    assert [marker.action for marker in node.sent[-1].markers] == 2 * [Marker.DELETE]
    assert {marker.id for marker in node.sent[-1].markers} == {floor.id, ball.id}


@pytest.mark.parametrize(
    ('shape', 'kind', 'up'), [('table', Marker.CUBE, 1.0), ('wall', Marker.CUBE, 0.0)]
)
def test_the_surface_that_the_tip_can_touch_is_shown(shape: str, kind: int, up: float) -> None:
    node = Listened()
    parameters = {
        'contact_shape': shape,
        'contact_position': [0.4, 0.0, 0.3],
    }
    node.get_parameter = lambda name: SimpleNamespace(value=parameters[name])
    show_obstacles(node, 'world', touched, 'contact')
    node.look()
    [surface] = node.sent[-1].markers
    assert (surface.type, surface.ns, surface.pose.position.x) == (kind, 'contact', 0.4)
    turn = surface.pose.orientation
    assert 1.0 - 2.0 * (turn.x**2 + turn.y**2) == pytest.approx(up)  # z of its normal


class WithParameters(Listened):
    """A node whose subscription one can call, and what counts the messages that it refuses."""

    def __init__(self) -> None:
        super().__init__()
        self.walls = 'half_space 0 0 1 0.9; inside_sphere 0 0 0 1'
        self.refused: list[str] = []

    def create_subscription(self, _: type, topic: str, callback: object, qos: object) -> None:
        assert topic == 'workspace'
        self.hand_in = callback

    def get_parameter(self, name: str) -> SimpleNamespace:
        assert name == 'scene.walls'
        return SimpleNamespace(value=self.walls)

    def set_parameters(self, parameters: list[Parameter]) -> list[SimpleNamespace]:
        assert [parameter.name for parameter in parameters] == ['scene.walls']
        self.walls = parameters[0].value
        return [SimpleNamespace(successful=True, reason='')] * len(parameters)

    def refuse(self, source: str, error: RedresError) -> None:
        self.refused.append(f'{source}: {error}')

    def accept(self, source: str) -> None:
        assert source == 'workspace'


def shape(side: str, kind: int, at: tuple[float, ...], size: tuple[float, ...]) -> Marker:
    marker = Marker(ns=side, type=kind)
    marker.pose.position.x, marker.pose.position.y, marker.pose.position.z = at
    marker.scale.x, marker.scale.y, marker.scale.z = size
    return marker


def test_the_workspace_is_taken_from_markers() -> None:
    node = WithParameters()
    take_workspace(node, 'world', node)
    box = shape('inside', Marker.CUBE, (0.5, 0.0, 0.5), (0.4, 0.6, 0.2))
    ball = shape('outside', Marker.SPHERE, (0.1, 0.2, 0.3), (0.2, 0.2, 0.2))
    node.hand_in(MarkerArray(markers=[box, ball]))
    kept, inside, outside = read_shapes(node.walls, WALLS)
    assert kept.kind == 'half_space'
    assert inside.kind == 'inside_box'
    assert inside.numbers == pytest.approx((0.3, -0.3, 0.4, 0.7, 0.3, 0.6))
    assert outside.kind == 'outside_sphere'
    assert outside.numbers == pytest.approx((0.1, 0.2, 0.3, 0.1))
    node.hand_in(MarkerArray())
    assert read_shapes(node.walls, WALLS) == [kept]


@pytest.mark.parametrize(
    ('marker', 'words'),
    [
        (shape('beside', Marker.CUBE, (0.0,) * 3, (1.0,) * 3), "namespace 'beside'"),
        (shape('inside', Marker.CYLINDER, (0.0,) * 3, (1.0,) * 3), 'expected a CUBE'),
        (shape('inside', Marker.SPHERE, (0.0,) * 3, (1.0, 1.0, 2.0)), 'one diameter'),
        (shape('outside', Marker.SPHERE, (0.0,) * 3, (-0.2,) * 3), 'a radius above zero'),
        (Marker(ns='inside', type=Marker.CUBE, action=Marker.DELETE), 'the action 2'),
    ],
)
def test_a_message_with_a_marker_that_is_no_wall_changes_nothing(
    marker: Marker, words: str
) -> None:
    node = WithParameters()
    take_workspace(node, 'world', node)
    wall = shape('inside', Marker.CUBE, (0.0,) * 3, (1.0,) * 3)
    node.hand_in(MarkerArray(markers=[wall, marker]))
    assert node.walls == WithParameters().walls
    [refused] = node.refused
    assert refused.startswith('workspace: ') and words in refused
