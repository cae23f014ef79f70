"""Session and timing: what ends command mode and what does not, and the figures behind it."""

import statistics

import pytest
from hypothesis import given
from hypothesis import strategies as st

from redres_ros.fake_robot.session import CommandError, Refusal, Session, SessionSettings
from redres_ros.fake_robot.timing import WINDOW, Statistics, TimingMonitor

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


@pytest.mark.parametrize('monitor_time', [0.5, 0.1, 0.002])
def test_command_mode_comes_after_the_monitor_time_and_not_a_cycle_earlier(monitor_time):
    session = make_session(monitor_time=monitor_time)
    for _ in range(round(monitor_time / T) - 1):
        responding(session).offer(0.0)
        assert session.state == 'MON'
    responding(session).offer(0.0)
    assert session.state == 'CMD'


def test_one_miss_in_a_short_window_is_too_many_for_command_mode():
    session = make_session()
    session.record(None)
    session.offer(0.0)
    assert session.state == 'MON'
    # PERFECT allows 5 %: one of twenty packets.
    assert responding(session, 18).ready is False
    assert responding(session).ready is True


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
    assert session.timing.counts.bridged == bridged


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
    session.refuse(CommandError(Refusal.NOT_FINITE, 'lwr_a1_joint commanded nan rad'))
    responding(session, since)
    for _ in range(6):
        session.record(None)
    words = 'timing: the newest command is 6 cycles late, 5 are bridged'
    refused = '; last refused: lwr_a1_joint commanded nan rad'
    assert session.reason == (words if since else words + refused)


def test_reset_costs_a_new_monitor_time():
    session = make_session(1000, monitor_time=0.1)
    session.reset()
    assert not responding(session, 49).ready
    assert responding(session).ready


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
    figures = timing.statistics
    n = len(latenesses)
    assert figures.response_rate == (n - latenesses.count(None)) / n
    assert figures.miss_rate == (n - latenesses.count(0)) / n
    # Latencies are kept to the nanosecond.
    assert figures.latency == pytest.approx(statistics.fmean(latencies), abs=0.5e-9)
    assert figures.jitter == pytest.approx(statistics.pstdev(latencies), abs=1e-9)
    assert figures.miss_count == len(every) - every.count(0)
    counts = timing.counts
    assert (counts.cycles, counts.missed) == (len(every), every.count(None))
    assert (counts.in_time, counts.late) == (every.count(0), every.count(1) + every.count(5))
    assert timing.silent is (figures.response_rate == 0.0)


def test_no_latency_leaves_a_trace_once_it_is_out_of_the_window():
    timing = TimingMonitor(T)
    for latency in [1e9, 3000.0] * 50 + [0.0005] * WINDOW:
        timing.record(0, latency)
    # exactly, or sums would drift for hours
    assert timing.statistics == Statistics(1.0, 0.0005, 0.0, 0.0, 0)


def test_the_longest_run_of_misses_counts_late_commands_too():
    timing = TimingMonitor(T)
    for lateness in [None] * 30 + [2] * 20 + [0] * WINDOW + [None] * 3:
        timing.record(lateness, 0.0)
    assert timing.counts.longest_run == 50
    assert timing.age == 3


CAUSES = {
    'response_rate': (None, 0.0),
    'latency': (0, 3.0 * T),
    'miss_rate': (2, 0.0),
    'jitter': (0, 9.0 * T),
}


@pytest.mark.parametrize('cause', CAUSES)
def test_what_is_at_fault_is_named_as_soon_as_the_quality_falls(cause):
    timing = TimingMonitor(T)
    for _ in range(WINDOW):
        timing.record(0, 0.0)
        assert (timing.quality, timing.at_fault, timing.complaint) == (3, '', '')
    rarely = cause in ('miss_rate', 'jitter')
    for k in range(WINDOW):
        timing.record(*((0, 0.0) if rarely and k % 5 else CAUSES[cause]))
        assert (timing.at_fault == '') is (timing.quality == 3)
    assert timing.at_fault == cause


def test_what_is_at_fault_is_what_the_next_better_quality_asks_for():
    timing = TimingMonitor(T)
    for k in range(WINDOW):
        timing.record(None if k % 20 == 0 else 0, 2.5 * T)  # 5 % missed is allowed for PERFECT
    assert (timing.quality, timing.at_fault) == (1, 'latency')
    assert timing.complaint == 'latency 5 ms, allowed 4 ms'


@pytest.mark.parametrize(
    ('missed', 'quality'), [(5, 3), (6, 2), (15, 2), (16, 1), (40, 1), (41, 0)]
)
def test_quality_falls_with_the_miss_rate(missed, quality):
    timing = TimingMonitor(T)
    for packet in range(WINDOW):
        timing.record(None if packet < missed else 0, 0.0)
    assert timing.quality == quality


@pytest.mark.parametrize(
    ('cycles', 'quality'), [(1.0, 3), (1.01, 2), (2.0, 2), (2.01, 1), (4.0, 1), (4.01, 0)]
)
@pytest.mark.parametrize('figure', ['latency', 'jitter'])
def test_quality_falls_with_latency_and_jitter(figure, cycles, quality):
    timing = TimingMonitor(T)
    # Jitter is that of a mean of 0: bounds on both are the same.
    sign = -1 if figure == 'jitter' else 1
    for packet in range(WINDOW):
        timing.record(0, T * cycles * sign**packet)
    assert timing.quality == quality
