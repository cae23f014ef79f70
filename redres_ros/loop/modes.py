"""The modes of the controller, and the one table of transitions between them.

| mode | publishes |
|---|---|
| inactive | nothing |
| mirroring | the measured position: the robot takes no commands |
| holding | the same reference, exactly |
| moving | the policy's reference, through the gate |
| stopping | braking within A |
"""

from enum import Enum
from typing import NamedTuple


class Mode(Enum):
    """The mode of the controller."""

    INACTIVE = 'inactive'
    MIRRORING = 'mirroring'
    HOLDING = 'holding'
    MOVING = 'moving'
    STOPPING = 'stopping'


class Conditions(NamedTuple):
    """The conditions of transitions, at one state of the robot.

    Attributes:
        active: The node is active.
        commandable: The robot takes commands.
        motion_allowed: Nothing is against motion: no hold, no silence, no fault.
        motion_asked: Motion is allowed, and a task velocity asks for it.
        at_rest: The reference has come to rest, and no motion is asked for.
    """

    active: bool
    commandable: bool
    motion_allowed: bool
    motion_asked: bool
    at_rest: bool


class Transition(NamedTuple):
    """A transition under a condition."""

    condition: str
    value: bool
    mode: Mode


# In each mode the first transition that applies counts.
TRANSITIONS: dict[Mode, tuple[Transition, ...]] = {
    Mode.INACTIVE: (Transition('active', True, Mode.HOLDING),),
    Mode.MIRRORING: (
        Transition('active', False, Mode.INACTIVE),
        Transition('commandable', True, Mode.HOLDING),
    ),
    Mode.HOLDING: (
        Transition('active', False, Mode.INACTIVE),
        Transition('commandable', False, Mode.MIRRORING),
        Transition('motion_asked', True, Mode.MOVING),
    ),
    Mode.MOVING: (
        Transition('commandable', False, Mode.MIRRORING),
        Transition('at_rest', True, Mode.HOLDING),
        Transition('motion_allowed', False, Mode.STOPPING),
    ),
    Mode.STOPPING: (
        Transition('commandable', False, Mode.MIRRORING),
        Transition('at_rest', True, Mode.HOLDING),
        Transition('motion_asked', True, Mode.MOVING),
    ),
}


def next_mode(mode: Mode, conditions: Conditions) -> Mode:
    """The mode at a state of the robot.

    Args:
        mode: The one before.
        conditions: Conditions at this state.
    """
    for _ in TRANSITIONS:  # a mode may be left as it is entered: holding, by an inactive node
        for condition, value, following in TRANSITIONS[mode]:
            if getattr(conditions, condition) is value:
                mode = following
                break
        else:
            return mode
    return mode
