"""A buffer of task velocities: one for each cycle, with a fixed lag.

Which task velocity a cycle uses must not depend on which process ran first: one tick more or less
would look like an acceleration, and a law that minimises accelerations would obey it.
"""

import math
from bisect import insort
from dataclasses import dataclass
from itertools import pairwise
from operator import attrgetter
from typing import NamedTuple

import numpy as np

from redres_ros.parameter import check_parameters, param

_DENSE = 2  # cycles now and then between two task velocities of a source that sends one a cycle
_RECENT = 4  # intervals by which that is judged
_EXTRAPOLATED = 10  # cycles at most over which the last two are continued in a straight line
_WAY_BACK = 4  # cycles for each one that was missing
_KEPT = 16  # task velocities kept beside those of the lag


@dataclass(frozen=True)
class TwistBufferSettings:
    """The parameters of a TwistBuffer."""

    twist_lag: int = param(
        1, 'cycles after its state at which a task velocity acts; in lock-step 0', 0, 100
    )
    max_linear_acceleration: float = param(
        2.0, 'acceleration with which a sudden task velocity is approached [m/s^2]', 1e-3, 1e3
    )
    max_angular_acceleration: float = param(
        6.0, 'the same for its angular part [rad/s^2]', 1e-3, 1e3
    )

    def __post_init__(self) -> None:
        check_parameters(self)


class _Twist(NamedTuple):
    """A task velocity (m,) and the cycle that it belongs to."""

    cycle: int
    dx: np.ndarray


class _Line(NamedTuple):
    """A linear prediction from a known task velocity.

    Attributes:
        start: The known one.
        slope: Change a cycle, (m,).
        until: Cycle after which the line is level.
        guessed: Nothing newer was known.
        dense: Its source sends one a cycle.
    """

    start: _Twist
    slope: np.ndarray
    until: int
    guessed: bool
    dense: bool

    def at(self, cycle: int) -> np.ndarray:
        """The task velocity of a cycle, (m,)."""
        cycles = min(cycle, self.until) - self.start.cycle
        return self.start.dx + cycles * self.slope if cycles > 0 else self.start.dx


