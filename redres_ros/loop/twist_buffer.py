"""A buffer of task velocities: sampled with a fixed lag, then limited in their acceleration.

Which task velocity a cycle uses must not depend on which process ran first: one tick more or less
would look like an acceleration, and a law that minimises accelerations would obey it.
"""

import math
from bisect import insort
from itertools import pairwise
from operator import attrgetter
from typing import NamedTuple

import numpy as np

from redres_ros.types import Cycles, JointAccelerations, Seconds, TaskVelocity

# With which a sudden task velocity is approached.
LINEAR_ACCELERATION = 2.0  # [m/s^2]
ANGULAR_ACCELERATION = 6.0  # [rad/s^2]

_DENSE = 2  # cycles now and then between two task velocities of a source that sends one a cycle
_RECENT = 4  # intervals by which that is judged
_EXTRAPOLATED = 10  # cycles at most over which the last two are continued in a straight line
_RETURN = 4  # cycles for each one that was missing
_KEPT = 16  # task velocities kept beside those of the lag


class _Twist(NamedTuple):
    """A task velocity and the cycle that it belongs to."""

    cycle: int
    dx: TaskVelocity


class _Line(NamedTuple):
    """A linear prediction from a known task velocity."""

    start: _Twist
    slope: TaskVelocity  # change a cycle
    until: int  # cycle after which the line is level
    guessed: bool  # nothing newer was known
    dense: bool  # its source sends one a cycle

    def at(self, cycle: int) -> TaskVelocity:
        """The task velocity of a cycle."""
        cycles = min(cycle, self.until) - self.start.cycle
        return self.start.dx + cycles * self.slope if cycles > 0 else self.start.dx


class _Output(NamedTuple):
    """The task velocity of a cycle."""

    cycle: int
    line: _Line
    target: TaskVelocity  # of the line
    guesses: int  # cycles in a row that were not known
    residual: TaskVelocity  # what is added to the target, and fades out
    left: int  # cycles until it has
    dx: TaskVelocity  # what the arm is to follow


