"""The session between robot controller and client: who may command. No physics, no arrays."""

import math
from collections import Counter
from dataclasses import dataclass

from redres_ros.errors import RedresError
from redres_ros.fake_robot.profile import PROFILES, Event, Reflex
from redres_ros.fake_robot.timing import TimingMonitor
from redres_ros.parameter import Checked, param
from redres_ros.types import Cycles, Radians, Seconds

_ENTRY_TOLERANCE = 0.01  # [rad] from the mirrored position to the first command; a figure of ours


class CommandError(RedresError):
    """A command is refused: the kind that is counted, and what was got and is allowed."""

    def __init__(self, kind: str, why: str) -> None:
        self.kind = kind
        super().__init__(why)


@dataclass(frozen=True)
class SessionSettings(Checked):
    """When command mode begins and when it ends. KUKA's figures are not public: these are ours."""

    profile: str = param(
        'lwr_fri1',
        "kind of session: the LWR's FRI, that of Sunrise, or Franka's control interface",
        choices=tuple(PROFILES),
    )
    monitor_time: float = param(
        0.5, 'duration of good timing required before command mode; 0: none [s]', 0.0, 60.0
    )


class Session:
    """Grants command mode to a client with good timing, and ends it with a lasting reason."""

    def __init__(self, period: Seconds, settings: SessionSettings) -> None:
        self.profile = PROFILES[settings.profile]
        self.timing = TimingMonitor(period)
        self._cycles_needed = max(1, math.ceil(settings.monitor_time / period - 1e-9))
        self._good_cycles = 0
        self.refusals = Counter[str]()  # by kind
        self.command_error: CommandError | None = None  # of the last command, if it was refused
        self.state = next(iter(self.profile.transitions))
        self.reason = ''  # why command mode was taken away or refused

    @property
    def commanding(self) -> bool:
        """Whether the arm follows its client."""
        return self.state is self.profile.commanding

    @property
    def quality(self) -> str:
        return self.profile.qualities[self.timing.quality]

    @property
    def ready(self) -> bool:
        """Whether a command of this cycle could be the first: long good timing, and no reason."""
        return (
            Event.FIRST_COMMAND in self.profile.transitions[self.state]
            and self.timing.age == 0
            and self._is_long_good
        )

    def record(self, lateness: Cycles | None, latency: Seconds = 0.0) -> None:
        """Enter one cycle, as in `TimingMonitor.record`. Bad timing ends command mode."""
        self.timing.record(lateness, latency)
        is_good = self.timing.quality >= self.profile.entry
        self._good_cycles = self._good_cycles + 1 if is_good else 0
        if lateness is not None:
            self.command_error = None
        if self.commanding and (fault := self._timing_fault()):
            self.stop(fault)
            return
        self.timing.counts['bridged'] += self.commanding and self.timing.age > 0
        event = Event.GOOD_TIMING if is_good else Event.POOR_TIMING
        if self._is_long_good:
            event = Event.LONG_GOOD_TIMING
        self._take(event if self.timing.statistics['response_rate'] else Event.SILENCE)

    def refuse(self, error: CommandError) -> None:
        """Count a refused command. Its cycle is still recorded."""
        self.refusals[error.kind] += 1
        self.command_error = error

    def offer(self, distance: Radians) -> None:
        """Begin command mode with a first command, if ready; stop if it is too far away."""
        if not self.ready:
            return
        if distance <= _ENTRY_TOLERANCE:
            self._take(Event.FIRST_COMMAND)
        else:
            self.stop(
                f'{self.profile.reflexes[Reflex.START_POSE]}: the first command is '
                f'{distance:.3g} rad from the mirrored position, allowed {_ENTRY_TOLERANCE:g}'
            )

    def stop(self, reason: str) -> None:
        """End command mode. The first reason is kept: what follows from it is not the cause."""
        self.reason = self.reason or reason
        self._take(Event.FAULT)

    def reset(self) -> None:
        """Clear the reason and start monitoring again; command mode takes another monitor_time."""
        self.reason = ''
        self._good_cycles = 0
        self._take(Event.RESET)

    @property
    def _is_long_good(self) -> bool:
        return self._good_cycles >= self._cycles_needed and not self.reason

    def _timing_fault(self) -> str:
        """Why the timing ends command mode; empty if it does not."""
        timing = self.timing
        bridged = self.profile.bridged_misses
        if timing.age > bridged:
            problem = f'the newest command is {timing.age} cycles late, {bridged} are bridged'
        elif timing.quality < self.profile.lowest:
            problem = f'the connection is {self.quality}: {timing.complaint}'
        else:
            return ''
        refused = f'; last refused: {self.command_error}' if self.command_error else ''
        return f'{self.profile.reflexes[Reflex.TIMING]}: {problem}{refused}'

    def _take(self, event: Event) -> None:
        self.state = self.profile.transitions[self.state].get(event, self.state)
