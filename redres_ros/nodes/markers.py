"""`markers` for RViz: the paths of tip and elbow, the points of the task, and obstacles."""

from collections import deque
from collections.abc import Iterable, Iterator

import numpy as np
from geometry_msgs.msg import Point
from rclpy.node import Node
from std_msgs.msg import ColorRGBA
from visualization_msgs.msg import Marker, MarkerArray

from redres_ros.nodes.clocks import create_steady_timer
from redres_ros.nodes.qos import PUBLISH
from redres_ros.nodes.stamps import to_time

PERIOD = 0.2  # [s] between two messages
_OBSTACLES_PERIOD = 1.0  # [s]
_STEP = 50_000_000  # [ns] of the robot's clock between two points of a trace
_LENGTH = 200  # points of a trace: 10 s

_ORANGE = ColorRGBA(r=0.95, g=0.55, b=0.1, a=1.0)
_BLUE = ColorRGBA(r=0.2, g=0.45, b=0.85, a=1.0)
_RED = ColorRGBA(r=0.85, g=0.2, b=0.2, a=0.4)
_GREY = ColorRGBA(r=0.5, g=0.5, b=0.5, a=1.0)


class Markers:
    """Publishes `markers` a few times a second, while there is a subscriber.

    Args:
        node: Publishes.
        frame: Of all points.
        waypoints: The points of the task, (N, 3) [m].
    """

    def __init__(self, node: Node, frame: str, waypoints: np.ndarray) -> None:
        self._publisher = node.create_publisher(MarkerArray, 'markers', PUBLISH)
        self._tip: deque[Point] = deque(maxlen=_LENGTH)
        self._elbow: deque[Point] = deque(maxlen=_LENGTH)
        self._next = 0  # stamp from which the traces go on [ns]
        self._stamp = 0  # of the newest state [ns]
        self._points = _marker('task', Marker.SPHERE_LIST, 0.015, _GREY)
        self._points.points = [_point(x) for x in waypoints]
        self._traces = {
            'tip': (_marker('tip', Marker.LINE_STRIP, 0.004, _ORANGE), self._tip),
            'elbow': (_marker('elbow', Marker.LINE_STRIP, 0.004, _BLUE), self._elbow),
        }
        for marker in self._all():
            marker.header.frame_id = frame
        self.has_subscribers = False
        create_steady_timer(node, PERIOD, self._publish)

    def wants(self, stamp: int) -> bool:
        """Whether the arm of a state [ns] is to be shown to it: some times a second, if at all."""
        self._stamp = stamp
        return self.has_subscribers and not self._next - _STEP < stamp < self._next

    def see(self, stamp: int, tip: np.ndarray, elbow: np.ndarray) -> None:
        """Take in where tip and elbow are at a state.

        Args:
            stamp: Of the state [ns].
            tip: (3,) [m].
            elbow: (3,) [m].
        """
        self._next = stamp + _STEP
        self._tip.append(_point(tip))
        self._elbow.append(_point(elbow))

    def _publish(self) -> None:
        self.has_subscribers = self._publisher.get_subscription_count() > 0
        if not self.has_subscribers:
            return
        stamp = to_time(self._stamp)
        for marker, points in self._traces.values():
            marker.points = list(points)
            # RViz complains of a line of less than two points.
            marker.action = Marker.ADD if len(points) > 1 else Marker.DELETE
        for marker in self._all():
            marker.header.stamp = stamp
        self._publisher.publish(MarkerArray(markers=list(self._all())))

    def _all(self) -> Iterable[Marker]:
        yield self._points
        for marker, _ in self._traces.values():
            yield marker


def show_obstacles(node: Node, frame: str) -> None:
    """Have a node publish the spheres and the floor of its limit `collision`.

    Args:
        node: With the parameters of that limit.
        frame: Of its figures.
    """
    publisher = node.create_publisher(MarkerArray, 'markers', PUBLISH)

    shown: set[int] = set()

    def publish() -> None:
        if publisher.get_subscription_count() == 0:
            return
        markers = list(_obstacles(node))
        present = {marker.id for marker in markers}
        gone = shown - present
        shown.clear()
        shown.update(present)
        # One by one: to delete all would take the traces along.
        markers += [Marker(ns='obstacles', id=number, action=Marker.DELETE) for number in gone]
        for marker in markers:
            marker.header.frame_id = frame
        publisher.publish(MarkerArray(markers=markers))

    create_steady_timer(node, _OBSTACLES_PERIOD, publish)


def _obstacles(node: Node) -> Iterator[Marker]:
    if 'collision' in node.get_parameter('limits').value:
        yield _floor(node.get_parameter('collision.floor').value)
        spheres = np.reshape(node.get_parameter('collision.spheres').value, (-1, 4))
        for number, ball in enumerate(spheres, start=1):
            if ball[3] > 0.0:
                yield _ball(number, ball)


def _ball(number: int, ball: np.ndarray) -> Marker:
    """A sphere, (4,): centre and radius [m]."""
    marker = _marker('obstacles', Marker.SPHERE, 2.0 * float(ball[3]), _RED)
    marker.id = number
    marker.pose.position = _point(ball)
    return marker


def _floor(height: float) -> Marker:
    marker = _marker('obstacles', Marker.CUBE, 3.0, _RED)
    marker.scale.z = 0.001
    marker.pose.position.z = height - 0.0005
    return marker


def _marker(name: str, kind: int, size: float, color: ColorRGBA) -> Marker:
    """A marker without points; size: diameter or width [m]."""
    marker = Marker(ns=name, type=kind, action=Marker.ADD, color=color)
    marker.scale.x = size
    if kind != Marker.LINE_STRIP:
        marker.scale.y = size
        marker.scale.z = size
    marker.pose.orientation.w = 1.0
    return marker


def _point(x: np.ndarray) -> Point:
    return Point(x=float(x[0]), y=float(x[1]), z=float(x[2]))
