"""Session and timing: every way into and out of command mode, and the books on which it rests."""

import math
import statistics
from itertools import pairwise

import pytest
from hypothesis import given
from hypothesis import strategies as st

from redres_ros.errors import RangeError
from redres_ros.fake_robot.profile import PROFILES, Profile, State
from redres_ros.fake_robot.quality import Quality, Statistics, thresholds_of
from redres_ros.fake_robot.session import CommandError, Refusal, Session, SessionSettings
from redres_ros.fake_robot.timing import WINDOW, TimingMonitor

THRESHOLDS = thresholds_of(Quality)
T = 0.002  # [s]


def responding(session: Session, cycles: int = 1) -> Session:
    for _ in range(cycles):
        session.record(0)
    return session


def commanding(**settings: float) -> Session:
    session = responding(Session(T, SessionSettings(monitor_time=0.0, **settings)))
    session.offer(0.0)
    assert session.state is State.CMD
    return session


def test_session_begins_in_monitor_mode_with_nothing_known():
    session = Session(T)
    assert (session.state, session.reason, session.timing.quality) == (
        State.MON,
        '',
        Quality.UNACCEPTABLE,
    )


@pytest.mark.parametrize('monitor_time', [0.5, 0.1, 0.002])
def test_command_mode_comes_after_the_monitor_time_and_not_a_cycle_earlier(monitor_time):
    session = Session(T, SessionSettings(monitor_time=monitor_time))
    for cycle in range(1, round(monitor_time / T) + 1):
        assert session.state is State.MON
        responding(session).offer(0.0)
        assert session.ready is False or cycle == round(monitor_time / T)
    assert session.state is State.CMD


def test_no_monitor_time_lets_the_first_response_command():
    session = Session(T, SessionSettings(monitor_time=0.0))
    session.record(None)
    session.offer(0.0)
    assert session.state is State.MON
    # One miss in the window is more than PERFECT allows, until twenty packets dilute it to 5 %.
    assert responding(session, 18).ready is False
    assert responding(session).ready is True


def test_imperfect_timing_starts_the_monitor_time_anew():
    session = responding(Session(T, SessionSettings(monitor_time=0.4)), 199)
    for _ in range(6):  # of 100: one more than PERFECT allows
        session.record(None)
    assert not responding(session, 94).ready  # the misses have just left the window ...
    assert not responding(session, 199).ready  # ... and from here it takes 0.4 s
    assert responding(session).ready


def test_a_cycle_without_a_command_in_time_cannot_begin_command_mode():
    session = responding(Session(T, SessionSettings(monitor_time=0.0)), 100)
    session.record(None)
    session.offer(0.0)
    assert session.timing.quality is Quality.PERFECT
    assert session.state is State.MON
    assert session.reason == ''


@pytest.mark.parametrize('gap', [0.011, math.inf, math.nan])
def test_a_first_command_off_the_mirrored_position_is_an_interpolation_error(gap):
    session = responding(Session(T, SessionSettings(monitor_time=0.0, entry_tolerance=0.01)))
    session.offer(gap)
    assert session.state is State.MON
    assert session.reason.startswith('interpolation error')


def test_a_first_command_within_the_tolerance_is_none():
    session = responding(Session(T, SessionSettings(monitor_time=0.0, entry_tolerance=0.01)))
    session.offer(0.01)
    assert session.state is State.CMD


@pytest.mark.parametrize('bridged', [0, 1, 5])
def test_so_many_misses_are_bridged_and_one_more_ends_command_mode(bridged):
    session = responding(commanding(bridged_misses=bridged), 100)
    for _ in range(bridged):
        session.record(None)
        assert session.state is State.CMD
    session.record(None)
    assert session.state is State.MON
    assert (
        session.reason
        == f'timing: the newest command is {bridged + 1} cycles late, {bridged} are bridged'
    )
    assert session.counts.bridged == bridged


def test_a_command_in_time_ends_a_run_of_misses():
    session = responding(commanding(bridged_misses=1), 100)
    for _ in range(10):
        session.record(None)
        responding(session, 20)
    assert session.state is State.CMD
    assert session.counts.longest_run == 1


def test_a_late_command_is_bridged_by_its_lateness():
    session = responding(commanding(bridged_misses=3), 100)
    session.record(3)
    assert session.state is State.CMD
    session.record(4)
    assert session.state is State.MON


def test_an_unacceptable_connection_ends_command_mode_even_if_every_gap_is_bridged():
    session = responding(commanding(bridged_misses=5), 100)
    for _ in range(WINDOW):
        session.record(None)
        session.record(0)
    assert session.state is State.MON
    assert session.reason == 'timing: the connection is UNACCEPTABLE: response rate 59%, needed 60%'


def test_the_text_of_a_refusal_reaches_the_reason():
    session = commanding(bridged_misses=1)
    responding(session, 100)
    session.refuse(CommandError(Refusal.NOT_FINITE, 'lwr_a1_joint commanded nan rad'))
    session.record(None)
    session.record(None)
    assert session.reason.endswith('last refused: lwr_a1_joint commanded nan rad')


