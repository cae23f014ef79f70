"""Who may command: the session between robot controller and client, profile lwr_fri1. No physics, no arrays, no ROS."""

import math
from dataclasses import dataclass
from enum import Enum

from redres_ros.fri.connection import Connection, Counts, Quality, Statistics
from redres_ros.parameter import check_parameters, param


class State(Enum):
    """States of the LWR's session: the arm holds its position in monitor mode, follows its client in command mode."""

    MON = 'MON'
    CMD = 'CMD'


class Event(Enum):
    """What moves a session from state to state."""

    COMMAND = 'timing was good for long enough and the first command continues the mirrored position'
    FAULT = 'the command, its timing or its limits are at fault'
    RESET = 'somebody asks to begin anew'


TRANSITIONS = {  # a pair that is not here cannot happen
    (State.MON, Event.COMMAND): State.CMD,
    (State.MON, Event.FAULT): State.MON,
    (State.MON, Event.RESET): State.MON,
    (State.CMD, Event.FAULT): State.MON,
    (State.CMD, Event.RESET): State.MON,
}


@dataclass(frozen=True)
class SessionSettings:
    """When command mode is given and when it is taken away. KUKA's figures are not public: the defaults are ours."""

    monitor_time: float = param(0.5, 'PERFECT timing needed before command mode; 0: one answer will do [s]', 0.0, 60.0)
    bridged_misses: int = param(5, 'cycles in a row without an answer that are bridged by extrapolation', 0, 100)
    entry_tolerance: float = param(0.01, 'how far the first command may be from the mirrored position [rad]', 0.0, 1.0)

    def __post_init__(self) -> None:
        check_parameters(self)


class Session:
    """Grants command mode to a client that answers well, and takes it away with a reason that stays until `reset`.

    period [s]: the cycle. The caller records every cycle, offers each command that arrives in time, and reports
    violations.
    """

    def __init__(self, period: float, settings: SessionSettings | None = None) -> None:
        self.period = period
        self._settings = settings or SessionSettings()
        self._connection = Connection(period)
        self._cycles_needed = max(1, math.ceil(self._settings.monitor_time / period - 1e-9))
        self._perfect_cycles, self._bridged, self._refused = 0, 0, 0
        self._state, self._reason, self._refusal = State.MON, '', ''

    @property
    def state(self) -> State:
        """Monitor or command mode."""
        return self._state

    @property
    def reason(self) -> str:
        """Why command mode was taken away or refused; empty while nothing is wrong."""
        return self._reason

    @property
    def quality(self) -> Quality:
        """Quality of the connection."""
        return self._connection.quality

    @property
    def statistics(self) -> Statistics:
        """The five figures that FRI reports."""
        return self._connection.statistics

    @property
    def counts(self) -> Counts:
        """What became of every cycle so far."""
        return self._connection.counts(self._bridged, self._refused)

    @property
    def ready(self) -> bool:
        """Whether a command of this cycle could be the first: PERFECT for long enough, in time, nothing against it."""
        return (self._state is State.MON and not self._reason and self._connection.age == 0
                and self._perfect_cycles >= self._cycles_needed)

    def record(self, lateness: int | None, latency: float = 0.0, refusal: str = '') -> None:
        """Enter one cycle by its answer's lateness in cycles: 0 in time, None no answer, or one refused for `refusal`.

        latency [s]: from the state to its answer, 0 where nobody measures it. In command mode bad timing ends the
        session.
        """
        self._connection.record(lateness, latency)
        self._perfect_cycles = self._perfect_cycles + 1 if self.quality is Quality.PERFECT else 0
        self._refused += bool(refusal)
        self._refusal = refusal if refusal or lateness is not None else self._refusal
        if self._state is State.CMD:
            self._check_timing()

    def offer(self, gap: float) -> None:
        """Begin command mode if the session is ready and the command is within the tolerance of the mirrored position.

        gap: largest distance between the two over all joints [rad]. Too large a gap is an interpolation error.
        """
        if not self.ready:
            return
        if gap <= self._settings.entry_tolerance:
            self._take(Event.COMMAND)
        else:
            self.stop(f'interpolation error: the first command is {gap:.3g} rad from the mirrored position, '
                      f'allowed {self._settings.entry_tolerance:g}')

    def stop(self, reason: str) -> None:
        """Fall back to monitor mode. The first reason is kept: what follows from it is not the cause."""
        self._reason = self._reason or reason
        self._take(Event.FAULT)

    def reset(self) -> None:
        """Clear the reason and monitor anew; command mode takes another monitor_time."""
        self._reason = ''
        self._take(Event.RESET)

    def _check_timing(self) -> None:
        age, bridged = self._connection.age, self._settings.bridged_misses
        if age > bridged:
            refused = f'; last refused: {self._refusal}' if self._refusal else ''
            self.stop(f'timing: the newest answer is {age} cycles late, {bridged} are bridged{refused}')
        elif self.quality is Quality.UNACCEPTABLE:
            self.stop(f'timing: the connection is UNACCEPTABLE, {self.statistics.miss_rate:.0%} of its answers missed')
        else:
            self._bridged += age > 0

    def _take(self, event: Event) -> None:
        self._state = TRANSITIONS[self._state, event]
        self._perfect_cycles = 0
