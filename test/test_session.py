"""Session and timing: a life in each profile, whatever happens in a session, what ends command mode
and what does not, and the figures behind it.
"""

import math
import statistics
from itertools import groupby

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, initialize, invariant, precondition, rule

from redres_ros.fake_robot.profile import PROFILES, Event
from redres_ros.fake_robot.session import CommandError, Session, SessionSettings
from redres_ros.fake_robot.timing import WINDOW, TimingMonitor

T = 0.002  # [s]


def make_session(cycles: int = 0, **given: float | str) -> Session:
    """A session that has got its first commands in time."""
    return responding(Session(T, SessionSettings(**{'monitor_time': 0.0, **given})), cycles)


def responding(session: Session, cycles: int = 1) -> Session:
    for _ in range(cycles):
        session.record(0)
    return session


def commanding(**given: float | str) -> Session:
    session = make_session(WINDOW, **given)
    while not session.commanding:  # some profiles have states in between
        responding(session).offer(0.0)
    return session


def test_command_mode_comes_after_the_monitor_time_and_not_a_cycle_earlier():
    session = make_session(monitor_time=0.1)
    for _ in range(49):
        responding(session).offer(0.0)
        assert session.state == 'MON'
    responding(session).offer(0.0)
    assert session.state == 'CMD'


def test_imperfect_timing_starts_the_monitor_time_anew():
    session = make_session(199, monitor_time=0.4)
    for _ in range(6):  # of 100: one more than PERFECT allows
        session.record(None)
    assert not responding(session, 94).ready  # the misses have just left the window ...
    assert not responding(session, 199).ready  # ... and from here it takes 0.4 s
    assert responding(session).ready


def test_a_cycle_without_a_command_in_time_cannot_begin_command_mode():
    session = make_session(100)
    session.record(None)
    session.offer(0.0)
    assert (session.quality, session.state, session.reason) == ('PERFECT', 'MON', '')


@pytest.mark.parametrize(
    ('profile', 'bridged', 'name'),
    [('lwr_fri1', 5, 'timing'), ('fci', 19, 'communication_constraints_violation')],
)
def test_so_many_misses_are_bridged_and_one_more_ends_command_mode(profile, bridged, name):
    session = commanding(profile=profile)
    for _ in range(bridged):
        session.record(None)
        assert session.commanding
    session.record(None)
    assert not session.commanding
    late = f'the newest command is {bridged + 1} cycles late, {bridged} are bridged'
    assert session.reason == f'{name}: {late}'
    assert session.timing.counts['bridged'] == bridged


def test_a_late_command_is_bridged_by_its_lateness():
    session = commanding()
    session.record(5)
    assert session.commanding
    session.record(6)
    assert not session.commanding


LOWEST = {'lwr_fri1': ('UNACCEPTABLE', '8'), 'sunrise': ('FAIR', '4')}


@pytest.mark.parametrize('profile', LOWEST)
def test_a_poor_connection_ends_command_mode_even_if_every_gap_is_bridged(profile):
    session = commanding(profile=profile)
    for k in range(2 * WINDOW):
        session.record(None if k % 2 else 0)
    words = f'timing: the connection is {LOWEST[profile][0]}: response rate '
    assert session.reason.startswith(words)


@pytest.mark.parametrize('profile', LOWEST)
def test_a_growing_latency_ends_command_mode_and_is_named_with_its_bound(profile):
    session = commanding(profile=profile)
    quality, bound = LOWEST[profile]
    cycles = 0
    while session.commanding:
        session.record(0, latency=T * (1.0 + 0.02 * cycles))  # yet no command is a cycle late
        cycles += 1
    assert session.reason.startswith(f'timing: the connection is {quality}: latency ')
    assert session.reason.endswith(f', allowed {bound} ms')


