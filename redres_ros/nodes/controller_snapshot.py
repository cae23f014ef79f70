"""`controller/snapshot`: the arm's state for displays, twenty times a second.

A page that subscribed to states, commands and task velocities at the robot's rate made sim, planner
and controller send one more message each in every cycle. That added a tenth to the median response
time.
"""

from typing import NamedTuple

import numpy as np
from rclpy.node import Node
from std_msgs.msg import Float64MultiArray, MultiArrayDimension, MultiArrayLayout

from redres_ros.command import FIGURES, Command, norm
from redres_ros.errors import ArrayError
from redres_ros.nodes.telemetry import Telemetry
from redres_ros.vectors import check_finite

_NAME = 'snapshot'  # below the controller's own
TOPIC = f'controller/{_NAME}'
PERIOD = 50_000_000  # [ns] of the robot's clock from one to the next

_ROWS = 4


class Figures(NamedTuple):
    """What is plotted of one instant, by the names of the controller's topics; velocity and
    acceleration are the largest since the last one.

    Attributes:
        time: Of the robot's clock [s].
    """

    time: float
    joint_velocity_norm: float
    joint_acceleration_norm: float
    null_velocity_norm: float
    joint_torque_norm: float
    min_singular_value: float
    task_scaling: float


class ControllerSnapshot(NamedTuple):
    """The arm at one tick.

    Attributes:
        figures: Of that tick.
        q: Measured positions, (n,) [rad].
        q_prev: Where the reference came from, (n,) [rad].
        dq_prev: Velocity that was commanded the tick before, (n,) [rad/s].
        dq: Velocity that is commanded, (n,) [rad/s].
    """

    figures: Figures
    q: np.ndarray
    q_prev: np.ndarray
    dq_prev: np.ndarray
    dq: np.ndarray

    @classmethod
    def of(
        cls, stamp: int, command: Command, speed: float, acceleration: float
    ) -> 'ControllerSnapshot':
        """The snapshot of a command.

        Args:
            stamp: Of the state that it is for [ns].
            command: The command.
            speed: Largest norm of the joint velocity since the last snapshot [rad/s].
            acceleration: The same of the joint acceleration [rad/s^2].
        """
        values = {name: figure(command) for name, figure in FIGURES.items()}
        values |= {'joint_velocity_norm': speed, 'joint_acceleration_norm': acceleration}
        figures = Figures(stamp / 1e9, **values)
        q_prev = command.q_ref - command.T * command.dq
        return cls(figures, command.state.q, q_prev, command.state.dq_prev, command.dq)


def to_message(snapshot: ControllerSnapshot) -> Float64MultiArray:
    """A message with the figures in front, and below them a row for each vector."""
    n = len(snapshot.q)
    rows = MultiArrayDimension(label='row', size=_ROWS, stride=_ROWS * n)
    joints = MultiArrayDimension(label='joint', size=n, stride=n)
    layout = MultiArrayLayout(dim=[rows, joints], data_offset=len(snapshot.figures))
    return Float64MultiArray(layout=layout, data=np.concatenate(snapshot).tolist())


def from_message(message: Float64MultiArray, n: int) -> ControllerSnapshot:
    """The snapshot in a message.

    Args:
        message: Of the topic.
        n: Number of the arm's joints.

    Raises:
        ArrayError: A message of another length, NaN or infinity.
    """
    data = np.array(message.data)
    head = len(Figures._fields)
    if data.shape != (head + _ROWS * n,):
        raise ArrayError(f'a snapshot of {data.size} numbers; expected {head + _ROWS * n}')
    check_finite(data, 'a snapshot')
    return ControllerSnapshot(Figures(*data[:head].tolist()), *data[head:].reshape(_ROWS, n))


class SnapshotPublisher:
    """Publishes snapshots while there is a subscriber.

    Args:
        node: The controller.
    """

    def __init__(self, node: Node) -> None:
        self._telemetry = Telemetry(node, {_NAME: Float64MultiArray})
        self._published = 0  # stamp of the newest one [ns]
        self._speed = 0.0  # the largest since then [rad/s]
        self._acceleration = 0.0  # the same [rad/s^2]

    def see(self, stamp: int, command: Command) -> None:
        """Take in a command, and publish if it is time.

        Args:
            stamp: Of the state [ns].
            command: The command for it.
        """
        if not self._telemetry.has_subscribers:
            return
        elapsed = stamp - self._published
        if not 0 <= elapsed < 2 * PERIOD:
            self._begin(stamp)  # a subscriber has come, or it is another clock
        self._speed = max(self._speed, norm(command.dq))
        self._acceleration = max(self._acceleration, norm(command.ddq))
        if elapsed >= PERIOD:
            snapshot = ControllerSnapshot.of(stamp, command, self._speed, self._acceleration)
            self._telemetry.publish(_NAME, lambda: to_message(snapshot))
            self._begin(stamp)

    def _begin(self, stamp: int) -> None:
        """Begin the time of the next one at a stamp [ns]."""
        self._published = stamp
        self._speed = 0.0
        self._acceleration = 0.0
