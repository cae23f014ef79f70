"""The kinds of robot interface: what such a robot does without a command, and where commands go.

What follows from the kind of robot is stated here once, instead of being set for each robot.
"""

from dataclasses import dataclass

from redres_ros.types import Cycles, Radians


@dataclass(frozen=True)
class RobotInterface:
    """What a kind of robot does.

    Attributes:
        bridging: What it does in a cycle without a command: 'extrapolate' the last ones at constant
            velocity, 'extrapolate_acceleration', or 'hold' the last one.
        restart_after: Cycles without a state after which the controller restarts from the measured
            position.
        following_tolerance: Following error at which an arm counts as stopped.
        forwards_commands: Commands also go to forward_position_controller/commands.
    """

    bridging: str
    restart_after: Cycles = 5
    following_tolerance: Radians = 0.1
    forwards_commands: bool = False


ROBOT_INTERFACES: dict[str, RobotInterface] = {
    'fri': RobotInterface('extrapolate'),
    'fci': RobotInterface('extrapolate_acceleration', restart_after=19),
    'ros2_control': RobotInterface('hold', forwards_commands=True),
}
