"""Assigns states to cycles of the robot, by stamps that jitter, drift and may be set."""

from itertools import pairwise

from redres_ros.errors import RedresError
from redres_ros.types import Cycles, Nanoseconds, Seconds

NANOSECONDS = 1_000_000_000
RATES = (10.0, 2000.0)  # cycles a second that a robot may have [Hz]

_PHASE_GAIN = 0.03  # share of a stamp's residual by which the expected stamps are moved
_RATE_GAIN = 2e-4  # the same for their distance: a robot's clock runs at a rate of its own
_DOUBT = 0.2  # of a period by which a state must be later than half of one to be two cycles
_RATE_RANGE = 0.01  # of a period by which that distance may differ from the nominal one
_EARLIEST = -1.5  # periods; states that come earlier than this come at another rate
_NEW_CLOCK = NANOSECONDS  # [ns] a larger step of the stamps is a robot that was started again
_SILENCE = 0.5  # [s] for which a robot says nothing when it is started again
_DRIFT = 0.01  # [s/s] by which the robot's clock may drift against this computer's
_SLOWER = NANOSECONDS // 4  # [ns] of late states after which that clock is slower: a simulation's
_REMEMBERED = 512  # states whose cycle is known by their very stamp
_INTERVALS = 15  # between states, by which the robot's rate is judged
_SHORT = 3  # of these are one cycle, also where every other state gets lost
_STEADY = (0.8, 1.25)  # of the period, within which an interval of one cycle has to be
_BURST = NANOSECONDS // 10  # [ns] of stamps, longer than those that come at once after an overrun


class ClockError(RedresError):
    """A state whose stamp is not that of a new cycle."""


def is_of_this_moment(stamp: Nanoseconds, time_of_day: Nanoseconds, tolerance: Seconds) -> bool:
    """Whether a message that arrived at a time of day was stamped on this computer just before."""
    return abs(time_of_day - stamp) <= tolerance * NANOSECONDS