@pytest.mark.parametrize('since', [0, 1])
def test_the_reason_has_the_last_refusal_unless_a_valid_command_came_since(since):
    session = commanding()
    session.refuse(CommandError('not finite', 'lwr_a1_joint commanded nan rad'))
    responding(session, since)
    for _ in range(6):
        session.record(None)
    words = 'timing: the newest command is 6 cycles late, 5 are bridged'
    refused = '; last refused: lwr_a1_joint commanded nan rad'
    assert session.reason == (words if since else words + refused)


LIFE = [*[3] * 50, *[0] * 300, *[None] * 200, *[0] * 300]  # late, in time, silent, in time
LIFE += ['reset', *[None] * 200, *[3] * 50, *[0] * 300, 'stop', 'reset', 'stop']
WAITING = 'MONITORING_WAIT MONITORING_READY'
OPENING = f'{WAITING} COMMANDING_WAIT COMMANDING_ACTIVE'
STATES = {
    'lwr_fri1': 'MON CMD MON CMD MON',
    'fci': 'IDLE MOVE REFLEX AUTOMATIC_ERROR_RECOVERY IDLE MOVE REFLEX '
    'AUTOMATIC_ERROR_RECOVERY REFLEX',
    'sunrise': f'IDLE {OPENING} {WAITING} MONITORING_WAIT IDLE {WAITING} {WAITING} '
    f'MONITORING_WAIT IDLE {OPENING} MONITORING_WAIT',
}


@pytest.mark.parametrize('name', STATES)
def test_a_client_goes_through_the_states_of_its_profile(name: str) -> None:
    session = Session(T, SessionSettings(profile=name, monitor_time=0.1))
    seen = [session.state]
    for cycle in LIFE:
        if cycle == 'reset':
            session.reset()
        elif cycle == 'stop':
            session.stop('for the test')
        else:
            session.record(cycle)
        seen.append(session.state)
        session.offer(0.0)
        seen.append(session.state)
    assert [state for state, _ in groupby(seen)] == STATES[name].split()


def test_any_command_opens_a_session_of_sunrise() -> None:
    assert PROFILES['sunrise'].transitions['IDLE'][Event.POOR_TIMING] == 'MONITORING_WAIT'


class AnySession(RuleBasedStateMachine):
    """Whatever happens: the state changes as the table says; command mode begins with a good first
    command alone, after three cycles of good timing since a reset, and never goes with a reason,
    which is the first one until a reset.
    """

    @initialize(name=st.sampled_from(list(PROFILES)))
    def begin(self, name: str) -> None:
        self.session = Session(T, SessionSettings(profile=name, monitor_time=3 * T))
        self.good = 0  # cycles of good timing, one after the other

    def check(self, before: str, *events: Event) -> None:
        transitions = self.session.profile.transitions[before]
        allowed = {before, *(transitions.get(event, before) for event in events)}
        assert self.session.state in allowed

    @rule(lateness=st.sampled_from([None, 0, 0, 0, 1, 7]), times=st.integers(1, 130))
    def record(self, lateness: int | None, times: int) -> None:
        session = self.session
        for _ in range(times):
            before = session.state
            reason = session.reason
            session.record(lateness)
            self.check(before, *(set(Event) - {Event.FIRST_COMMAND, Event.RESET}))
            assert not reason or session.reason == reason
            is_good = session.timing.quality >= session.profile.entry
            self.good = self.good + 1 if is_good else 0

    @rule(distance=st.sampled_from([0.0, 0.01, 0.0101, math.inf, math.nan]))
    def offer(self, distance: float) -> None:
        session = self.session
        before = session.state
        was_commanding = session.commanding
        was_ready = session.ready
        session.offer(distance)
        self.check(before, Event.FIRST_COMMAND, Event.FAULT)
        if not was_commanding:
            assert session.commanding is (was_ready and distance <= 0.01)
            assert not was_ready or (self.good >= 3 and session.timing.age == 0)
        if was_ready and not session.commanding:
            assert f'the first command is {distance:.3g} rad' in session.reason

    @rule(reason=st.sampled_from(['stopped', 'pushed']))
    def stop(self, reason: str) -> None:
        before = self.session.state
        expected = self.session.reason or reason
        self.session.stop(reason)
        self.check(before, Event.FAULT)
        assert self.session.reason == expected
        assert not self.session.commanding

    @rule()
    def reset(self) -> None:
        before = self.session.state
        self.session.reset()
        self.good = 0
        self.check(before, Event.RESET)
        assert not self.session.ready
        assert self.session.reason == ''

    @precondition(lambda self: not self.session.reason)
    @rule()
    def respond(self) -> None:
        """A client with good timing that continues the mirrored position is always let in."""
        self.session.reset()
        for _ in range(150):
            self.session.record(0)
            self.session.offer(0.0)
        self.good = 150
        assert self.session.commanding

    @invariant()
    def commands_without_a_reason(self) -> None:
        if hasattr(self, 'session'):
            assert not (self.session.commanding and self.session.reason)


