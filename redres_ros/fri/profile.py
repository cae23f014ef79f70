"""Kinds of FRI session as tables: their states, what leads from one to another, and what each asks
of the timing.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from enum import Enum, IntEnum
from types import MappingProxyType

from redres_ros.fri.quality import (
    SUNRISE_THRESHOLDS,
    THRESHOLDS,
    Quality,
    SunriseQuality,
    Threshold,
)


class State(Enum):
    """States of a session, those of every profile. The arm follows its client in CMD and
    COMMANDING_ACTIVE only.
    """

    MON = 'MON'
    CMD = 'CMD'
    IDLE = 'IDLE'
    MONITORING_WAIT = 'MONITORING_WAIT'
    MONITORING_READY = 'MONITORING_READY'
    COMMANDING_WAIT = 'COMMANDING_WAIT'
    COMMANDING_ACTIVE = 'COMMANDING_ACTIVE'


class Event(Enum):
    """What moves a session from state to state."""

    SILENCE = 'none of the last packets was answered'
    POOR_TIMING = 'the timing is not good enough for command mode'
    GOOD_TIMING = 'the timing is good enough for command mode'
    LONG_GOOD_TIMING = 'it has been good for long enough, and nothing is against command mode'
    FIRST_COMMAND = 'the first command continues the mirrored position'
    FAULT = 'the command, its timing or its limits are at fault'
    RESET = 'somebody asks to begin anew'


@dataclass(frozen=True, eq=False)
class Profile:
    """A kind of FRI session.

    states: the first one is that of the start; commanding: the one in which the arm follows its
    client; transitions: a pair that is not among them changes nothing; thresholds: what every
    quality but the worst asks for, best first; entry: quality needed for command mode to begin;
    lowest: the one below which it ends.
    """

    name: str
    states: tuple[State, ...]
    commanding: State
    transitions: Mapping[tuple[State, Event], State]
    thresholds: Mapping[IntEnum, Threshold]
    entry: IntEnum
    lowest: IntEnum

    def after(self, state: State, event: Event) -> State:
        """The state to which an event leads."""
        return self.transitions.get((state, event), state)

    def awaits_command(self, state: State) -> bool:
        """Whether a first command leads on from this state."""
        return (state, Event.FIRST_COMMAND) in self.transitions


LWR_FRI1 = Profile(
    name='lwr_fri1',
    states=(State.MON, State.CMD),
    commanding=State.CMD,
    transitions=MappingProxyType(
        {
            (State.MON, Event.FIRST_COMMAND): State.CMD,
            (State.CMD, Event.SILENCE): State.MON,
            (State.CMD, Event.FAULT): State.MON,
            (State.CMD, Event.RESET): State.MON,
        }
    ),
    thresholds=THRESHOLDS,
    entry=Quality.PERFECT,
    lowest=Quality.BAD,
)

_OPEN = (
    State.MONITORING_WAIT,
    State.MONITORING_READY,
    State.COMMANDING_WAIT,
    State.COMMANDING_ACTIVE,
)

SUNRISE = Profile(
    name='sunrise',
    states=(State.IDLE, *_OPEN),
    commanding=State.COMMANDING_ACTIVE,
    transitions=MappingProxyType(
        {
            (State.IDLE, Event.POOR_TIMING): State.MONITORING_WAIT,  # any answer opens the session
            (State.IDLE, Event.GOOD_TIMING): State.MONITORING_WAIT,
            (State.IDLE, Event.LONG_GOOD_TIMING): State.MONITORING_WAIT,
            (State.MONITORING_WAIT, Event.GOOD_TIMING): State.MONITORING_READY,
            (State.MONITORING_WAIT, Event.LONG_GOOD_TIMING): State.MONITORING_READY,
            (
                State.MONITORING_READY,
                Event.LONG_GOOD_TIMING,
            ): State.COMMANDING_WAIT,  # the robot's program wants commands
            (State.COMMANDING_WAIT, Event.FIRST_COMMAND): State.COMMANDING_ACTIVE,
            **{(state, Event.SILENCE): State.IDLE for state in _OPEN},
            **{
                (state, event): State.MONITORING_WAIT
                for state in _OPEN
                for event in (Event.POOR_TIMING, Event.FAULT, Event.RESET)
            },
        }
    ),
    thresholds=SUNRISE_THRESHOLDS,
    entry=SunriseQuality.GOOD,
    lowest=SunriseQuality.GOOD,
)

PROFILES = {profile.name: profile for profile in (LWR_FRI1, SUNRISE)}
