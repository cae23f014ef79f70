"""Assigns states to cycles of the robot, by stamps that jitter, drift and may be set."""

from collections.abc import Iterable
from itertools import pairwise

from redres_ros.errors import RedresError
from redres_ros.types import Cycles, Nanoseconds, Seconds

NANOSECONDS = 1_000_000_000
RATES = (10.0, 2000.0)  # cycles a second that a robot may have [Hz]

_GAIN = 0.05  # fraction of a stamp's residual by which the expected stamps are moved
_DOUBT = 0.2  # of a period by which a state must be later than half of one to be two cycles
_EARLIEST = -1.5  # periods; states that come earlier than this come at another rate
# A stray takes the cycle of the state after it. Only stamps that do not jitter show one.
_STRAY = (0.25, 0.7)  # [periods] by which it is early; if by more, the clock was set back
_NEAR = 0.15  # [periods] from where its cycle was expected, at which the state after it comes
_STEADY_STATES = 10  # before it, none of which was as early or late
_NEW_CLOCK = NANOSECONDS  # [ns] a larger step of the stamps is a robot that was started again
_SILENCE = 0.5  # [s] for which a robot says nothing when it is started again
_GAP = 0.15  # [s] without a state, in which this process may have slept
_DRIFT = 0.01  # [s/s] by which the robot's clock may drift against this computer's
_REMEMBERED = 512  # states whose cycle is known by their very stamp
# Intervals between states, by which the robot's rate is judged: so many, and of so long a time that
# those that come at once after an overrun are less than half
_INTERVALS = 15
_JUDGED = NANOSECONDS // 5  # [ns]
_SHORT = 0.2  # of these are one cycle, also where every other state gets lost
_STEADY = (0.8, 1.25)  # of the period, within which an interval of one cycle has to be
# Two publishers of a robot's states: their mean interval is shorter than this, of the period, and
# one of five is longer than this, of the mean
_DOUBLED = 0.67
_UNEVEN = 1.3
# If their clocks lie 0.1 s or more apart: changes from one to the other, less one for each second
_CHANGES = 10.0
_TWO_NODES = 'two nodes publish the joints of this arm: ros2 topic info -v joint_states names them'


class ClockError(RedresError):
    """A state whose stamp is not that of a new cycle."""


def are_of_two(stamps: Iterable[Nanoseconds], period: Nanoseconds) -> bool:
    """Whether stamps, of which two differ, are of the states that two nodes publish of one arm."""
    ordered = sorted(set(stamps))
    intervals = sorted(after - before for before, after in pairwise(ordered))
    mean = (ordered[-1] - ordered[0]) / len(intervals)
    long = intervals[int((1.0 - _SHORT) * len(intervals))]
    return mean < _DOUBLED * period and long > _UNEVEN * mean


