"""The modes of the controller, and the one table of transitions.

| mode | publishes |
|---|---|
| inactive | nothing |
| mirroring | the measured position: the robot takes no commands |
| holding | the same reference, exactly; behind ros2_control where others have moved the arm |
| moving | the policy's reference, through the safety filter |
| stopping | braking within A |
"""

from enum import Enum
from typing import NamedTuple

# Session states in which a robot takes commands: of an LWR, an iiwa and a Franka arm.
COMMANDING = ('CMD', 'COMMANDING_ACTIVE', 'MOVE')


class Mode(Enum):
    """The mode of the controller."""

    INACTIVE = 'inactive'
    MIRRORING = 'mirroring'
    HOLDING = 'holding'
    MOVING = 'moving'
    STOPPING = 'stopping'


MOVING_MODES = (Mode.MOVING, Mode.STOPPING)  # in which references change


class Conditions(NamedTuple):
    """The conditions of transitions, at one state of the robot.

    Attributes:
        active: The controller is active, or not at rest yet.
        commandable: The robot takes commands.
        motion_allowed: Nothing blocks motion.
        motion_asked: Motion is allowed, and something asks for it.
        at_rest: The reference has come to rest, and nothing asks for motion.
    """

    active: bool
    commandable: bool
    motion_allowed: bool
    motion_asked: bool
    at_rest: bool


# In each mode the first transition counts whose condition has that value.
_TRANSITIONS: dict[Mode, tuple[tuple[str, bool, Mode], ...]] = {
    Mode.INACTIVE: (('active', True, Mode.HOLDING),),
    Mode.MIRRORING: (
        ('active', False, Mode.INACTIVE),
        ('commandable', True, Mode.HOLDING),
    ),
    Mode.HOLDING: (
        ('active', False, Mode.INACTIVE),
        ('commandable', False, Mode.MIRRORING),
        ('motion_asked', True, Mode.MOVING),
    ),
    Mode.MOVING: (
        ('commandable', False, Mode.MIRRORING),
        ('at_rest', True, Mode.HOLDING),
        ('motion_allowed', False, Mode.STOPPING),
    ),
    Mode.STOPPING: (
        ('commandable', False, Mode.MIRRORING),
        ('at_rest', True, Mode.HOLDING),
        ('motion_asked', True, Mode.MOVING),
    ),
}


def next_mode(mode: Mode, conditions: Conditions) -> Mode:
    """The mode at a state of the robot, after that of the state before."""
    for _ in _TRANSITIONS:  # a mode may be left as it is entered: holding, by an inactive node
        for condition, value, following in _TRANSITIONS[mode]:
            if getattr(conditions, condition) is value:
                mode = following
                break
        else:
            return mode
    return mode
