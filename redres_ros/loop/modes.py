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
from functools import cache
from typing import NamedTuple

# Session states in which a robot takes commands: of an LWR, an iiwa and a Franka arm.
COMMANDING = ('CMD', 'COMMANDING_ACTIVE', 'MOVE')


class Mode(Enum):
    INACTIVE = 'inactive'
    MIRRORING = 'mirroring'
    HOLDING = 'holding'
    MOVING = 'moving'
    STOPPING = 'stopping'


MOVING_MODES = (Mode.MOVING, Mode.STOPPING)  # in which references change


class Conditions(NamedTuple):
    """The conditions of transitions, at one state of the robot."""

    active: bool  # the controller is, or not at rest yet
    commandable: bool  # the robot takes commands
    motion_allowed: bool  # nothing blocks it
    motion_asked: bool  # it is allowed, and something asks for it
    at_rest: bool  # the reference is, and nothing asks for motion


# In each mode the first transition counts whose condition has that value.
_TRANSITIONS: dict[Mode, tuple[tuple[str, bool, Mode], ...]] = {
    Mode.INACTIVE: (('active', True, Mode.HOLDING),),
    Mode.MIRRORING: (('active', False, Mode.INACTIVE), ('commandable', True, Mode.HOLDING)),
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


@cache
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
