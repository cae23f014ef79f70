"""The modes of the controller, what blocks motion, and the one table of transitions.

| mode | publishes |
|---|---|
| inactive | nothing |
| mirroring | the measured position: the robot takes no commands |
| holding | the same reference, exactly |
| moving | the policy's reference, through the safety filter |
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


MOVING_MODES = (Mode.MOVING, Mode.STOPPING)  # in which references change


class Source(Enum):
    """What a moving arm follows."""

    INPUT = 'task or joint velocities'
    MEASUREMENTS = 'what is measured: it yields'
    APPROACH = 'the way to where it was measured'
    PROBE = 'a small step that shows whether the robot executes commands'


class Interlock(Enum):
    """What blocks motion, the first one first."""

    SESSION = 'the robot takes no commands'
    INACTIVE = 'the controller is inactive'
    HOLD = 'it is asked to hold'
    RATE = 'the robot has another rate'
    FAULT = 'a fault'
    SILENCE = 'no task velocity'


class Conditions(NamedTuple):
    """The conditions of transitions, at one state of the robot.

    Attributes:
        active: The controller is active, or not at rest yet.
        commandable: The robot takes commands.
        motion_allowed: No interlock blocks motion.
        motion_asked: Motion is allowed, and something asks for it.
        at_rest: The reference has come to rest, and nothing asks for motion.
    """

    active: bool
    commandable: bool
    motion_allowed: bool
    motion_asked: bool
    at_rest: bool


class _Transition(NamedTuple):
    """A transition under a condition."""

    condition: str
    value: bool
    mode: Mode


# In each mode the first transition that applies counts.
_TRANSITIONS: dict[Mode, tuple[_Transition, ...]] = {
    Mode.INACTIVE: (_Transition('active', True, Mode.HOLDING),),
    Mode.MIRRORING: (
        _Transition('active', False, Mode.INACTIVE),
        _Transition('commandable', True, Mode.HOLDING),
    ),
    Mode.HOLDING: (
        _Transition('active', False, Mode.INACTIVE),
        _Transition('commandable', False, Mode.MIRRORING),
        _Transition('motion_asked', True, Mode.MOVING),
    ),
    Mode.MOVING: (
        _Transition('commandable', False, Mode.MIRRORING),
        _Transition('at_rest', True, Mode.HOLDING),
        _Transition('motion_allowed', False, Mode.STOPPING),
    ),
    Mode.STOPPING: (
        _Transition('commandable', False, Mode.MIRRORING),
        _Transition('at_rest', True, Mode.HOLDING),
        _Transition('motion_asked', True, Mode.MOVING),
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
