"""What the controller tells onlookers of each tick."""

from functools import partial

from geometry_msgs.msg import PoseStamped
from rclpy.node import Node
from std_msgs.msg import Float64, String

from redres_ros.command import FIGURES, norm
from redres_ros.following import Reply
from redres_ros.laws import Law, law_name
from redres_ros.nodes.conversions import to_pose
from redres_ros.nodes.telemetry import Telemetry

_SCALING = 'task_scaling'


class MotionTelemetry:
    """The controller's topics for onlookers.

    Args:
        node: Publishes.
        frame: Which the tip's pose is in.
    """

    def __init__(self, node: Node, frame: str) -> None:
        numbers = dict.fromkeys((*FIGURES, 'lost_velocity'), Float64)
        words = {'limiting': String, 'law': String}
        self._telemetry = Telemetry(node, {'tip_pose': PoseStamped, **numbers, **words})
        self._frame = frame
        self._scaling = 0.0  # published last
        self._is_published = False  # whether that was for this tick

    def publish_change(self, scaling: float) -> None:
        """Publish the share of the task that is executed if it is another one than before."""
        if scaling != self._scaling:
            self._publish_scaling(scaling)
            self._is_published = True

    def publish(self, answer: Reply, law: Law) -> None:
        """Publish all that is listened to.

        Args:
            answer: Of this tick.
            law: In force.
        """
        if not self._is_published:
            self._publish_scaling(answer.scaling)
        self._is_published = False
        if not self._telemetry.heard:
            return
        publish = self._telemetry.publish
        command = answer.command
        state = command.state
        publish('tip_pose', lambda: to_pose(answer.stamp, self._frame, state.x, state.R))
        for name, figure in FIGURES.items():
            if name != _SCALING:
                publish(name, partial(figure, command))
        publish('lost_velocity', lambda: norm(command.lost))
        publish('limiting', lambda: command.limiting)
        publish('law', lambda: law_name(law))

    def _publish_scaling(self, scaling: float) -> None:
        self._scaling = scaling
        self._telemetry.publish(_SCALING, lambda: scaling)