TestAnySession = AnySession.TestCase
TestAnySession.settings = settings(max_examples=60, stateful_step_count=20)


@given(
    st.lists(
        st.tuples(st.sampled_from([None, 0, 0, 1, 5]), st.floats(0.0, 0.1)),
        min_size=1,
        max_size=400,
    )
)
def test_whatever_came_the_statistics_are_those_of_the_last_packets(packets):
    timing = TimingMonitor(T)
    for lateness, latency in packets:
        timing.record(lateness, latency)
    every = [lateness for lateness, _ in packets]
    latenesses = every[-WINDOW:]
    latencies = [latency for lateness, latency in packets if lateness is not None] or [0.0]
    latencies = latencies[-WINDOW:]
    n = len(latenesses)
    assert timing.statistics == {
        'response_rate': (n - latenesses.count(None)) / n,
        'miss_rate': (n - latenesses.count(0)) / n,
        # Latencies are kept to the nanosecond.
        'latency': pytest.approx(statistics.fmean(latencies), abs=0.5e-9),
        'jitter': pytest.approx(statistics.pstdev(latencies), abs=1e-9),
    }
    counts = {'in time': every.count(0), 'late': every.count(1) + every.count(5)}
    assert timing.counts == counts | {'missed': every.count(None), 'bridged': 0}


def test_what_is_at_fault_is_what_the_next_better_quality_asks_for():
    timing = TimingMonitor(T)
    for k in range(WINDOW):
        timing.record(None if k % 20 == 0 else 0, 2.5 * T)  # 5 % missed is allowed for PERFECT
    assert (timing.quality, timing.at_fault) == (1, 'latency')
    assert timing.complaint == 'latency 5 ms, allowed 4 ms'


def packets_with(cause: str, size: float) -> list[tuple[int | None, float]]:
    """A window of packets; the size is a number of packets, or of cycles."""
    if cause == 'latency':
        return [(0, size * T)] * WINDOW
    if cause == 'jitter':  # that of a mean of 0
        return [(0, size * T * (-1) ** k) for k in range(WINDOW)]
    lateness = None if cause == 'response_rate' else 2
    return [(lateness if k < size else 0, 0.0) for k in range(WINDOW)]


@pytest.mark.parametrize('cause', ['response_rate', 'miss_rate', 'latency', 'jitter'])
def test_quality_falls_with_each_statistic_which_is_then_at_fault(cause):
    of_cycles = cause in ('latency', 'jitter')
    bounds = (1.0, 2.0, 4.0) if of_cycles else (5, 15, 40)
    for quality, bound in zip((3, 2, 1), bounds, strict=True):
        for size, expected in ((bound, quality), (bound + (0.01 if of_cycles else 1), quality - 1)):
            timing = TimingMonitor(T)
            for packet in packets_with(cause, size):
                timing.record(*packet)
            assert timing.quality == expected
            assert timing.at_fault == ('' if expected == 3 else cause)