def test_a_refusal_before_the_last_command_is_not_the_reason():
    session = responding(commanding(bridged_misses=0), 100)
    session.refuse(CommandError(Refusal.WRONG_NAMES, 'wrong joint names'))
    responding(session).record(None)
    assert session.reason == 'timing: the newest command is 1 cycles late, 0 are bridged'


def test_refusals_are_counted_by_kind():
    session = Session(T)
    for times, kind in enumerate(Refusal):
        for _ in range(times):
            session.refuse(CommandError(kind, 'whatever'))
    assert session.refusals == {kind: times for times, kind in enumerate(Refusal)}
    assert session.counts.refused == sum(range(len(Refusal)))
    assert session.counts.cycles == 0  # a refusal is no cycle


# Those that commands lead to; the two others follow from a stop alone.
EVERY_STATE = [
    (profile, state)
    for profile in PROFILES.values()
    for state in profile.states
    if state not in (State.REFLEX, State.AUTOMATIC_ERROR_RECOVERY)
]


def follow(session: Session, cycles: int = 1) -> None:
    """Respond in time, each time where the arm is."""
    for _ in range(cycles):
        session.record(0)
        session.offer(0.0)


def in_state(profile: Profile, state: State) -> Session:
    """A session that commands have brought into that state."""
    session = Session(T, SessionSettings(profile=profile.name, monitor_time=10 * T))
    for _ in range(10 * WINDOW):
        for step in (lambda: None, lambda: session.record(0), lambda: session.offer(0.0)):
            step()
            if session.state is state:
                return session
    raise AssertionError(f'{profile.name} never came to {state}')


@pytest.mark.parametrize(
    ('profile', 'state'),
    EVERY_STATE,
    ids=[f'{profile.name}-{state.name}' for profile, state in EVERY_STATE],
)
def test_a_stop_keeps_for_its_first_reason_from_commanding_until_reset(profile, state):
    session = in_state(profile, state)
    session.stop('first')
    session.stop('second')
    follow(session, 10 * WINDOW)
    assert (session.commanding, session.reason) == (False, 'first')
    session.reset()
    follow(session, 10 * WINDOW)
    assert (session.commanding, session.reason) == (True, '')


def test_reset_costs_a_new_monitor_time():
    session = responding(Session(T, SessionSettings(monitor_time=0.1)), 1000)
    session.reset()
    assert not responding(session, 49).ready
    assert responding(session).ready


def test_reset_in_command_mode_falls_back_without_a_reason():
    session = commanding()
    session.reset()
    assert (session.state, session.reason) == (State.MON, '')


ACTIONS = st.one_of(
    st.tuples(st.just('record'), st.sampled_from([None, 0, 0, 0, 0, 1, 7])),
    st.tuples(st.just('offer'), st.sampled_from([0.0, 0.1, math.nan])),
    st.tuples(st.sampled_from(['stop', 'reset']), st.none()),
)


@given(st.lists(ACTIONS, max_size=60))
def test_command_mode_never_goes_with_a_reason_and_begins_only_with_a_good_first_command(actions):
    session = Session(T, SessionSettings(monitor_time=2 * T, bridged_misses=1))
    for action, value in actions:
        before = session.state
        {
            'record': lambda v: session.record(v),
            'offer': lambda v: session.offer(v),
            'stop': lambda _: session.stop('stopped'),
            'reset': lambda _: session.reset(),
        }[action](value)
        assert session.state is State.MON or session.reason == ''
        if (before, session.state) == (State.MON, State.CMD):
            assert (action, value) == ('offer', 0.0)


def test_statistics_are_those_of_the_packets():
    timing = TimingMonitor(T, THRESHOLDS)
    for lateness, latency in [(0, 0.001), (None, 9.0), (0, 0.002), (1, 0.003)]:
        timing.record(lateness, latency)
    figures = timing.statistics
    assert figures.response_rate == 3 / 4
    assert figures.miss_rate == 2 / 4
    assert figures.miss_count == 2
    assert figures.latency == pytest.approx(0.002, rel=1e-12)
    assert figures.jitter == pytest.approx(0.001 * math.sqrt(2 / 3), rel=1e-12)


def test_statistics_forget_what_is_older_than_the_window_but_the_counts_do_not():
    timing = TimingMonitor(T, THRESHOLDS)
    for lateness in [None] * 30 + [2] * 20 + [0] * WINDOW:
        timing.record(lateness, 0.0005 if lateness == 0 else 9.0)
    assert timing.statistics == Statistics(1.0, pytest.approx(0.0005), pytest.approx(0.0), 0.0, 50)
    counts = timing.counts(bridged=0, refused=0)
    assert (counts.cycles, counts.in_time, counts.late, counts.missed, counts.longest_run) == (
        150,
        100,
        20,
        30,
        50,
    )


