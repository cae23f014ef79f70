"""The controller's telemetry of each tick, and `controller/snapshot`, twenty times a second.

A page that subscribed to states, commands and task velocities at the robot's rate made sim, planner
and controller send one more message each in every cycle. That added a tenth to the median response
time.
"""

from functools import partial
from typing import NamedTuple

import numpy as np
from geometry_msgs.msg import PoseStamped
from rclpy.node import Node
from std_msgs.msg import Float64, Float64MultiArray, String

from redres_ros.command import VALUES, Command, norm
from redres_ros.errors import ArrayError
from redres_ros.laws import law_name
from redres_ros.loop.command_loop import Response
from redres_ros.nodes.conversions import to_pose
from redres_ros.nodes.topics import Telemetry
from redres_ros.policy import Policy
from redres_ros.types import JointPositions, Nanoseconds, Seconds, check_finite

TOPIC = 'controller/snapshot'
PERIOD = 50_000_000  # [ns] of the robot's clock from one snapshot to the next

_SNAPSHOT = 'snapshot'
_SCALING = 'task_scaling'
_LIMITS = 'active_limits'
_VALUES = {name: value for name, value in VALUES.items() if name != _SCALING}
_EVERY_TICK = ('tip_pose', *_VALUES, 'lost_velocity', 'law')  # others are published less often
_TYPES = {
    'tip_pose': PoseStamped,
    **dict.fromkeys((*VALUES, 'lost_velocity'), Float64),
    'law': String,
    _LIMITS: String,
    _SNAPSHOT: Float64MultiArray,
}
# [s] after which an unchanged scaling is repeated; the planner waits for 0.1 s, and nine of ten
# may be lost
_REMINDER = 0.008
_LIMITS_PERIOD = 0.1  # [s] at least between two messages of the active limits
_LIMITS_REMINDER = 0.5  # [s] the same, while none acts


class Figures(NamedTuple):
    """Values of one instant, named as the topics; those of dq and ddq: the largest since the last.

    The time is that of the robot's clock.
    """

    time: Seconds
    joint_velocity_norm: float
    joint_acceleration_norm: float
    null_velocity_norm: float
    joint_torque_norm: float
    min_singular_value: float
    task_scaling: float


class ControllerSnapshot(NamedTuple):
    """The arm at one tick: its figures, and the measured positions."""

    figures: Figures
    q: JointPositions


def to_message(snapshot: ControllerSnapshot) -> Float64MultiArray:
    """A message with the figures in front of the positions."""
    return Float64MultiArray(data=np.concatenate(snapshot).tolist())


def from_message(message: Float64MultiArray, n: int) -> ControllerSnapshot:
    """The snapshot of an arm with n joints in a message. Raises ArrayError for any other message,
    NaN or infinity.
    """
    data = np.array(message.data)
    head = len(Figures._fields)
    if data.shape != (head + n,):
        raise ArrayError(f'a snapshot of {data.size} numbers; expected {head + n}')
    check_finite(data, 'a snapshot')
    return ControllerSnapshot(Figures(*data[:head].tolist()), data[head:])


class SnapshotPublisher:
    """Publishes snapshots by the controller's telemetry, while there is a subscriber."""

    def __init__(self, telemetry: Telemetry) -> None:
        self._telemetry = telemetry
        self._begin(0)

    def _begin(self, stamp: Nanoseconds) -> None:
        self._stamp = stamp  # of the newest one
        self._speed = 0.0  # the largest norm of dq since then [rad/s]
        self._acceleration = 0.0  # the same of ddq [rad/s^2]

    def see(self, stamp: Nanoseconds, command: Command) -> None:
        """Record the command for a state, and publish if it is time."""
        if _SNAPSHOT not in self._telemetry.subscribed:
            return
        elapsed = stamp - self._stamp
        if not 0 <= elapsed < 2 * PERIOD:  # a subscriber has come, or it is another clock
            self._begin(stamp)
        self._speed = max(self._speed, norm(command.dq))
        self._acceleration = max(self._acceleration, norm(command.ddq))
        if elapsed >= PERIOD:
            self._telemetry.publish(_SNAPSHOT, lambda: to_message(self._snapshot(stamp, command)))
            self._begin(stamp)

    def _snapshot(self, stamp: Nanoseconds, command: Command) -> ControllerSnapshot:
        values = {name: value(command) for name, value in VALUES.items()}
        values['joint_velocity_norm'] = self._speed
        values['joint_acceleration_norm'] = self._acceleration
        return ControllerSnapshot(Figures(stamp / 1e9, **values), command.state.q)


class MotionTelemetry:
    """The controller's topics for displays and recorders; the tip's pose is in the frame."""

    def __init__(self, node: Node, frame: str, T: Seconds) -> None:
        own = {f'{node.get_name()}/{name}': kind for name, kind in _TYPES.items()}
        self._telemetry = Telemetry(node, own)
        self._snapshots = SnapshotPublisher(self._telemetry)
        self._frame = frame
        self._scaling = 0.0  # published last
        self._scaling_age = 0  # ticks since then
        self._scaling_oldest = max(round(_REMINDER / T), 1)
        self._active_limits = ''  # published last
        self._limits_age = 0  # ticks since then
        self._limits_soonest = round(_LIMITS_PERIOD / T)
        self._limits_oldest = round(_LIMITS_REMINDER / T)

    def publish_change(self, scaling: float) -> None:
        """Publish the task scaling, if it has changed: every message wakes up the planner."""
        if scaling != self._scaling:
            self._publish_scaling(scaling)

    def publish(self, response: Response, policy: Policy) -> None:
        """Publish every topic with a subscriber, and repeat the task scaling now and then."""
        self._scaling_age += 1
        if self._scaling_age >= self._scaling_oldest:
            self._publish_scaling(response.scaling)
        command = response.command
        self._publish_limits(command)
        self._snapshots.see(response.stamp, command)
        if self._telemetry.subscribed.isdisjoint(_EVERY_TICK):
            return
        publish = self._telemetry.publish
        publish('tip_pose', lambda: self._tip_pose(response))
        for name, value in _VALUES.items():
            publish(name, partial(value, command))
        publish('lost_velocity', lambda: norm(command.unachieved))
        publish('law', lambda: law_name(policy.law))

    def _publish_scaling(self, scaling: float) -> None:
        self._scaling = scaling
        self._scaling_age = 0
        self._telemetry.publish(_SCALING, lambda: scaling)

    def _publish_limits(self, command: Command) -> None:
        """Publish which limits act: often while they do or have just changed, else now and then."""
        self._limits_age += 1
        is_quiet = not command.active_limit and not self._active_limits
        if self._limits_age >= (self._limits_oldest if is_quiet else self._limits_soonest):
            self._active_limits = command.active_limits
            self._limits_age = 0
            self._telemetry.publish(_LIMITS, lambda: command.active_limits)

    def _tip_pose(self, response: Response) -> PoseStamped:
        """The measured pose of the tip."""
        x, R = response.command.state.model.tip(response.q)
        return to_pose(response.stamp, self._frame, x, R)
