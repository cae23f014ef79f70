"""Publishes what an operator asks for: task velocities, or poses of the tip."""

import numpy as np
from geometry_msgs.msg import PoseStamped, TwistStamped
from rclpy.node import Node

from redres_ros.nodes.conversions import to_pose, to_twist
from redres_ros.nodes.topics import PUBLISH

TOPIC = 'cartesian_velocity'

_LAST_ZEROS = 0.3  # [s] for which zeros follow a motion; then others may have the topic
_NOW = 0  # a stamp that means: as soon as it comes


class TwistPublisher:
    """Publishes on `cartesian_velocity`, and nothing while no velocity is asked for.

    Args:
        node: Publishes.
        frame: Link along whose axes the velocities are; empty: the base.
    """

    def __init__(self, node: Node, frame: str = '') -> None:
        self._frame = frame
        self._moved_at = -np.inf  # [s] when the task velocity was last not zero
        self._publisher = node.create_publisher(TwistStamped, TOPIC, PUBLISH)

    def publish(self, dx: np.ndarray, now: float) -> None:
        """Publish a task velocity, unless none was asked for lately.

        Args:
            dx: (6,) [m/s], [rad/s].
            now: [s].
        """
        if dx.any():
            self._moved_at = now
        if now - self._moved_at < _LAST_ZEROS:
            self._publisher.publish(to_twist(_NOW, self._frame, dx))

    def stop(self) -> None:
        """Publish a zero task velocity, if there was another."""
        if np.isfinite(self._moved_at):
            self._publisher.publish(to_twist(_NOW, self._frame, np.zeros(6)))

    @property
    def listeners(self) -> int:
        """Number of its subscribers."""
        return self._publisher.get_subscription_count()


class TargetPublisher:
    """Publishes on `target_pose`, in the frame of the base.

    Args:
        node: Publishes.
    """

    def __init__(self, node: Node) -> None:
        self._publisher = node.create_publisher(PoseStamped, 'target_pose', PUBLISH)

    def publish(self, x: np.ndarray, R: np.ndarray) -> None:
        """Publish a target of now.

        Args:
            x: Position, (3,) [m].
            R: Orientation, (3, 3).
        """
        self._publisher.publish(to_pose(_NOW, '', x, R))

    @property
    def listeners(self) -> int:
        """Number of its subscribers."""
        return self._publisher.get_subscription_count()
