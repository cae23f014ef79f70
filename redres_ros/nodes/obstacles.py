"""What the arm keeps away from: shown as `markers`, and taken from the topic `workspace`."""

from collections.abc import Callable, Iterator
from typing import Any

import numpy as np
from rclpy.node import Node
from rclpy.parameter import Parameter
from std_msgs.msg import ColorRGBA
from visualization_msgs.msg import Marker, MarkerArray

from redres_ros.limits.shapes import SPHERE, DrawnShape, shapes_of
from redres_ros.nodes.clocks import create_steady_timer
from redres_ros.nodes.markers import make_marker, to_point
from redres_ros.nodes.topics import LATCHED, PUBLISH

Shapes = Callable[[Callable[[str], Any]], Iterator[DrawnShape]]

_PERIOD = 1.0  # [s]
_RED = ColorRGBA(r=0.85, g=0.2, b=0.2, a=0.4)  # to stay out of
_GREEN = ColorRGBA(r=0.2, g=0.7, b=0.3, a=0.15)  # to stay in
_GREY = ColorRGBA(r=0.6, g=0.6, b=0.6, a=0.6)  # to touch
_SIDES = ('inside', 'outside')
_SIZES = {'boxes': 6, 'spheres': 4}  # numbers of each shape


def show_obstacles(
    node: Node, frame: str, shapes: Shapes = shapes_of, namespace: str = 'obstacles'
) -> None:
    """Have a node publish what its limits `collision` and `workspace` keep away from, or others.

    Args:
        node: Node with the parameters of these limits.
        frame: Frame of their figures.
        shapes: Shapes by the values of these parameters.
        namespace: Namespace of the markers.
    """
    publisher = node.create_publisher(MarkerArray, 'markers', PUBLISH)
    shown: set[int] = set()

    def publish() -> None:
        if publisher.get_subscription_count() == 0:
            return
        drawn = shapes(lambda name: node.get_parameter(name).value)
        markers = list(map(_to_marker, drawn))
        for number, marker in enumerate(markers):
            marker.id = number
        present = {marker.id for marker in markers}
        gone = shown - present
        shown.clear()
        shown.update(present)
        # One by one: DELETEALL would also delete the traces.
        markers += [Marker(id=number, action=Marker.DELETE) for number in gone]
        for marker in markers:
            marker.ns = namespace
            marker.header.frame_id = frame
        publisher.publish(MarkerArray(markers=markers))

    create_steady_timer(node, _PERIOD, publish)


def take_workspace(node: Node, frame: str) -> None:
    """Have a node set the shapes of its limit `workspace` from the topic of that name.

    Args:
        node: Node with the parameters of that limit.
        frame: Frame of its figures.
    """

    def on_markers(message: MarkerArray) -> None:
        try:
            parameters = _parameters(message, frame)
        except ValueError as error:
            node.get_logger().warning(f'workspace: {error}')
            return
        for result in node.set_parameters(parameters):
            if not result.successful:
                node.get_logger().warning(f'workspace: {result.reason}')

    node.create_subscription(MarkerArray, 'workspace', on_markers, LATCHED)


def _parameters(message: MarkerArray, frame: str) -> list[Parameter]:
    """The parameters that stand for the markers. Raises ValueError for one that is no shape."""
    shapes: dict[str, list[float]] = {f'{side}_{kind}': [] for side in _SIDES for kind in _SIZES}
    for marker in message.markers:
        if marker.action == Marker.ADD:
            name, numbers = _shape(marker, frame)
            shapes[name] += numbers
    none = {name: [0.0] * _SIZES[name.split('_')[1]] for name in shapes}
    return [
        Parameter(f'workspace.{name}', value=numbers or none[name])
        for name, numbers in shapes.items()
    ]


def _shape(marker: Marker, frame: str) -> tuple[str, list[float]]:
    """The kind of shape and its numbers. Raises ValueError."""
    place = marker.pose.position
    size = marker.scale
    turn = marker.pose.orientation
    if marker.ns not in _SIDES:
        raise ValueError(f'got the namespace {marker.ns!r}; expected inside or outside')
    if marker.header.frame_id not in ('', frame):
        raise ValueError(f'got the frame {marker.header.frame_id!r}; expected {frame!r}')
    centre = np.array((place.x, place.y, place.z))
    if marker.type == Marker.SPHERE and size.x == size.y == size.z:
        return f'{marker.ns}_spheres', [*centre.tolist(), size.x / 2.0]
    is_upright = abs(turn.x) + abs(turn.y) + abs(turn.z) < 1e-6
    if marker.type == Marker.CUBE and is_upright:
        half = np.array((size.x, size.y, size.z)) / 2.0
        return f'{marker.ns}_boxes', [*(centre - half).tolist(), *(centre + half).tolist()]
    raise ValueError(
        f'got marker {marker.id} of type {marker.type}; expected a CUBE along the axes of {frame}, '
        'or a SPHERE of one diameter'
    )


def _to_marker(shape: DrawnShape) -> Marker:
    kind = Marker.SPHERE if shape.kind == SPHERE else Marker.CUBE
    colour = _GREEN if shape.keeps_in else _RED
    marker = make_marker('', kind, 0.0, _GREY if shape.is_solid else colour)
    marker.scale.x, marker.scale.y, marker.scale.z = shape.size.tolist()
    marker.pose.position = to_point(shape.centre)
    turn = marker.pose.orientation
    turn.x, turn.y, turn.z, turn.w = shape.quaternion
    return marker
