"""The controller's telemetry of each tick."""

from functools import partial

from geometry_msgs.msg import PoseStamped
from rclpy.node import Node
from std_msgs.msg import Float64, String

from redres_ros.command import FIGURES, Command, norm
from redres_ros.laws import Law, law_name
from redres_ros.loop.command_loop import Response
from redres_ros.loop.limit_report import report
from redres_ros.nodes.controller_snapshot import SnapshotPublisher
from redres_ros.nodes.conversions import to_pose
from redres_ros.nodes.telemetry import Telemetry

_SCALING = 'task_scaling'
_FIGURES = {name: figure for name, figure in FIGURES.items() if name != _SCALING}
# [s] after which an unchanged scaling is repeated; the planner waits for 0.1 s, and nine of ten
# may be lost
_REMINDER = 0.008
_LIMITS_PERIOD = 0.1  # [s] at least between two messages of the active limits
_LIMITS_REMINDER = 0.5  # [s] the same, while none acts


class MotionTelemetry:
    """The controller's topics for displays and recorders.

    Args:
        node: Publishes.
        frame: Which the tip's pose is in.
        T: The controller's cycle [s].
    """

    def __init__(self, node: Node, frame: str, T: float) -> None:
        numbers = dict.fromkeys((*_FIGURES, 'lost_velocity'), Float64)
        self._telemetry = Telemetry(node, {'tip_pose': PoseStamped, **numbers, 'law': String})
        # By themselves: the planner always listens to them.
        self._scaling_telemetry = Telemetry(node, {_SCALING: Float64})
        self._limits_telemetry = Telemetry(node, {'active_limits': String})
        self._snapshots = SnapshotPublisher(node)
        self._frame = frame
        self._scaling = 0.0  # published last
        self._unsaid = 0  # ticks since then
        self._unsaid_most = max(round(_REMINDER / T), 1)
        self._active_limits = ''  # published last
        self._limits_age = 0  # ticks since then
        self._limits_least = round(_LIMITS_PERIOD / T)
        self._limits_most = round(_LIMITS_REMINDER / T)

    def publish_change(self, scaling: float) -> None:
        """Publish the task scaling, if it has changed.

        The planner listens, so every message of these would wake it up.
        """
        if scaling != self._scaling:
            self._publish_scaling(scaling)

    def _publish_scaling(self, scaling: float) -> None:
        self._scaling = scaling
        self._unsaid = 0
        self._scaling_telemetry.publish(_SCALING, lambda: scaling)

    def publish(self, response: Response, law: Law) -> None:
        """Publish every topic with a subscriber, and repeat the task scaling now and then.

        Args:
            response: Of this tick.
            law: In force.
        """
        self._unsaid += 1
        if self._unsaid >= self._unsaid_most:
            self._publish_scaling(response.scaling)
        self._publish_limits(response.command)
        self._snapshots.see(response.stamp, response.command)
        if not self._telemetry.has_subscribers:
            return
        publish = self._telemetry.publish
        command = response.command
        publish('tip_pose', lambda: self._tip_pose(response))
        for name, figure in _FIGURES.items():
            publish(name, partial(figure, command))
        publish('lost_velocity', lambda: norm(command.unachieved))
        publish('law', lambda: law_name(law))

    def _publish_limits(self, command: Command) -> None:
        """Publish which limits act: often while they do or have just changed, else now and then."""
        self._limits_age += 1
        is_quiet = not command.active_limits and not self._active_limits
        if self._limits_age >= (self._limits_most if is_quiet else self._limits_least):
            self._active_limits = command.active_limits
            self._limits_age = 0
            self._limits_telemetry.publish('active_limits', lambda: report(command).text)

    def _tip_pose(self, response: Response) -> PoseStamped:
        """The measured pose of the tip."""
        x, R = response.command.state.model.tip(response.q)
        return to_pose(response.stamp, self._frame, x, R)
