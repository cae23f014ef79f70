"""Session profiles as tables: states, transitions, and thresholds of the timing."""

from collections.abc import Mapping
from dataclasses import dataclass
from enum import Enum, IntEnum

from redres_ros.fake_robot.command_validator import KUKA_NAMES, Reflex, ValidatorSettings
from redres_ros.fake_robot.quality import (
    FciQuality,
    Quality,
    SunriseQuality,
    Threshold,
    thresholds_of,
)


class State(Enum):
    """Session states of all profiles. The arm follows its client in CMD,
    COMMANDING_ACTIVE and MOVE only.
    """

    MON = 'MON'
    CMD = 'CMD'
    IDLE = 'IDLE'
    MONITORING_WAIT = 'MONITORING_WAIT'
    MONITORING_READY = 'MONITORING_READY'
    COMMANDING_WAIT = 'COMMANDING_WAIT'
    COMMANDING_ACTIVE = 'COMMANDING_ACTIVE'
    MOVE = 'MOVE'
    REFLEX = 'REFLEX'
    AUTOMATIC_ERROR_RECOVERY = 'AUTOMATIC_ERROR_RECOVERY'


class Event(Enum):
    """What moves a session from state to state."""

    SILENCE = 'none of the last packets got a command'
    POOR_TIMING = 'the timing is not good enough for command mode'
    GOOD_TIMING = 'the timing is good enough for command mode'
    LONG_GOOD_TIMING = 'it has been good for long enough, and nothing prevents command mode'
    FIRST_COMMAND = 'the first command continues the mirrored position'
    FAULT = 'the command, its timing or its limits are at fault'
    RESET = 'a reset was requested'


@dataclass(frozen=True, eq=False)
class Profile:
    """A kind of session.

    Attributes:
        name: The parameter that chooses it.
        transitions: From each state of its sessions by an event to another state; other events
            change nothing.
        commanding: The state in which the arm follows its client.
        thresholds: Thresholds of every quality but the worst, best first.
        entry: Quality needed for command mode to begin.
        lowest: Quality below which command mode ends.
        reflexes: What each cause of a stop is called.
        bridged_misses: Cycles in a row without a command that are bridged by default.
        extrapolates_acceleration: Whether a bridged command keeps its last acceleration, and
            not at its last velocity.
        guard: How limits are applied by default.
    """

    name: str
    transitions: Mapping[State, Mapping[Event, State]]
    commanding: State
    thresholds: Mapping[IntEnum, Threshold]
    entry: IntEnum
    lowest: IntEnum
    reflexes: Mapping[Reflex, str]
    bridged_misses: int
    extrapolates_acceleration: bool
    guard: ValidatorSettings

    @property
    def states(self) -> tuple[State, ...]:
        """The states of its sessions, which begin in the first one."""
        return tuple(self.transitions)

    def after(self, state: State, event: Event) -> State:
        """The state to which an event leads.

        Args:
            state: The one before.
            event: What happens in it.
        """
        return self.transitions[state].get(event, state)

    def awaits_command(self, state: State) -> bool:
        """Whether a first command leads on from this state."""
        return Event.FIRST_COMMAND in self.transitions[state]


LWR_FRI1 = Profile(
    name='lwr_fri1',
    transitions={
        State.MON: {Event.FIRST_COMMAND: State.CMD},
        State.CMD: dict.fromkeys((Event.SILENCE, Event.FAULT, Event.RESET), State.MON),
    },
    commanding=State.CMD,
    thresholds=thresholds_of(Quality),
    entry=Quality.PERFECT,
    lowest=Quality.BAD,
    reflexes=KUKA_NAMES,
    bridged_misses=5,
    extrapolates_acceleration=False,
    guard=ValidatorSettings(),
)

_ANY_TIMING = (Event.POOR_TIMING, Event.GOOD_TIMING, Event.LONG_GOOD_TIMING)
_GOOD_TIMING = (Event.GOOD_TIMING, Event.LONG_GOOD_TIMING)
_CLOSED = {
    Event.SILENCE: State.IDLE,
    **dict.fromkeys((Event.POOR_TIMING, Event.FAULT, Event.RESET), State.MONITORING_WAIT),
}

SUNRISE = Profile(
    name='sunrise',
    transitions={
        # Any command opens the session.
        State.IDLE: dict.fromkeys(_ANY_TIMING, State.MONITORING_WAIT),
        State.MONITORING_WAIT: _CLOSED | dict.fromkeys(_GOOD_TIMING, State.MONITORING_READY),
        # The robot's program wants commands.
        State.MONITORING_READY: _CLOSED | {Event.LONG_GOOD_TIMING: State.COMMANDING_WAIT},
        State.COMMANDING_WAIT: _CLOSED | {Event.FIRST_COMMAND: State.COMMANDING_ACTIVE},
        State.COMMANDING_ACTIVE: _CLOSED,
    },
    commanding=State.COMMANDING_ACTIVE,
    thresholds=thresholds_of(SunriseQuality),
    entry=SunriseQuality.GOOD,
    lowest=SunriseQuality.GOOD,
    reflexes=KUKA_NAMES,
    bridged_misses=5,
    extrapolates_acceleration=False,
    guard=ValidatorSettings(),
)

# The Franka Control Interface as a client of joint positions sees it. States and reflexes have
# libfranka's names. Franka's documentation of the interface has the figures: with constant
# acceleration the robot bridges packets that are lost, the twentieth in a row ends the motion, and
# the joints of FR3 have a jerk limit of 5000 rad/s^3, differences being taken over 1 ms.
FCI = Profile(
    name='fci',
    transitions={
        State.IDLE: {Event.FIRST_COMMAND: State.MOVE, Event.FAULT: State.REFLEX},
        State.MOVE: {
            Event.SILENCE: State.REFLEX,
            Event.FAULT: State.REFLEX,
            Event.RESET: State.IDLE,
        },
        State.REFLEX: {Event.RESET: State.AUTOMATIC_ERROR_RECOVERY},
        State.AUTOMATIC_ERROR_RECOVERY: {
            Event.FAULT: State.REFLEX,
            **dict.fromkeys((Event.SILENCE, *_ANY_TIMING), State.IDLE),
        },
    },
    commanding=State.MOVE,
    thresholds=thresholds_of(FciQuality),
    entry=FciQuality.GOOD,
    lowest=FciQuality.INSUFFICIENT,
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
    guard=ValidatorSettings(
        acceleration_window=1e-4,  # a single cycle
        position_margin=0.0,
        acceleration_tolerance=0.0,
        velocity_stops=True,
        jerk_limit=5000.0,
    ),
)

PROFILES = {profile.name: profile for profile in (LWR_FRI1, SUNRISE, FCI)}
