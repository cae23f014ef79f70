"""Session and timing: what ends command mode and what does not, and the figures behind it."""

import statistics

import pytest
from hypothesis import given
from hypothesis import strategies as st

from redres_ros.fake_robot.session import CommandError, Session, SessionSettings
from redres_ros.fake_robot.timing import WINDOW, TimingMonitor

T = 0.002  # [s]


def make_session(cycles: int = 0, **settings: float | str) -> Session:
    """A session that has got its first commands in time."""
    return responding(Session(T, SessionSettings(**{'monitor_time': 0.0, **settings})), cycles)


def responding(session: Session, cycles: int = 1) -> Session:
    for _ in range(cycles):
        session.record(0)
    return session


def commanding(**settings: float | str) -> Session:
    session = make_session(WINDOW, **settings)
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
    assert (
        session.reason
        == f'{name}: the newest command is {bridged + 1} cycles late, {bridged} are bridged'
    )
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


# --- timing ---------------------------------------------------------------------------------------


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
    latencies = [latency for lateness, latency in packets if lateness is not None][-WINDOW:] or [
        0.0
    ]
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
    assert timing.silent is (timing.statistics['response_rate'] == 0.0)


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