@given(
    st.lists(
        st.tuples(st.sampled_from([None, 0, 0, 1, 5]), st.floats(0.0, 0.1)),
        min_size=1,
        max_size=400,
    )
)
def test_whatever_came_the_statistics_are_those_of_the_last_packets(packets):
    timing = TimingMonitor(T, THRESHOLDS)
    for lateness, latency in packets:
        timing.record(lateness, latency)
    latenesses = [lateness for lateness, _ in packets][-WINDOW:]
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
    assert figures.miss_count == sum(lateness != 0 for lateness, _ in packets)


def test_no_latency_leaves_a_trace_once_it_is_out_of_the_window():
    timing = TimingMonitor(T, THRESHOLDS)
    for latency in [math.nan, math.inf, 1e9, 3000.0, -math.inf] * 20 + [0.0005] * WINDOW:
        timing.record(0, latency)
    assert timing.statistics == Statistics(
        1.0, 0.0005, 0.0, 0.0, 0
    )  # exactly, or sums would drift for hours


CAUSES = {
    'response_rate': (None, 0.0),
    'latency': (0, 3.0 * T),
    'miss_rate': (2, 0.0),
    'jitter': (0, 9.0 * T),
}


@pytest.mark.parametrize('cause', CAUSES)
def test_what_is_at_fault_is_named_as_soon_as_the_quality_falls(cause):
    timing = TimingMonitor(T, THRESHOLDS)
    for _ in range(WINDOW):
        timing.record(0, 0.0)
        assert (timing.quality, timing.at_fault, timing.complaint) == (
            Quality.PERFECT,
            '',
            '',
        )
    lateness, latency = CAUSES[cause]
    for k in range(WINDOW):
        timing.record(
            *((0, 0.0) if cause in ('miss_rate', 'jitter') and k % 5 else (lateness, latency))
        )
        assert (timing.at_fault == '') is (timing.quality is Quality.PERFECT)
    assert timing.at_fault == cause


def test_what_is_at_fault_is_what_the_next_better_quality_asks_for():
    timing = TimingMonitor(T, THRESHOLDS)
    for k in range(WINDOW):
        timing.record(None if k % 20 == 0 else 0, 2.5 * T)  # 5 % missed is allowed for PERFECT
    assert (timing.quality, timing.at_fault) == (Quality.BAD, 'latency')
    assert timing.complaint == 'latency 5 ms, allowed 4 ms'


@pytest.mark.parametrize('name', ['response_rate', 'latency', 'jitter', 'miss_rate'])
def test_a_statistic_that_is_no_number_breaks_its_bound(name):
    figures = {'response_rate': 1.0, 'latency': 0.0, 'jitter': 0.0, 'miss_rate': 0.0}
    for threshold in THRESHOLDS.values():
        assert threshold.breach(**figures) == ''
        assert threshold.breach(**figures | {name: math.nan}) == name


def test_before_the_first_packet_it_is_the_lack_of_commands_that_is_at_fault():
    assert TimingMonitor(T, THRESHOLDS).at_fault == 'response_rate'


@pytest.mark.parametrize(
    ('missed', 'quality'),
    [
        (0, Quality.PERFECT),
        (5, Quality.PERFECT),
        (6, Quality.OK),
        (15, Quality.OK),
        (16, Quality.BAD),
        (40, Quality.BAD),
        (41, Quality.UNACCEPTABLE),
    ],
)
def test_quality_falls_with_the_miss_rate(missed, quality):
    timing = TimingMonitor(T, THRESHOLDS)
    for packet in range(WINDOW):
        timing.record(None if packet < missed else 0, 0.0)
    assert timing.quality is quality


@pytest.mark.parametrize(
    ('cycles', 'quality'),
    [
        (0.9, Quality.PERFECT),
        (1.9, Quality.OK),
        (3.9, Quality.BAD),
        (4.1, Quality.UNACCEPTABLE),
        (math.nan, Quality.UNACCEPTABLE),
    ],
)
@pytest.mark.parametrize('figure', ['latency', 'jitter'])
def test_quality_falls_with_latency_and_jitter(figure, cycles, quality):
    timing = TimingMonitor(T, THRESHOLDS)
    mean = cycles * (figure == 'latency')
    deviation = cycles * (figure == 'jitter')
    for packet in range(WINDOW):
        timing.record(0, T * (mean + deviation * (-1) ** packet))
    assert timing.quality is quality


def test_thresholds_get_laxer_from_the_best_quality_down():
    qualities = list(THRESHOLDS)
    thresholds = list(THRESHOLDS.values())
    assert qualities == [Quality.PERFECT, Quality.OK, Quality.BAD]
    for better, worse in pairwise(thresholds):
        assert worse.response_rate < better.response_rate
        assert (worse.miss_rate, worse.latency, worse.jitter) > (
            better.miss_rate,
            better.latency,
            better.jitter,
        )


@pytest.mark.parametrize(
    'settings', [{'monitor_time': -1.0}, {'bridged_misses': 101}, {'entry_tolerance': math.nan}]
)
def test_settings_out_of_range_are_refused(settings):
    with pytest.raises(RangeError, match=next(iter(settings))):
        SessionSettings(**settings)
