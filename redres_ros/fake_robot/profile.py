"""Kinds of sessions: states and transitions, qualities of a connection, how limits are applied."""

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import Enum

from redres_ros.types import Radians, Seconds


class Event(Enum):
    """What moves a session from state to state."""

    SILENCE = 'none of the last packets got a command'
    POOR_TIMING = 'the timing is not good enough for command mode'
    GOOD_TIMING = 'the timing is good enough for command mode'
    LONG_GOOD_TIMING = 'it has been good for long enough, and nothing prevents command mode'
    FIRST_COMMAND = 'the first command continues the mirrored position'
    FAULT = 'the command, its timing or its limits are at fault'
    RESET = 'a reset was requested'


class Reflex(Enum):
    """Causes of a stop. Each profile has its own names for them; a stop reason begins with one."""

    TIMING = 'commands are missing or come too late'
    START_POSE = 'the first command is not where the arm is'
    POSITION = 'a commanded position is outside its limits'
    BRAKING = 'at the commanded velocity the joint can no longer stop before its limit'
    VELOCITY = 'a commanded velocity is above its limit'
    ACCELERATION = 'the commanded velocity changes too fast'
    JERK = 'the commanded acceleration changes too fast'


# Words of ours, as KUKA's are not public.
_KUKA_NAMES = {
    Reflex.TIMING: 'timing',
    Reflex.START_POSE: 'interpolation error',
    Reflex.POSITION: 'position limit',
    Reflex.BRAKING: 'position limit',
    Reflex.VELOCITY: 'velocity limit',
    Reflex.ACCELERATION: 'protective stop',
    Reflex.JERK: 'protective stop',
}


@dataclass(frozen=True, eq=False)
class Profile:
    """A kind of session. The defaults are those of KUKA's robots."""

    # from each state, the first of which is the initial one, to others; other events change nothing
    transitions: Mapping[str, Mapping[Event, str]]
    commanding: str  # in which the arm follows its client
    qualities: tuple[str, str, str, str]  # names, the worst first
    entry: int  # the least quality with which command mode begins
    lowest: int  # the least quality with which it goes on
    reflexes: Mapping[Reflex, str] = field(default_factory=lambda: _KUKA_NAMES)  # of stops
    bridged_misses: int = 5  # cycles in a row without a command that are extrapolated
    extrapolates_acceleration: bool = False  # and not only the velocity

    # How limits are applied. The acceleration is averaged over the window.
    acceleration_window: Seconds = 0.02
    acceleration_tolerance: Seconds = 2e-4  # allowed excess: so long at twice the limit
    position_margin: Radians = math.pi / 360.0  # kept from the position limits: half a degree
    velocity_stops: bool = False  # a velocity above its limit is a fault, and not just limited
    jerk_limit: float = math.inf  # [rad/s^3]


_ANY_TIMING = (Event.POOR_TIMING, Event.GOOD_TIMING, Event.LONG_GOOD_TIMING)
_GOOD_TIMING = (Event.GOOD_TIMING, Event.LONG_GOOD_TIMING)
_CLOSED = {
    Event.SILENCE: 'IDLE',
    **dict.fromkeys((Event.POOR_TIMING, Event.FAULT, Event.RESET), 'MONITORING_WAIT'),
}

PROFILES = {
    'lwr_fri1': Profile(
        transitions={
            'MON': {Event.FIRST_COMMAND: 'CMD'},
            'CMD': dict.fromkeys((Event.SILENCE, Event.FAULT, Event.RESET), 'MON'),
        },
        commanding='CMD',
        qualities=('UNACCEPTABLE', 'BAD', 'OK', 'PERFECT'),
        entry=3,
        lowest=1,
    ),
    'sunrise': Profile(
        transitions={
            # Any command opens the session.
            'IDLE': dict.fromkeys(_ANY_TIMING, 'MONITORING_WAIT'),
            'MONITORING_WAIT': _CLOSED | dict.fromkeys(_GOOD_TIMING, 'MONITORING_READY'),
            # The robot's program asks for commands.
            'MONITORING_READY': _CLOSED | {Event.LONG_GOOD_TIMING: 'COMMANDING_WAIT'},
            'COMMANDING_WAIT': _CLOSED | {Event.FIRST_COMMAND: 'COMMANDING_ACTIVE'},
            'COMMANDING_ACTIVE': _CLOSED,
        },
        commanding='COMMANDING_ACTIVE',
        qualities=('POOR', 'FAIR', 'GOOD', 'EXCELLENT'),
        entry=2,
        lowest=2,
    ),
    # The Franka Control Interface as a client of joint positions sees it. States and reflexes have
    # libfranka's names; those of qualities are ours. By Franka's documentation the robot bridges
    # lost packets with constant acceleration, the twentieth in a row ends the motion, and the jerk
    # limit of FR3's joints holds for differences over 1 ms.
    'fci': Profile(
        transitions={
            'IDLE': {Event.FIRST_COMMAND: 'MOVE', Event.FAULT: 'REFLEX'},
            'MOVE': {Event.SILENCE: 'REFLEX', Event.FAULT: 'REFLEX', Event.RESET: 'IDLE'},
            'REFLEX': {Event.RESET: 'AUTOMATIC_ERROR_RECOVERY'},
            'AUTOMATIC_ERROR_RECOVERY': {
                Event.FAULT: 'REFLEX',
                **dict.fromkeys((Event.SILENCE, *_ANY_TIMING), 'IDLE'),
            },
        },
        commanding='MOVE',
        qualities=('INSUFFICIENT', 'POOR', 'GOOD', 'EXCELLENT'),
        entry=2,
        lowest=0,
        reflexes={
            Reflex.TIMING: 'communication_constraints_violation',
            Reflex.START_POSE: 'joint_position_motion_generator_start_pose_invalid',
            Reflex.POSITION: 'joint_motion_generator_position_limits_violation',
            Reflex.BRAKING: 'joint_motion_generator_velocity_limits_violation',
            Reflex.VELOCITY: 'joint_motion_generator_velocity_limits_violation',
            Reflex.ACCELERATION: 'joint_motion_generator_velocity_discontinuity',
            Reflex.JERK: 'joint_motion_generator_acceleration_discontinuity',
        },
        bridged_misses=19,
        extrapolates_acceleration=True,
        acceleration_window=1e-4,  # a single cycle
        acceleration_tolerance=0.0,
        position_margin=0.0,
        velocity_stops=True,
        jerk_limit=5000.0,
    ),
}