class TwistBuffer:
    """Returns the task velocity of the state `lag` cycles ago.

    One that is missing is extrapolated from the last two, and held after a few cycles; it counts as
    missing if its source sends one a cycle. Whatever the velocity jumps by is added back, and fades
    out: after an extrapolation over four times as many cycles as were missing; the next velocity of
    a source that sends less often, a camera or a joystick, over the time that it took to come; and
    a sudden change over as many cycles as the largest accelerations ask for.

    Args:
        rows: Rows of a task velocity: 3, or 6 with the angular part below.
        accelerations: Of each row by itself, instead of a linear and an angular one.

    Attributes:
        newest: Cycle of the newest task velocity; -inf without one.
        known_until: Cycle up to which play() need not guess.
        missing: Cycles in which one was missing.
        late: Task velocities that came after the cycle in which they were to act.
    """

    def __init__(
        self,
        rows: int,
        T: Seconds,
        lag: Cycles,
        accelerations: JointAccelerations | None = None,
    ) -> None:
        self.missing = 0
        self.late = 0
        self._lag = lag
        self._linear_step = LINEAR_ACCELERATION * T  # [m/s] a cycle
        self._angular_step = ANGULAR_ACCELERATION * T  # [rad/s] a cycle
        self._steps = None if accelerations is None else accelerations * T  # (m,) a cycle
        self._rest = np.zeros(rows)
        self._played = 0  # cycle that was played last
        self.clear()

    def clear(self) -> None:
        """Clear the buffer: the next task velocity is approached from rest."""
        self.newest = -math.inf
        self.known_until = -math.inf
        self._twists: list[_Twist] = []
        line = _Line(_Twist(-1, self._rest), self._rest, -1, guessed=True, dense=False)
        self._last = _Output(self._played, line, self._rest, 0, self._rest, 0, self._rest)
        self._ahead: _Output | None = None

    def put(self, cycle: int, dx: TaskVelocity) -> None:
        """Record the task velocity of a cycle; of several for one cycle the newest counts."""
        twists = self._twists
        self._ahead = None
        self.late += cycle + self._lag <= self._played
        if not twists or cycle > twists[-1].cycle:
            twists.append(_Twist(cycle, dx))
        else:
            twists[:] = [twist for twist in twists if twist.cycle != cycle]
            insort(twists, _Twist(cycle, dx), key=attrgetter('cycle'))
        if len(twists) > self._lag + _KEPT:
            del twists[0]
        self.newest = twists[-1].cycle
        self.known_until = self.newest + self._lag

    def prepare(self, cycle: int) -> TaskVelocity | None:
        """What play() will return, if it is known already; else None."""
        if self.known_until != cycle:
            return None
        self._ahead = self._advanced(cycle)
        return self._ahead.dx

    def play(self, cycle: int) -> TaskVelocity:
        """The task velocity of a cycle."""
        output = self._ahead
        if output is None or output.cycle != cycle:
            output = self._advanced(cycle)
        self._ahead = None
        self._last = output
        self._played = cycle
        self.missing += output.line.guessed and output.line.dense
        return output.dx

    def _advanced(self, cycle: int) -> _Output:
        """The output of a later cycle."""
        last = self._last
        sampled = cycle - self._lag
        cycles = max(cycle - self._played, 1)
        line = self._sample(sampled)
        target = line.at(sampled) if line.guessed or line.start.cycle < sampled else line.start.dx
        residual = last.residual
        left = last.left
        if last.guesses and line.start is not last.line.start:
            jump, spread = self._correction(line, target, sampled, cycles)
        else:
            jump = last.target - target
            spread = int(self._cycles_needed(jump) > cycles)
        if spread:
            residual = residual + jump
            left = max(spread, left, self._cycles_needed(residual))
        if left:
            left -= 1
            residual = residual * (left / (left + 1))
        guesses = last.guesses + 1 if line.guessed else 0
        return _Output(cycle, line, target, guesses, residual, left, target + residual)

    def _sample(self, cycle: int) -> _Line:
        """The line through what is known before and after a cycle, else through the last two."""
        after = None
        for k in range(len(self._twists) - 1, -1, -1):
            twist = self._twists[k]
            if twist.cycle == cycle:
                return _Line(twist, self._rest, cycle, guessed=False, dense=True)
            if twist.cycle > cycle:
                after = twist
            elif after is None:
                return self._extrapolated(self._twists[max(k - _RECENT, 0) : k + 1])
            else:
                slope = (after.dx - twist.dx) / (after.cycle - twist.cycle)
                return _Line(twist, slope, after.cycle, guessed=False, dense=True)
        return self._last.line._replace(guessed=True, dense=False)

    def _extrapolated(self, recent: list[_Twist]) -> _Line:
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

    def _correction(
        self, line: _Line, target: TaskVelocity, sampled: int, cycles: Cycles
    ) -> tuple[TaskVelocity, Cycles]:
        """From the target to where a guess has led, and the cycles over which that fades out."""
        last = self._last
        old = last.line
        expected = old.at(sampled)
        if self._cycles_needed(expected - last.target) > cycles:
            expected = last.target  # a line between two that were known may be steep
        if old.start.cycle < 0:  # from rest
            return expected - target, 1
        spread = _RETURN * last.guesses if old.dense else line.start.cycle - old.start.cycle
        return expected - target, max(spread, 1)

    def _cycles_needed(self, change: TaskVelocity) -> Cycles:
        """Over so many cycles a change keeps to the largest accelerations."""
        if self._steps is not None:
            return math.ceil(float((np.abs(change) / self._steps).max()) - 1e-9)
        values = change.tolist()
        linear = math.hypot(*values[:3]) / self._linear_step
        angular = math.hypot(*values[3:]) / self._angular_step
        return math.ceil(max(linear, angular) - 1e-9)
