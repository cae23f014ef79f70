"""The controller's telemetry of each tick, and `controller/snapshot`, twenty times a second.

A page that subscribed to states, commands and task velocities at the robot's rate made sim, planner
and controller send one more message each in every cycle. That added a tenth to the median response
time.
"""

from functools import partial

import numpy as np
from geometry_msgs.msg import PoseStamped
from rclpy.node import Node
from std_msgs.msg import Float64, Float64MultiArray, String

from redres_ros.command import VALUES, norm
from redres_ros.errors import ArrayError
from redres_ros.laws import law_name
from redres_ros.loop.command_loop import Response
from redres_ros.loop.cycle_counter import NANOSECONDS
from redres_ros.nodes.conversions import to_pose
from redres_ros.nodes.topics import Telemetry
from redres_ros.policy import Policy
from redres_ros.types import JointPositions, Seconds, check_finite

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
# [s] after which the scaling is repeated; the planner waits for 0.1 s, and nine of ten may be lost
_SCALING_PERIOD = 0.008
_LIMITS_PERIOD = 0.1  # [s] between two messages of the active limits

# Values of one instant, named as the topics; those of dq and ddq: the largest since the last. The
# time [s] is that of the robot's clock.
Figures = dict[str, float]
_FIGURES = ('time', *VALUES)


def from_message(message: Float64MultiArray, n: int) -> tuple[Figures, JointPositions]:
    """Figures and measured positions of an arm with n joints from a message. Raises ArrayError for
    any other message, NaN or infinity.
    """
    data = np.array(message.data)
    head = len(_FIGURES)
    if data.shape != (head + n,):
        raise ArrayError(f'a snapshot of {data.size} numbers; expected {head + n}')
    check_finite(data, 'a snapshot')
    return dict(zip(_FIGURES, data[:head].tolist(), strict=True)), data[head:]


class MotionTelemetry:
    """The controller's topics for displays and recorders; the tip's pose is in the frame."""

    def __init__(self, node: Node, frame: str, T: Seconds) -> None:
        own = {f'{node.get_name()}/{name}': kind for name, kind in _TYPES.items()}
        self._telemetry = Telemetry(node, own)
        self._frame = frame
        self._scaling = 0.0  # published last
        self._ticks = 0
        self._scaling_every = max(round(_SCALING_PERIOD / T), 1)  # ticks
        self._limits_every = round(_LIMITS_PERIOD / T)
        self._snapshot_every = round(PERIOD / NANOSECONDS / T)
        self._speed = 0.0  # the largest norm of dq since the last snapshot [rad/s]
        self._acceleration = 0.0  # the same of ddq [rad/s^2]

    def publish_change(self, scaling: float) -> None:
        """Publish the task scaling, if it has changed: every message wakes up the planner."""
        if scaling != self._scaling:
            self._scaling = scaling
            self._telemetry.publish(_SCALING, lambda: scaling)

    def publish(self, response: Response, policy: Policy) -> None:
        """Publish every topic with a subscriber; some only now and then."""
        command = response.command
        publish = self._telemetry.publish
        self._ticks += 1
        if self._ticks % self._scaling_every == 0:
            publish(_SCALING, lambda: response.scaling)
        if self._ticks % self._limits_every == 0:
            publish(_LIMITS, lambda: command.active_limits)
        if _SNAPSHOT in self._telemetry.subscribed:
            self._speed = max(self._speed, norm(command.dq))
            self._acceleration = max(self._acceleration, norm(command.ddq))
        if self._ticks % self._snapshot_every == 0:
            publish(_SNAPSHOT, lambda: self._snapshot(response))
            self._speed = 0.0
            self._acceleration = 0.0
        if self._telemetry.subscribed.isdisjoint(_EVERY_TICK):
            return
        publish('tip_pose', lambda: self._tip_pose(response))
        for name, value in _VALUES.items():
            publish(name, partial(value, command))
        publish('lost_velocity', lambda: norm(command.unachieved))
        publish('law', lambda: law_name(policy.law))

    def _snapshot(self, response: Response) -> Float64MultiArray:
        values = {name: value(response.command) for name, value in VALUES.items()}
        values['joint_velocity_norm'] = self._speed
        values['joint_acceleration_norm'] = self._acceleration
        q = response.command.state.q
        time = response.stamp / NANOSECONDS  # [s]
        return Float64MultiArray(data=[time, *values.values(), *q.tolist()])

    def _tip_pose(self, response: Response) -> PoseStamped:
        x, R = response.command.state.model.tip(response.q)
        return to_pose(response.stamp, self._frame, x, R)