class CycleCounter:
    """Counts the robot's cycles by the stamps of its states.

    A state is one cycle as long as its stamp lies within half a period of where it is expected.
    Where that is follows slowly from the stamps themselves, so jitter and drift do not matter. A
    clock that is set, forward or back, by no more than a second counts as one cycle too: forward
    because the state came sooner after its stamp than any could, back because the next one goes on
    from there.

    Attributes:
        number: Of the newest state's cycle; never goes back.
        newest: Stamp of the newest state; 0 before the first.
        arrived: When that came.
        rate_error: That the robot has another rate than expected, and which.
    """

    def __init__(self, period: Nanoseconds) -> None:
        self.period = period
        self.restart()

    def restart(self) -> None:
        """Forget all states."""
        self.number = 0
        self.newest = 0
        self.arrived = 0.0
        self._late = 0.0  # [ns] by which the newest stamp is later than expected
        self._counted = 0  # states since the clock was set
        self._rate = 0.0  # [ns] by which a cycle of the stamps is longer than a period
        self._behind = 0  # stamp of a state that came out of order [ns]
        self._apart = 0  # stamp of a state that may be of a new clock [ns]
        self._least_delay = 0.0  # [s] from a stamp to the arrival, on two clocks
        self._in_time = 0  # stamp of the newest state with about that delay [ns]
        self._numbers: dict[int, int] = {}
        self._unjudged: list[int] = []  # stamps since the rate was judged, believed or not [ns]
        self._fast_since = 0  # stamp from which on states come too fast [ns]; 0: they do not
        self.rate_error = ''

    def enter(self, stamp: Nanoseconds, arrived: Seconds) -> Cycles:
        """The number of cycles from the last state to this one; 0 if the clock is a new one.

        Raises:
            ClockError: The state has no stamp, is out of order, or comes far too early.
        """
        if stamp <= 0:
            raise ClockError('the state has no stamp; expected the time of its measurement')
        self._unjudged.append(stamp)
        if len(self._unjudged) > _INTERVALS:
            self._judge_rate(stamp)
        elapsed = stamp - self.newest
        delay = arrived - stamp / NANOSECONDS
        if self.newest == 0:
            return self._begin(stamp, arrived, 0)
        if abs(elapsed) > _NEW_CLOCK:
            return self._begin_anew(stamp, arrived)
        if elapsed <= 0:
            return self._begin_behind(stamp, arrived)
        cycles = self._count(elapsed, delay)
        if cycles == 0:
            return self._begin(stamp, arrived, 1)
        self._least_delay = min(self._least_delay + _DRIFT * elapsed / NANOSECONDS, delay)
        if delay - self._least_delay < 2 * self.period / NANOSECONDS:
            self._in_time = stamp
        return self._go_on(stamp, arrived, cycles)

    def _judge_rate(self, stamp: int) -> None:
        """Compare the intervals between states with the period.

        Lost states make some of them longer, and after an overrun some states come at once.
        """
        in_order = sorted(self._unjudged)
        self._unjudged.clear()
        intervals = sorted(after - before for before, after in pairwise(in_order))
        short = intervals[_SHORT - 1]
        usual = intervals[_INTERVALS // 2]
        if usual >= _STEADY[0] * self.period:
            self._fast_since = 0
        elif not self._fast_since:
            self._fast_since = in_order[0]
        self.rate_error = ''
        if short > _STEADY[1] * self.period:
            self.rate_error = self._rate_error(short)
        elif self._fast_since and stamp - self._fast_since > _BURST and usual > 0:
            self.rate_error = self._rate_error(usual)

    def _rate_error(self, interval: int) -> str:
        """Names the robot's rate, of an interval [ns], and the expected one."""
        return (
            f'states come at {NANOSECONDS / interval:.4g} Hz; expected '
            f'{NANOSECONDS / self.period:.4g} Hz (parameter rate)'
        )

    @property
    def earliest_arrival(self) -> Seconds:
        """When the newest state would have come with the least delay seen so far; when it did
        come, if the robot's clock is slower than this computer's.
        """
        if self.newest - self._in_time > _SLOWER:
            return self.arrived
        return self.newest / NANOSECONDS + self._least_delay

    def cycle(self, stamp: Nanoseconds) -> int:
        """The cycle of a stamp: that of its state, else the nearest."""
        known = self._numbers.get(stamp)
        if known is not None:
            return known
        return self.number + round((stamp - self.newest) / self.period)

    def _age(self, stamp: Nanoseconds) -> Seconds:
        """How far a stamp is behind the newest state, in whole cycles."""
        return (self.number - self.cycle(stamp)) * self.period / NANOSECONDS

    def age_problem(self, stamp: Nanoseconds, allowed: Seconds) -> str:
        """Why a stamp is too far from the robot's clock; '' if it is not."""
        age = self._age(stamp)
        if abs(age) <= allowed:
            return ''
        side = 'behind' if age > 0.0 else 'ahead of'
        return f"stamped {abs(age):.3g} s {side} the robot's clock; allowed: {allowed:g}"

    def robot_stamp(
        self, stamp: Nanoseconds, time_of_day: Nanoseconds, tolerance: Seconds
    ) -> Nanoseconds:
        """A stamp by the robot's clock; 0, for now, in place of one by another clock.

        A stamp that is farther than the tolerance from the robot's clock, and that this computer's
        clock showed as short a time before its arrival (time_of_day; 0: not known), was made on
        this computer: the arrival is what counts.
        """
        is_far = abs(self._age(stamp)) > tolerance
        return 0 if is_far and is_of_this_moment(stamp, time_of_day, tolerance) else stamp

    def is_of_a_state(self, stamp: Nanoseconds) -> bool:
        """Whether a stamp is that of a state, as far as is known."""
        return stamp in self._numbers or (stamp - self.newest) % self.period == 0

    def _count(self, elapsed: int, delay: float) -> int:
        """Cycles in a time that has passed on the robot's clock; 0 if it was set forward."""
        length = self.period + self._rate  # [ns]
        since = elapsed + self._late  # [ns] since the last state was expected
        cycles = max(round(since / length - _DOUBT), 1)
        if since < (1.0 + _EARLIEST) * length:
            raise ClockError(
                f'stamped {elapsed / 1e6:.3g} ms after the last one, and so were those before; '
                f'expected {self.period / 1e6:.3g} ms (rate {NANOSECONDS / self.period:g} Hz)'
            )
        too_early = (self._least_delay - delay) * NANOSECONDS  # [ns]
        if cycles > 1 and too_early > 0.5 * (cycles - 1) * length:
            return 0
        residual = since - cycles * length  # [ns]
        allowed = _RATE_RANGE * self.period
        gain = max(_PHASE_GAIN, 1.0 / (self._counted + 1))  # at first the mean of all stamps
        self._late = (1.0 - gain) * residual
        self._rate = min(max(self._rate + _RATE_GAIN * residual, -allowed), allowed)
        return cycles

    def _begin_anew(self, stamp: int, arrived: float) -> int:
        """A robot that was started again: it was silent before, or says so twice.

        A single state with such a stamp, as from a recording that is played, is none.
        """
        since = stamp - self._apart
        if arrived - self.arrived > _SILENCE or 0 <= since < 2 * self.period:
            return self._begin(stamp, arrived, 0)
        self._apart = stamp
        apart = (stamp - self.newest) / NANOSECONDS
        raise ClockError(
            f'stamped {apart:.3g} s from the newest one; expected a step of at most '
            f'{_NEW_CLOCK / NANOSECONDS:g} s, or a second state like it'
        )

    def _begin_behind(self, stamp: int, arrived: float) -> int:
        """A clock that was set back goes on from there; a state that came too late does not."""
        since = stamp - self._behind
        if 0 < since < 2 * self.period:
            return self._begin(stamp, arrived, 1)
        self._behind = stamp
        late = (self.newest - stamp) / 1e6
        raise ClockError(f'stamped {late:.3g} ms before the newest one; expected a later stamp')

    def _begin(self, stamp: int, arrived: float, cycles: int) -> int:
        """Count from this stamp on, without those before."""
        self._least_delay = arrived - stamp / NANOSECONDS
        self._in_time = stamp
        self._late = 0.0
        self._rate = 0.0
        self._counted = 0
        self._numbers.clear()
        self._go_on(stamp, arrived, max(cycles, 1))
        return cycles

    def _go_on(self, stamp: int, arrived: float, cycles: int) -> int:
        self.number += cycles
        self._counted += 1
        self.newest = stamp
        self.arrived = arrived
        self._behind = 0
        self._apart = 0
        self._numbers[stamp] = self.number
        if len(self._numbers) > _REMEMBERED:
            del self._numbers[next(iter(self._numbers))]  # the oldest
        return cycles