class TwistBuffer:
    """Returns the task velocity of the state `twist_lag` cycles ago.

    One that is missing is extrapolated from the last two, and held after a few cycles; it counts as
    missing if its source sends one a cycle. What then comes is approached in a straight line, over
    four times as many cycles as were missing. The next one of a source that sends less often, a
    camera or a joystick, is approached over the time that it took to come. A sudden change is
    spread over as many cycles as the largest accelerations ask for.

    Args:
        rows: Rows of a task velocity: 3, or 6 with the angular part below.
        T: Sampling time [s].
        settings: Lag and accelerations.
        accelerations: Of each row by itself, (m,), instead of a linear and an angular one.
    """

    def __init__(
        self,
        rows: int,
        T: float,
        settings: TwistBufferSettings,
        accelerations: np.ndarray | None = None,
    ) -> None:
        self.missing = 0  # cycles in which one was missing
        self.late = 0  # task velocities that came after the cycle in which they were to act
        self._lag = settings.twist_lag
        self._linear_step = settings.max_linear_acceleration * T  # [m/s] a cycle
        self._angular_step = settings.max_angular_acceleration * T  # [rad/s] a cycle
        self._steps = None if accelerations is None else accelerations * T  # (m,) a cycle
        self._rest = np.zeros(rows)
        self._played = 0  # cycle that was played last
        self.clear()

    def clear(self) -> None:
        """Clear the buffer: the next task velocity is approached from rest."""
        self._twists: list[_Twist] = []
        self._line = _Line(_Twist(-1, self._rest), self._rest, -1, guessed=True, dense=False)
        self._target = self._rest  # played last, without the detour
        self._guesses = 0  # cycles in a row that were not known
        self._detour = self._rest  # what is added on the way back from a guess
        self._left = 0  # cycles until the detour is over
        self._ahead: _Twist | None = None  # of the next cycle, if it needs no detour

    def put(self, cycle: int, dx: np.ndarray) -> None:
        """Record a task velocity; of several for one cycle the newest counts.

        Args:
            cycle: The one that it belongs to.
            dx: A task velocity, (m,).
        """
        twists = self._twists
        self.late += cycle + self._lag <= self._played
        if not twists or cycle > twists[-1].cycle:
            twists.append(_Twist(cycle, dx))
        else:
            twists[:] = [twist for twist in twists if twist.cycle != cycle]
            insort(twists, _Twist(cycle, dx), key=attrgetter('cycle'))
        if len(twists) > self._lag + _KEPT:
            del twists[0]

    def has(self, cycle: int) -> bool:
        """Whether the task velocity for a cycle is known."""
        return bool(self._twists) and self._twists[-1].cycle >= cycle - self._lag

    def prepare(self, cycle: int) -> np.ndarray | None:
        """The task velocity of the next cycle, (m,), which play() then takes over; None if it is
        not known yet, or is approached.
        """
        self._ahead = None
        newest = self._twists[-1]
        is_known = newest.cycle == cycle - self._lag and not self._guesses and not self._left
        if not is_known or self._cycles_needed(self._target - newest.dx) > 1:
            return None
        self._ahead = newest
        return newest.dx

    def age(self, cycle: int) -> float:
        """Cycles since the state of the newest task velocity; infinite when there is none."""
        return cycle - self._twists[-1].cycle if self._twists else math.inf

    def play(self, cycle: int) -> np.ndarray:
        """The task velocity of a cycle, (m,)."""
        wanted = cycle - self._lag
        ahead = self._ahead
        if ahead is not None and ahead.cycle == wanted and ahead is self._twists[-1]:
            self._line = self._level(ahead)
            self._target = ahead.dx
            self._played = cycle
            return ahead.dx
        line = self._find(wanted)
        target = line.at(wanted)
        self._begin_detour(line, target, wanted, max(cycle - self._played, 1))
        self._guesses = self._guesses + 1 if line.guessed else 0
        self.missing += line.guessed and line.dense
        self._line = line
        self._target = target
        self._played = cycle
        if not self._left:
            return target
        self._left -= 1
        self._detour = self._detour * (self._left / (self._left + 1))
        return target + self._detour

    def _find(self, wanted: int) -> _Line:
        """The line through what is known before and after a cycle, else through the last two."""
        twists = self._twists
        after = None
        for k in range(len(twists) - 1, -1, -1):
            twist = twists[k]
            if twist.cycle == wanted:
                return self._level(twist)
            if twist.cycle < wanted:
                if after is not None:
                    return self._between(twist, after)
                return self._beyond(twists[max(k - _RECENT, 0) : k + 1])
            after = twist
        return self._line._replace(guessed=True, dense=False)

    def _level(self, known: _Twist) -> _Line:
        return _Line(known, self._rest, known.cycle, guessed=False, dense=True)

    def _between(self, before: _Twist, after: _Twist) -> _Line:
        slope = (after.dx - before.dx) / (after.cycle - before.cycle)
        return _Line(before, slope, after.cycle, guessed=False, dense=True)

    def _beyond(self, recent: list[_Twist]) -> _Line:
        """A straight line for some cycles; level for what comes seldom, or has jumped."""
        last = recent[-1]
        intervals = [after.cycle - before.cycle for before, after in pairwise(recent)]
        dense = bool(intervals) and min(intervals) <= _DENSE
        slope = self._rest
        if dense:
            steady = (last.dx - recent[-2].dx) / intervals[-1]
            if self._cycles_needed(steady) <= 1:
                slope = steady
        return _Line(last, slope, last.cycle + _EXTRAPOLATED, guessed=True, dense=dense)

    def _begin_detour(self, line: _Line, target: np.ndarray, wanted: int, cycles: int) -> None:
        """Go on from where the last line leads, if this one leads somewhere else."""
        old = self._line
        if self._guesses and line.start is not old.start:
            expected = old.at(wanted)
            if self._cycles_needed(expected - self._target) > cycles:
                expected = self._target  # a line between two that were known may be steep
            apart = expected - target
            spread = self._way_back(old, line)
        else:
            apart = self._target - target
            spread = 1
            if self._cycles_needed(apart) <= cycles:
                return
        self._detour = self._detour + apart
        self._left = max(spread, self._left, self._cycles_needed(self._detour))

    def _way_back(self, old: _Line, new: _Line) -> int:
        """Cycles over which a wrong prediction is corrected."""
        from_standstill = old.start.cycle < 0
        if from_standstill:
            return 1
        if old.dense:
            return _WAY_BACK * self._guesses
        return new.start.cycle - old.start.cycle

    def _cycles_needed(self, change: np.ndarray) -> int:
        """Over so many cycles a change (m,) keeps to the largest accelerations."""
        if self._steps is not None:
            return math.ceil(float((np.abs(change) / self._steps).max()) - 1e-9)
        values = change.tolist()
        linear = math.hypot(*values[:3]) / self._linear_step
        angular = math.hypot(*values[3:]) / self._angular_step
        return math.ceil(max(linear, angular) - 1e-9)
