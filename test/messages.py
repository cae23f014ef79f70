"""Messages that tests send."""

import numpy as np
from geometry_msgs.msg import TwistStamped

from redres_ros.nodes.conversions import to_time


def to_twist(stamp: int, frame: str, dx: np.ndarray) -> TwistStamped:
    """A task velocity in the axes of a frame: (3,) [m/s], or (6,) with the angular part [rad/s]."""
    message = TwistStamped()
    message.header.stamp = to_time(stamp)
    message.header.frame_id = frame
    linear = message.twist.linear
    angular = message.twist.angular
    linear.x, linear.y, linear.z = dx[:3].tolist()
    if len(dx) == 6:
        angular.x, angular.y, angular.z = dx[3:].tolist()
    return message
