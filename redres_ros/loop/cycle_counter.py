"""Assigns states to cycles of the robot, by stamps that jitter, drift and may be set."""

from collections.abc import Iterable
from itertools import pairwise
from math import floor

from redres_ros.errors import RedresError
from redres_ros.types import Cycles, Nanoseconds, Seconds

NANOSECONDS = 1_000_000_000
RATES = (10.0, 2000.0)  # cycles a second that a robot may have [Hz]

_GAIN = 0.05  # fraction of a residual by which the expected stamps, and their jitter, are moved
_DOUBT = 0.2  # of a period by which a state must be later than half of one to be two cycles
_ODD = 0.25  # [periods] from where it is expected, at which a stamp or an arrival is odd
_JITTERS = 0.125  # [periods] in the mean, by a clock that shows no odd stamps
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
    Where that is follows slowly from the stamps themselves, so jitter and drift do not matter.

    A state may come late, but never early: its arrival says how many cycles it is at most. If a
    stamp is odd, off by more than its clock's jitter, that decides: on one cycle more or less, on a
    stray beside the state of a cycle, on a clock that was set. A state behind the newest one is
    refused; if it came late enough to be a new one, a second one that goes on from it, and was not
    held up with it, sets the clock. In doubt the lesser count is taken: one too many is a leap.

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
        self._earliest = 0.0  # when the newest cycle's state would have come at the earliest [s]
        self._jitter = _ODD  # mean residual of the stamps [periods]
        self._numbers: dict[int, int] = {}  # cycles by stamp, of the last states
        self._unjudged: list[int] = []  # stamps since the rate was judged, believed or not [ns]
        self._changes = 0.0
        self.rate_error = ''
        self._set()

    def _set(self) -> None:
        """Expect stamps by the clock of the state that comes now."""
        self._apart = 0  # stamp of the last state, if that may be of another clock [ns]
        self._apart_most = 0.0  # [periods] that it was at most after the newest one
        self._late = 0.0  # [periods] by which the newest stamp is later than expected
        self._counted = 0  # states since the clock was set
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
        # Periods since the newest cycle, by its clock; and at most, as no state comes early.
        since = (stamp - self.newest) / self.period + self._late
        most = (arrived - self._earliest) * NANOSECONDS / self.period
        fits = self._fits(stamp, since, most)
        is_second = self._is_second(stamp, since, most, fits) if self._apart else False
        if is_second:
            cycles = self._by_arrival(stamp, arrived, most)
            self._set()
        elif fits and is_second is not None:
            cycles = self._count(stamp, since, most)
        else:
            if not fits and most >= 1.0 - _ODD:
                self._apart = stamp
                self._apart_most = most
            cycles = self._step(stamp, arrived, most)
        self.number += cycles
        self._counted += 1
        self._earliest += cycles * (1.0 + _DRIFT) * self.period / NANOSECONDS
        if stamp != self._apart:
            self._earliest = min(self._earliest, arrived)
        if self.newest and arrived - self.arrived > _GAP:
            self.woke = arrived
        self.newest = stamp
        self.arrived = arrived
        self._numbers[stamp] = self.number
        if len(self._numbers) > _REMEMBERED:
            del self._numbers[next(iter(self._numbers))]  # the oldest
        return cycles

    def _fits(self, stamp: Nanoseconds, since: float, most: float) -> bool:
        """Whether a state is of the clock in force: later, or again of the newest cycle."""
        elapsed = stamp - self.newest
        if since < _ODD and self._jitter < _JITTERS:
            is_early = elapsed > 0 and most < 1.0 - _ODD
            return since > -_ODD and (is_early or self._apart == self.newest)
        is_later = elapsed > 0 or (elapsed < 0 and since > 0.5)
        return self.newest > 0 and is_later and elapsed <= _NEW_CLOCK

    def _is_second(self, stamp: Nanoseconds, since: float, most: float, fits: bool) -> bool | None:
        """Whether a state goes on from the one apart, by another clock; None: both were held up."""
        after = (stamp - self._apart) / self.period
        if not self._apart_most:  # that one was counted
            return abs(after - 1.0) < _ODD and not (fits and since < _ODD)
        slack = most - self._apart_most - round(after)
        # The clock in force has stamps at -1, -2, ...: one that was overtaken, before a late one.
        place = since - after
        is_known = fits and abs(place - min(round(place), -1)) < _ODD
        if is_known or not 1 <= round(after) <= most + _ODD - 1.0:
            return False
        if fits and slack < -0.5:
            self._apart_most += slack
            return None
        return slack >= -0.5 and (not fits or max(abs(slack), abs(most - round(most))) < _ODD)

    def _count(self, stamp: Nanoseconds, since: float, most: float) -> Cycles:
        """Cycles by the clock in force, or to the first state of one that was set ahead."""
        self._changes = max(self._changes - since * self.period / NANOSECONDS, 0.0)
        if since < -0.5:
            raise ClockError(
                f'stamped {(stamp - self.newest) / 1e6:.3g} ms after the last one, and so were '
                f'those before; expected {self.period / 1e6:.3g} ms '
                f'(rate {NANOSECONDS / self.period:g} Hz)'
            )
        cycles = max(round(since - _DOUBT), 1)
        is_odd = abs(since - cycles) > _ODD and self._jitter < _JITTERS
        is_odd = is_odd or (cycles > 1 and since - most > 0.5)
        if is_odd:
            at_most = max(floor(most + _ODD), 0)
            cycles = min(max(round(since), 1), at_most) if since >= _ODD else 0
        gain = max(_GAIN, 1.0 / (self._counted + 1))  # at first the mean of all stamps
        self._late = (since - cycles) * (1.0 if is_odd else 1.0 - gain)
        if cycles:
            self._jitter += _GAIN * (min(abs(since - cycles), _ODD) - self._jitter)
        self._apart = stamp if is_odd and cycles else 0
        self._apart_most = 0.0
        return cycles

    def _step(self, stamp: Nanoseconds, arrived: Seconds, most: float) -> Cycles:
        """Cycles to a state after a silence; without one it came too late, or is of a recording."""
        step = stamp - self.newest
        if abs(step) > _NEW_CLOCK // 10:
            self._changes = min(self._changes + 1.0, _CHANGES + 1.0)
        if self.newest and not (step and arrived - self.arrived > _SILENCE):
            side = 'after' if step > 0 else 'before'
            place = f'{abs(step) / NANOSECONDS:.3g} s {side} the newest one'
            raise ClockError(
                f'stamped {place if step else "as the last one, but with other positions"}; '
                f'expected a later stamp, by at most {_NEW_CLOCK / NANOSECONDS:g} s, or a second '
                'state like it'
            )
        self._set()
        if self.newest and abs(step) <= _NEW_CLOCK:
            return self._by_arrival(stamp, arrived, most)
        self.number += 1
        self._earliest = arrived
        return 0

    def _by_arrival(self, stamp: Nanoseconds, arrived: Seconds, most: float) -> Cycles:
        """Cycles since the newest state, as they follow from when states came."""
        if self._apart:
            most = min(most, self._apart_most + round((stamp - self._apart) / self.period))
        since = (arrived - self.arrived) * NANOSECONDS / self.period
        return max(floor(min(most, since + 0.5) + _ODD), 1)

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
        nearest = self.number + round((stamp - self.newest) / self.period)
        return self._numbers.get(stamp, nearest)

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
