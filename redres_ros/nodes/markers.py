"""`markers` for RViz: the paths of tip and elbow, and the points of the task."""

from collections import deque
from collections.abc import Iterable

import numpy as np
from geometry_msgs.msg import Point
from rclpy.node import Node
from std_msgs.msg import ColorRGBA
from visualization_msgs.msg import Marker, MarkerArray

from redres_ros.nodes.clocks import create_steady_timer
from redres_ros.nodes.topics import PUBLISH
from redres_ros.nodes.wire import to_time

PERIOD = 0.2  # [s] between two messages
_STEP = 50_000_000  # [ns] of the robot's clock between two points of a trace
_LENGTH = 200  # points of a trace: 10 s

_ORANGE = ColorRGBA(r=0.95, g=0.55, b=0.1, a=1.0)
_BLUE = ColorRGBA(r=0.2, g=0.45, b=0.85, a=1.0)
_GREY = ColorRGBA(r=0.5, g=0.5, b=0.5, a=1.0)


class Markers:
    """Publishes `markers` a few times a second, while there is a subscriber.

    Args:
        node: Publishes.
        frame: Frame of all points.
        waypoints: The points of the task, (N, 3) [m].
    """

    def __init__(self, node: Node, frame: str, waypoints: np.ndarray) -> None:
        self._publisher = node.create_publisher(MarkerArray, 'markers', PUBLISH)
        self._tip: deque[Point] = deque(maxlen=_LENGTH)
        self._elbow: deque[Point] = deque(maxlen=_LENGTH)
        self._next = 0  # stamp from which the traces go on [ns]
        self._stamp = 0  # of the newest state [ns]
        self._points = make_marker('task', Marker.SPHERE_LIST, 0.015, _GREY)
        self._points.points = [to_point(x) for x in waypoints]
        self._traces = {
            'tip': (make_marker('tip', Marker.LINE_STRIP, 0.004, _ORANGE), self._tip),
            'elbow': (make_marker('elbow', Marker.LINE_STRIP, 0.004, _BLUE), self._elbow),
        }
        for marker in self._all():
            marker.header.frame_id = frame
        self.has_subscribers = False
        create_steady_timer(node, PERIOD, self._publish)

    def wants(self, stamp: int) -> bool:
        """Whether the state of this stamp [ns] is to be shown: a few times a second, if at all."""
        self._stamp = stamp
        return self.has_subscribers and not self._next - _STEP < stamp < self._next

    def see(self, stamp: int, tip: np.ndarray, elbow: np.ndarray) -> None:
        """Record where tip and elbow are at a state.

        Args:
            stamp: Stamp of the state [ns].
            tip: (3,) [m].
            elbow: (3,) [m].
        """
        self._next = stamp + _STEP
        self._tip.append(to_point(tip))
        self._elbow.append(to_point(elbow))

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


def make_marker(name: str, kind: int, size: float, color: ColorRGBA) -> Marker:
    """A marker without points.

    Args:
        name: Its namespace.
        kind: Such as Marker.SPHERE.
        size: Diameter or width [m].
        color: Colour of the marker.
    """
    marker = Marker(ns=name, type=kind, action=Marker.ADD, color=color)
    marker.scale.x = size
    if kind != Marker.LINE_STRIP:
        marker.scale.y = size
        marker.scale.z = size
    marker.pose.orientation.w = 1.0
    return marker


def to_point(x: np.ndarray) -> Point:
    """The message of a position x, (3,) [m]."""
    return Point(x=float(x[0]), y=float(x[1]), z=float(x[2]))
