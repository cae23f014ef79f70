"""The parameters of CommandLoop: when it moves, waits, stops and resumes."""

from dataclasses import dataclass

from redres_ros.controller import BRIDGING
from redres_ros.parameter import check_parameters, param
from redres_ros.policy import SCALING

AUTO = 'auto'


def why_it_would_leap(forward_commands: bool, bridging: str) -> str:
    """Why the arm would leap after a missed state; empty if it would not.

    Args:
        forward_commands: Whether commands go to a controller of ros2_control.
        bridging: One of BRIDGING.
    """
    if forward_commands and bridging != 'hold':
        return (
            f'bridging is {bridging}: a robot behind ros2_control holds its last command, '
            'and would leap after a missed state; set bridging to hold'
        )
    return ''


@dataclass(frozen=True)
class LoopSettings:
    """When the controller follows, waits, holds, or restarts.

    Raises RangeError or UnknownNameError for a value that is not allowed.
    """

    command_timeout: float = param(
        0.1, 'age at which a cartesian_velocity counts as stale [s]', 0.001, 10.0, live=True
    )
    max_linear: float = param(
        2.0, 'largest linear task velocity; a faster one is refused [m/s]', 0.001, 100.0, live=True
    )
    max_angular: float = param(
        6.0,
        'the same for the angular task velocity [rad/s]',
        0.001,
        100.0,
        live=True,
    )
    twist_patience: float = param(
        0.0,
        'how long a state waits for its cartesian_velocity, for a robot that waits for commands; '
        '0 for any other [s]',
        0.0,
        60.0,
    )
    restart_after: int = param(
        5,
        'cycles without a state after which the controller restarts from the measured position',
        0,
        1000,
    )
    bridging: str = param(
        'extrapolate',
        'what the robot does in a cycle without a command: extrapolate the last ones at constant '
        'velocity, as FRI does, or at constant acceleration, as libfranka does, or hold the last '
        'one, as ros2_control does',
        choices=BRIDGING,
    )
    following_tolerance: float = param(
        0.1,
        'following error of a joint at which the arm counts as stopped, and the controller '
        'restarts from the measured position [rad]',
        0.001,
        10.0,
    )
    scaling: str = param(
        AUTO,
        'what limits scale: the task velocity as a whole, or its components, translation and '
        'rotation; auto: the components of a velocity that is not computed from a state, as that '
        'of teleoperation',
        choices=(AUTO, *SCALING),
        live=True,
    )
    lockstep: bool = param(
        False, 'respond to a state only together with the cartesian_velocity of the same stamp'
    )

    def __post_init__(self) -> None:
        check_parameters(self)

    @property
    def longest_gap(self) -> int:
        """Cycles until the next command, at most, in which the robot goes on by itself."""
        goes_on = self.bridging != 'hold' and not self.lockstep
        return self.restart_after + 1 if goes_on else 1
