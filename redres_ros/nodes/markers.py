"""`markers` for RViz: paths of tip and elbow, points of the task, and shapes to keep away from."""

from collections.abc import Callable, Iterator, Sequence
from functools import partial
from typing import Any

from builtin_interfaces.msg import Duration
from geometry_msgs.msg import Point
from rclpy.node import Node
from std_msgs.msg import ColorRGBA
from visualization_msgs.msg import Marker, MarkerArray

from redres_ros.nodes.topics import PUBLISH, STEADY
from redres_ros.robots.scene import SPHERE, DrawnShape, shapes_of
from redres_ros.types import Points, Position, Seconds

_TRACES_EVERY = 0.1  # [s]
_SHAPES_EVERY = 1.0  # [s]
_LIFETIME = 3  # [s] after which what is not published again disappears
_LENGTH = 100  # points of a trace: 10 s

_ORANGE = ColorRGBA(r=0.95, g=0.55, b=0.1, a=1.0)
_BLUE = ColorRGBA(r=0.2, g=0.45, b=0.85, a=1.0)
_GREY = ColorRGBA(r=0.5, g=0.5, b=0.5, a=1.0)
_OUTSIDE = ColorRGBA(r=0.85, g=0.2, b=0.2, a=0.4)
_INSIDE = ColorRGBA(r=0.2, g=0.7, b=0.3, a=0.15)
_SOLID = ColorRGBA(r=0.6, g=0.6, b=0.6, a=0.6)

Trace = Callable[[], Sequence[Position]]
Shapes = Callable[[Callable[[str], Any]], Iterator[DrawnShape]]


def show_traces(node: Node, frame: str, waypoints: Points, trace: Trace) -> None:
    """Have a node publish the points of its task, and the paths of tip and elbow, which `trace`
    gives as they are now.
    """
    task = _make_marker('task', Marker.SPHERE_LIST, 0.015, _GREY)
    task.points = [_to_point(x) for x in waypoints]
    traces = [
        _make_marker('tip', Marker.LINE_STRIP, 0.004, _ORANGE),
        _make_marker('elbow', Marker.LINE_STRIP, 0.004, _BLUE),
    ]

    def _markers() -> list[Marker]:
        for marker, x in zip(traces, trace(), strict=False):
            marker.points = [*marker.points, _to_point(x)][-_LENGTH:]
        # RViz complains of a line of less than two points.
        return [task, *(marker for marker in traces if len(marker.points) > 1)]

    _show(node, frame, _TRACES_EVERY, _markers)


def show_obstacles(
    node: Node, frame: str, shapes: Shapes = shapes_of, namespace: str = 'obstacles'
) -> None:
    """Have a node publish what its limits keep away from, or other shapes by its parameters; their
    figures are in the frame, and the namespace is that of the markers.
    """
    found = partial(shapes, lambda name: node.get_parameter(name).value)
    _show(
        node,
        frame,
        _SHAPES_EVERY,
        lambda: [_to_marker(shape, namespace, k) for k, shape in enumerate(found())],
    )


def _show(node: Node, frame: str, period: Seconds, make: Callable[[], list[Marker]]) -> None:
    publisher = node.create_publisher(MarkerArray, 'markers', PUBLISH)

    def _publish() -> None:
        if publisher.get_subscription_count() == 0:
            return
        markers = make()
        for marker in markers:
            marker.header.frame_id = frame
            marker.lifetime = Duration(sec=_LIFETIME)
        publisher.publish(MarkerArray(markers=markers))

    node.create_timer(period, _publish, clock=STEADY)


def _to_marker(shape: DrawnShape, namespace: str, number: int) -> Marker:
    kind = Marker.SPHERE if shape.kind == SPHERE else Marker.CUBE
    color = _INSIDE if shape.keeps_in else _OUTSIDE
    marker = _make_marker(namespace, kind, 0.0, _SOLID if shape.is_solid else color)
    marker.id = number
    marker.scale.x, marker.scale.y, marker.scale.z = shape.size.tolist()
    marker.pose.position = _to_point(shape.centre)
    turn = marker.pose.orientation
    turn.x, turn.y, turn.z, turn.w = shape.quaternion.tolist()
    return marker


def _make_marker(name: str, kind: int, size: float, color: ColorRGBA) -> Marker:
    """A marker without points, of a diameter or width [m]."""
    marker = Marker(ns=name, type=kind, action=Marker.ADD, color=color)
    marker.scale.x = size
    if kind != Marker.LINE_STRIP:
        marker.scale.y = size
        marker.scale.z = size
    marker.pose.orientation.w = 1.0
    return marker


def _to_point(x: Position) -> Point:
    return Point(x=float(x[0]), y=float(x[1]), z=float(x[2]))
