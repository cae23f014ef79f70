"""The session between robot controller and client: who may command. No physics, no arrays."""

import math
from collections import Counter
from dataclasses import dataclass
from enum import Enum

from redres_ros.errors import RedresError
from redres_ros.fake_robot.command_validator import Reflex
from redres_ros.fake_robot.profile import LWR_FRI1, PROFILES, Event
from redres_ros.fake_robot.timing import Counts, TimingMonitor
from redres_ros.parameter import check_parameters, param


class Refusal(Enum):
    """Why a command is refused; each kind is counted."""

    WRONG_NAMES = 'wrong joint names'
    WRONG_LENGTH = 'wrong length'
    NOT_FINITE = 'not finite'
    NO_STATE = 'for no state'
    OUT_OF_DATE = 'out of date'
    OUT_OF_ORDER = 'out of order'
    SECOND_PUBLISHER = 'second publisher'


class CommandError(RedresError):
    """A command is refused: its kind, and what was got.

    Args:
        kind: The kind that is counted.
        why: What was got and what is allowed.
    """

    def __init__(self, kind: Refusal, why: str) -> None:
        self.kind = kind
        super().__init__(why)


@dataclass(frozen=True)
class SessionSettings:
    """When command mode begins and when it ends. KUKA's figures are not public: the
    defaults are ours.
    """

    profile: str = param(
        LWR_FRI1.name,
        "kind of session: the LWR's FRI, that of Sunrise, or Franka's control interface",
        choices=tuple(PROFILES),
    )
    monitor_time: float = param(
        0.5, 'duration of good timing required before command mode; 0: none [s]', 0.0, 60.0
    )
    bridged_misses: int = param(
        -1,
        'cycles in a row without a command that are bridged by extrapolation; '
        '-1: as many as the profile does',
        -1,
        100,
    )
    entry_tolerance: float = param(
        0.01, 'how far the first command may be from the mirrored position [rad]', 0.0, 1.0
    )

    def __post_init__(self) -> None:
        check_parameters(self)


class Session:
    """Grants command mode to a client with good timing, and ends it with a reason that
    stays until `reset`.

    The caller records every cycle, offers each command that arrives in time, and reports refusals
    and violations.

    Attributes:
        profile: Kind of session.
        timing: Timing of the connection: its quality, and what is at fault.
        state: One of the profile's states.
        reason: Why command mode was taken away or refused; empty while nothing is wrong.
        command_error: That of the last refused command; None if a valid one came since.

    Args:
        period: The cycle [s].
        settings: When command mode begins and ends.
    """

    def __init__(self, period: float, settings: SessionSettings | None = None) -> None:
        self.period = period
        self._settings = settings or SessionSettings()
        self.profile = PROFILES[self._settings.profile]
        self.timing = TimingMonitor(period, self.profile.thresholds)
        self._bridged_misses = self._settings.bridged_misses
        if self._bridged_misses < 0:
            self._bridged_misses = self.profile.bridged_misses
        self._cycles_needed = max(1, math.ceil(self._settings.monitor_time / period - 1e-9))
        self._good_cycles = 0
        self._bridged = 0
        self._refusals = Counter[Refusal]()
        self.command_error: CommandError | None = None
        self.state = self.profile.states[0]
        self.reason = ''

    @property
    def commanding(self) -> bool:
        """Whether the arm follows its client."""
        return self.state is self.profile.commanding

    @property
    def counts(self) -> Counts:
        """Counts of cycles by their outcome, so far."""
        return self.timing.counts(self._bridged, self._refusals.total())

    @property
    def refusals(self) -> dict[Refusal, int]:
        """Number of refused commands by kind."""
        return {kind: self._refusals[kind] for kind in Refusal}

    @property
    def ready(self) -> bool:
        """Whether a command of this cycle could be the first: long good timing, and no reason."""
        return (
            self.profile.awaits_command(self.state)
            and not self.reason
            and self.timing.age == 0
            and self._good_cycles >= self._cycles_needed
        )

    def record(self, lateness: int | None, latency: float = 0.0) -> None:
        """Enter one cycle. In command mode bad timing ends the session.

        Args:
            lateness: Lateness of its command [cycles]; 0: in time, None: no valid one.
            latency: Time from the state to its command [s]; 0 if it is not measured.
        """
        self.timing.record(lateness, latency)
        is_good = self.timing.quality >= self.profile.entry
        self._good_cycles = self._good_cycles + 1 if is_good else 0
        if lateness is not None:
            self.command_error = None
        if self.commanding and (fault := self._timing_fault()):
            self.stop(fault)
            return
        self._bridged += self.commanding and self.timing.age > 0
        self._take(self._timing_event())

    def refuse(self, error: CommandError) -> None:
        """Count a refused command. Its cycle is still recorded."""
        self._refusals[error.kind] += 1
        self.command_error = error

    def offer(self, gap: float) -> None:
        """Begin command mode with a first command, if the session is ready for one.

        Args:
            gap: Largest distance from the mirrored position over all joints [rad]; too large a one
                is a reason to stop.
        """
        if not self.ready:
            return
        if gap <= self._settings.entry_tolerance:
            self._take(Event.FIRST_COMMAND)
        else:
            self.stop(
                f'{self.profile.reflexes[Reflex.START_POSE]}: the first command is {gap:.3g} rad '
                f'from the mirrored position, allowed {self._settings.entry_tolerance:g}'
            )

    def stop(self, reason: str) -> None:
        """End command mode. The first reason is kept: what follows from it is not the cause."""
        self.reason = self.reason or reason
        self._good_cycles = 0
        self._take(Event.FAULT)

    def reset(self) -> None:
        """Clear the reason and start monitoring again; command mode takes another monitor_time."""
        self.reason = ''
        self._good_cycles = 0
        self._take(Event.RESET)

    def _timing_fault(self) -> str:
        """Why the timing ends command mode; empty if it does not."""
        age = self.timing.age
        bridged = self._bridged_misses
        timing = self.profile.reflexes[Reflex.TIMING]
        refused = f'; last refused: {self.command_error}' if self.command_error else ''
        if age > bridged:
            return (
                f'{timing}: the newest command is {age} cycles late, {bridged} are bridged{refused}'
            )
        if self.timing.quality < self.profile.lowest:
            complaint = self.timing.complaint
            return f'{timing}: the connection is {self.timing.quality.name}: {complaint}{refused}'
        return ''

    def _timing_event(self) -> Event:
        """The event that the timing up to this cycle is to the session."""
        if self.timing.silent:
            return Event.SILENCE
        if self.timing.quality < self.profile.entry:
            return Event.POOR_TIMING
        enough = self._good_cycles >= self._cycles_needed and not self.reason
        return Event.LONG_GOOD_TIMING if enough else Event.GOOD_TIMING

    def _take(self, event: Event) -> None:
        self.state = self.profile.after(self.state, event)
