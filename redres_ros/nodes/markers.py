"""`markers` for RViz: the paths of tip and elbow, the points of the task, and what the arm keeps
away from, which the topic `workspace` may set.
"""

from collections.abc import Callable, Iterator, Sequence
from typing import Any

import numpy as np
from geometry_msgs.msg import Point
from rclpy.node import Node
from rclpy.parameter import Parameter
from std_msgs.msg import ColorRGBA
from visualization_msgs.msg import Marker, MarkerArray

from redres_ros.errors import RedresError
from redres_ros.limits.scene import SPHERE, WALLS, DrawnShape, Shape, read_shapes, shapes_of
from redres_ros.nodes.diagnostics import InputMonitor
from redres_ros.nodes.topics import LATCHED, PUBLISH, STEADY
from redres_ros.types import Points, Position

_TRACES_EVERY = 0.1  # [s]
_SHAPES_EVERY = 1.0  # [s]
_LENGTH = 100  # points of a trace: 10 s

_ORANGE = ColorRGBA(r=0.95, g=0.55, b=0.1, a=1.0)
_BLUE = ColorRGBA(r=0.2, g=0.45, b=0.85, a=1.0)
_GREY = ColorRGBA(r=0.5, g=0.5, b=0.5, a=1.0)
_OUTSIDE = ColorRGBA(r=0.85, g=0.2, b=0.2, a=0.4)
_INSIDE = ColorRGBA(r=0.2, g=0.7, b=0.3, a=0.15)
_SOLID = ColorRGBA(r=0.6, g=0.6, b=0.6, a=0.6)
_SIDES = ('inside', 'outside')
_WALLS = 'scene.walls'

Trace = Callable[[], Sequence[Position]]
Shapes = Callable[[Callable[[str], Any]], Iterator[DrawnShape]]


def show_traces(node: Node, frame: str, waypoints: Points, trace: Trace) -> None:
    """Have a node publish the points of its task, and the paths of tip and elbow, which `trace`
    gives as they are now.
    """
    publisher = node.create_publisher(MarkerArray, 'markers', PUBLISH)
    task = _make_marker('task', Marker.SPHERE_LIST, 0.015, _GREY)
    task.points = [_to_point(x) for x in waypoints]
    traces = [
        _make_marker('tip', Marker.LINE_STRIP, 0.004, _ORANGE),
        _make_marker('elbow', Marker.LINE_STRIP, 0.004, _BLUE),
    ]
    markers = [task, *traces]
    for marker in markers:
        marker.header.frame_id = frame

    def publish() -> None:
        if publisher.get_subscription_count() == 0:
            return
        for marker, x in zip(traces, trace(), strict=False):
            marker.points = [*marker.points, _to_point(x)][-_LENGTH:]
        for marker in traces:
            # RViz complains of a line of less than two points.
            marker.action = Marker.ADD if len(marker.points) > 1 else Marker.DELETE
        publisher.publish(MarkerArray(markers=markers))

    node.create_timer(_TRACES_EVERY, publish, clock=STEADY)


def show_obstacles(
    node: Node, frame: str, shapes: Shapes = shapes_of, namespace: str = 'obstacles'
) -> None:
    """Have a node publish what its limits keep away from, or other shapes by its parameters; their
    figures are in the frame, and the namespace is that of the markers.
    """
    publisher = node.create_publisher(MarkerArray, 'markers', PUBLISH)
    shown = 0  # how many there are

    def publish() -> None:
        nonlocal shown
        if publisher.get_subscription_count() == 0:
            return
        markers = [
            _to_marker(shape) for shape in shapes(lambda name: node.get_parameter(name).value)
        ]
        gone = max(shown - len(markers), 0)
        shown = len(markers)
        # One by one: DELETEALL would also delete the traces.
        markers += [Marker(action=Marker.DELETE) for _ in range(gone)]
        for number, marker in enumerate(markers):
            marker.id = number
            marker.ns = namespace
            marker.header.frame_id = frame
        publisher.publish(MarkerArray(markers=markers))

    node.create_timer(_SHAPES_EVERY, publish, clock=STEADY)


def take_workspace(node: Node, frame: str, inputs: InputMonitor) -> None:
    """Have a node set boxes and spheres among its `scene.walls`, in a frame, from the topic
    `workspace`: all of a message or none.
    """

    def on_markers(message: MarkerArray) -> None:
        try:
            shapes = read_shapes(node.get_parameter(_WALLS).value, WALLS)
            kept = [shape for shape in shapes if shape.kind == 'half_space']
            taken = [_shape(marker, frame) for marker in message.markers]
            text = '; '.join(map(str, [*kept, *taken]))
            read_shapes(text, WALLS)  # nothing else reads it while the limit is off
        except RedresError as error:
            inputs.refuse('workspace', error)
            return
        [result] = node.set_parameters([Parameter(_WALLS, value=text)])
        if result.successful:
            inputs.accept('workspace')
        else:
            inputs.refuse('workspace', RedresError(result.reason))

    node.create_subscription(MarkerArray, 'workspace', on_markers, LATCHED)


def _shape(marker: Marker, frame: str) -> Shape:
    """The shape that a marker stands for. Raises RedresError."""
    place = marker.pose.position
    size = marker.scale
    turn = marker.pose.orientation
    if marker.action != Marker.ADD:
        raise RedresError(
            f'got the action {marker.action}; expected ADD, of all walls that are left'
        )
    if marker.ns not in _SIDES:
        raise RedresError(f'got the namespace {marker.ns!r}; expected inside or outside')
    if marker.header.frame_id not in ('', frame):
        raise RedresError(f'got the frame {marker.header.frame_id!r}; expected {frame!r}')
    centre = np.array((place.x, place.y, place.z))
    if marker.type == Marker.SPHERE and size.x == size.y == size.z:
        return Shape(f'{marker.ns}_sphere', (*centre.tolist(), size.x / 2.0))
    is_upright = abs(turn.x) + abs(turn.y) + abs(turn.z) < 1e-6
    if marker.type == Marker.CUBE and is_upright:
        half = np.array((size.x, size.y, size.z)) / 2.0
        ends = (*(centre - half).tolist(), *(centre + half).tolist())
        return Shape(f'{marker.ns}_box', ends)
    raise RedresError(
        f'got marker {marker.id} of type {marker.type}; expected a CUBE along the axes of {frame}, '
        'or a SPHERE of one diameter'
    )


def _to_marker(shape: DrawnShape) -> Marker:
    kind = Marker.SPHERE if shape.kind == SPHERE else Marker.CUBE
    color = _INSIDE if shape.keeps_in else _OUTSIDE
    marker = _make_marker('', kind, 0.0, _SOLID if shape.is_solid else color)
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