class CycleCounter:
    """Counts the robot's cycles by the stamps of its states.

    A state is one cycle as long as its stamp lies within half a period of where it is expected.
    Where that is follows slowly from the stamps themselves, so jitter and drift do not matter. The
    first state of another clock is refused, unless it is ahead by no more than a second: it came
    sooner after its stamp than any could. A second one like it sets the clock, and arrivals count
    its cycles; before that, all that fit the old clock are of that one, however late they come.

    Attributes:
        number: Of the newest state's cycle; never goes back.
        newest: Stamp of the newest state; 0 before the first.
        arrived: When that came.
        woke: When a state came again after a gap.
        rate_error: That the robot has another rate than expected, or that two nodes publish it.
    """

    def __init__(self, period: Nanoseconds) -> None:
        self.period = period
        self.restart()

    def restart(self) -> None:
        self.number = 0
        self.newest = 0
        self.arrived = 0.0
        self.woke = -_GAP
        self._steady = 0  # states in a row, before the newest one, that came as expected
        self._numbers: dict[int, int] = {}  # cycles by stamp, of the last states
        self._unjudged: list[int] = []  # stamps since the rate was judged, believed or not [ns]
        self._changes = 0.0
        self.rate_error = ''
        self._set(0, 0.0)

    def _set(self, stamp: Nanoseconds, arrived: Seconds) -> None:
        """Expect stamps by the clock of this one."""
        self._apart = 0  # stamp of the last state, if that may be of another clock [ns]
        self._late = 0.0  # [ns] by which the newest stamp is later than expected
        self._counted = 0  # states since the clock was set
        self._least_delay = arrived - stamp / NANOSECONDS  # [s] to the arrival, on two clocks
        self._numbers.clear()
        self._unjudged.clear()

    def enter(self, stamp: Nanoseconds, arrived: Seconds) -> Cycles:
        """Cycles from the last state to this one; 0 if the clock is a new one, and for another one
        of the same cycle, whose number stays.

        Raises ClockError for one that has no stamp, is out of order, or comes far too early.
        """
        if stamp <= 0:
            raise ClockError('the state has no stamp; expected the time of its measurement')
        self._unjudged.append(stamp)
        if len(self._unjudged) > _INTERVALS and abs(stamp - self._unjudged[0]) >= _JUDGED:
            self._judge_rate()
        if self._changes >= _CHANGES:
            self.rate_error = _TWO_NODES
        elapsed = stamp - self.newest
        since = elapsed + self._late  # [ns] since the newest cycle, on its clock
        delay = arrived - stamp / NANOSECONDS - self._least_delay  # [s] beyond the least one
        due = since + delay * NANOSECONDS  # [ns] since that cycle, by the arrival
        half = 0.5 * self.period
        if elapsed and abs(since) < _NEAR * self.period and self._is_stray(due):
            cycles = 0
            self._late = since
            self._steady = 0
        # One that is before the newest state is later than its cycle, if that state was ahead.
        elif self.newest and elapsed <= _NEW_CLOCK and (elapsed > 0 or (elapsed and since > half)):
            self._changes = max(self._changes - since / NANOSECONDS, 0.0)
            cycles = self._count(stamp, arrived, since, due)
            self.number += cycles
        else:
            cycles = self._step(stamp, arrived, due)
            self.number += max(cycles, 1)
        self._counted += 1
        if self.newest and arrived - self.arrived > _GAP:
            self.woke = arrived
        self.newest = stamp
        self.arrived = arrived
        self._numbers[stamp] = self.number
        if len(self._numbers) > _REMEMBERED:
            del self._numbers[next(iter(self._numbers))]  # the oldest
        return cycles

    def _is_stray(self, due: float) -> bool:
        """Whether the newest state took the cycle of one that comes now."""
        early = -self._late / self.period
        came_apart = early < -_STRAY[0] or _STRAY[0] < early < _STRAY[1]
        return (came_apart or due < 0.5 * self.period) and self._steady >= _STEADY_STATES

    def _count(self, stamp: Nanoseconds, arrived: Seconds, since: float, due: float) -> Cycles:
        """Cycles in a time that has passed on the robot's clock, or by arrival if that is ahead."""
        elapsed = stamp - self.newest
        cycles = max(round(since / self.period - _DOUBT), 1)
        self._steady = self._steady + 1 if abs(self._late) < _STRAY[0] * self.period else 0
        if since < (1.0 + _EARLIEST) * self.period:
            raise ClockError(
                f'stamped {elapsed / 1e6:.3g} ms after the last one, and so were those before; '
                f'expected {self.period / 1e6:.3g} ms (rate {NANOSECONDS / self.period:g} Hz)'
            )
        if self._apart == self.newest and 0.5 < elapsed / self.period < 1.5:
            self._set(stamp, arrived)
            return 1
        if cycles > 1 and since - due > 0.5 * (cycles - 1) * self.period:
            cycles = self._arrivals(arrived)
            self._late = since - cycles * self.period
            self._apart = stamp
            return cycles
        gain = max(_GAIN, 1.0 / (self._counted + 1))  # at first the mean of all stamps
        self._late = (1.0 - gain) * (since - cycles * self.period)
        self._least_delay += min(_DRIFT * since, due - since) / NANOSECONDS
        self._apart = 0
        return cycles

    def _step(self, stamp: Nanoseconds, arrived: Seconds, due: float) -> Cycles:
        """Cycles to a state of another clock; 0 for a robot that was started again.

        That one was silent before. One whose clock was set says so twice, of which the first is a
        cycle without a state: a single one came too late, or from a recording that is played.
        """
        step = stamp - self.newest
        if abs(step) > _NEW_CLOCK // 10:
            self._changes = min(self._changes + 1.0, _CHANGES + 1.0)
        is_second = 0 < stamp - self._apart < 2 * self.period and due > 1.5 * self.period
        if self.newest and not is_second and not (step and arrived - self.arrived > _SILENCE):
            self._apart = stamp
            side = 'after' if step > 0 else 'before'
            place = f'{abs(step) / NANOSECONDS:.3g} s {side} the newest one'
            raise ClockError(
                f'stamped {place if step else "as the last one, but with other positions"}; '
                f'expected a later stamp, by at most {_NEW_CLOCK / NANOSECONDS:g} s, or a second '
                'state like it'
            )
        self._set(stamp, arrived)
        if self.newest and (is_second or abs(step) <= _NEW_CLOCK):
            return max(self._arrivals(arrived), 1 + is_second)
        return 0

    def _arrivals(self, arrived: Seconds) -> Cycles:
        """Cycles since the newest state came."""
        return max(round((arrived - self.arrived) * NANOSECONDS / self.period), 1)

    def _judge_rate(self) -> None:
        """Compare the intervals between states with the period: lost states make some longer."""
        intervals = sorted(after - before for before, after in pairwise(sorted(self._unjudged)))
        short = intervals[int(_SHORT * len(intervals))]
        usual = max(short, min(intervals[len(intervals) // 2], self.period))
        self.rate_error = ''
        if are_of_two(self._unjudged, self.period):
            self.rate_error = _TWO_NODES
        elif usual and not _STEADY[0] <= usual / self.period <= _STEADY[1]:
            self.rate_error = (
                f'states come at {NANOSECONDS / usual:.4g} Hz; expected '
                f'{NANOSECONDS / self.period:.4g} Hz (parameter rate)'
            )
        self._unjudged.clear()

    def cycle(self, stamp: Nanoseconds) -> int:
        """The cycle of a stamp: that of its state, else the nearest."""
        known = self._numbers.get(stamp)
        if known is not None:
            return known
        return self.number + round((stamp - self.newest) / self.period)

    def judge(
        self, stamp: Nanoseconds, time_of_day: Nanoseconds, allowed: Seconds
    ) -> tuple[Nanoseconds, str]:
        """A message's stamp by the robot's clock, 0 for now; and why it is too far from the newest
        state, '' if it is not.

        One that is too far, and that this computer's clock showed as short a time before the
        message arrived (time_of_day; 0: not known), was made on this computer: the arrival counts.
        """
        age = (self.number - self.cycle(stamp)) * self.period / NANOSECONDS
        if not stamp or abs(age) <= allowed:
            return stamp, ''
        if abs(time_of_day - stamp) <= allowed * NANOSECONDS:
            return 0, ''
        side = 'behind' if age > 0.0 else 'ahead of'
        return stamp, f"stamped {abs(age):.3g} s {side} the robot's clock; allowed: {allowed:g}"

    def is_of_a_state(self, stamp: Nanoseconds) -> bool:
        """Whether a stamp is that of a state, as far as is known."""
        return stamp in self._numbers or (stamp - self.newest) % self.period == 0
