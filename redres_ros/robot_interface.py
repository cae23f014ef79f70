"""The kinds of robot interface, and where a robot is in cycles without a command.

What follows from the kind of robot is stated here once, instead of being set for each robot.
"""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from redres_ros.types import (
    Cycles,
    JointAccelerations,
    JointPositions,
    JointVelocities,
    Radians,
    Seconds,
)

HOLD = 'hold'


class Published(NamedTuple):
    """The last reference, from which the robot and the next reference continue.

    Attributes:
        command: The velocity that was commanded; another one than dq, that of the reference, only
            if references are integrated from measurements.
    """

    q: JointPositions
    dq: JointVelocities
    ddq: JointAccelerations
    command: JointVelocities

    @classmethod
    def at_rest(cls, q: JointPositions) -> 'Published':
        """A reference without velocity."""
        zeros = np.zeros(len(q))
        return cls(q, zeros, zeros, zeros)


@dataclass(frozen=True)
class RobotInterface:
    """What a kind of robot does.

    Attributes:
        bridging: What it does in a cycle without a command: 'hold' the last one, or continue at
            constant 'velocity' or 'acceleration'.
        lost: Commands that may get lost until three in a row have come, whose bridging at constant
            acceleration must not look like a jerk to the robot.
        restart_after: Cycles without a state after which the controller restarts from the measured
            position.
        following_tolerance: Following error at which an arm counts as stopped.
        patience: How long its clock waits for a late command.
        forwards_commands: Commands also go to forward_position_controller/commands.
    """

    bridging: str
    lost: Cycles = 0
    restart_after: Cycles = 5
    following_tolerance: Radians = 0.1
    patience: Seconds = 0.0
    forwards_commands: bool = False

    @property
    def holds(self) -> bool:
        """Whether the robot stays at its last command."""
        return self.bridging == HOLD

    def bridged(
        self,
        published: Published,
        missed: Cycles,
        q_range: tuple[JointPositions, JointPositions],
        T: Seconds,
    ) -> Published:
        """Where the robot is, `missed` cycles after the last reference, as if that was published.

        One that extrapolates stops at the ends of its range.
        """
        q, dq, ddq, command = published
        if not missed:
            return published
        zeros = np.zeros(len(q))
        if self.holds:
            return Published(q, zeros, zeros, command)
        if self.bridging == 'velocity' or not dq.any():
            ddq = zeros
        ahead = q + T * missed * (dq + T * (missed + 1) / 2.0 * ddq)
        q_min, q_max = q_range
        stopped = np.clip(ahead, np.minimum(q_min, q), np.maximum(q_max, q))
        dq_ahead = np.where(stopped == ahead, dq + T * missed * ddq, 0.0)
        return Published(stopped, dq_ahead, ddq, command)


ROBOT_INTERFACES: dict[str, RobotInterface] = {
    'fri': RobotInterface('velocity'),
    'fci': RobotInterface('acceleration', lost=3, restart_after=19),
    'ros2_control': RobotInterface(HOLD, forwards_commands=True),
    'sim': RobotInterface('velocity', patience=5.0),  # the node sim, whose clock waits
}
