"""ROS in the process of a test."""

from collections.abc import Iterator
from contextlib import contextmanager

import rclpy

from redres_ros.nodes.runtime import own_domain, start


@contextmanager
def ros(*arguments: str) -> Iterator[None]:
    """ROS with these arguments of a command line, in a domain of its own.

    A signal ends the tests, as everywhere. rclpy's own handlers would only shut ROS down: the test
    would go on without it, and fail at its end because 'rcl_shutdown' was 'already called'.
    """
    with own_domain():
        start(['--ros-args', *arguments])
        try:
            yield
        finally:
            rclpy.try_shutdown()
