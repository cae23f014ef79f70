"""Profiles of a session: every event in every state of each, and a life of each from the first
command to the last.
"""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from redres_ros.errors import UnknownNameError
from redres_ros.fake_robot.profile import FCI, LWR_FRI1, PROFILES, SUNRISE, Event, Profile, State
from redres_ros.fake_robot.quality import Quality, SunriseQuality
from redres_ros.fake_robot.session import Session, SessionSettings
from redres_ros.fake_robot.timing import WINDOW

T = 0.002  # [s]
EACH = pytest.mark.parametrize('profile', PROFILES.values(), ids=list(PROFILES))

# The state to which each event leads from each state, all of them: rows are events, columns states.
LWR_TABLE = """
                 MON CMD
SILENCE          MON MON
POOR_TIMING      MON CMD
GOOD_TIMING      MON CMD
LONG_GOOD_TIMING MON CMD
FIRST_COMMAND    CMD CMD
FAULT            MON MON
RESET            MON MON
"""
SUNRISE_TABLE = """
                 IDLE            MONITORING_WAIT  MONITORING_READY COMMANDING_WAIT   COMMANDING_ACTIVE
SILENCE          IDLE            IDLE             IDLE             IDLE              IDLE
POOR_TIMING      MONITORING_WAIT MONITORING_WAIT  MONITORING_WAIT  MONITORING_WAIT   MONITORING_WAIT
GOOD_TIMING      MONITORING_WAIT MONITORING_READY MONITORING_READY COMMANDING_WAIT   COMMANDING_ACTIVE
LONG_GOOD_TIMING MONITORING_WAIT MONITORING_READY COMMANDING_WAIT  COMMANDING_WAIT   COMMANDING_ACTIVE
FIRST_COMMAND    IDLE            MONITORING_WAIT  MONITORING_READY COMMANDING_ACTIVE COMMANDING_ACTIVE
FAULT            IDLE            MONITORING_WAIT  MONITORING_WAIT  MONITORING_WAIT   MONITORING_WAIT
RESET            IDLE            MONITORING_WAIT  MONITORING_WAIT  MONITORING_WAIT   MONITORING_WAIT
"""  # noqa: E501, a table is best read in one piece


FCI_TABLE = """
                 IDLE   MOVE   REFLEX                   AUTOMATIC_ERROR_RECOVERY
SILENCE          IDLE   REFLEX REFLEX                   IDLE
POOR_TIMING      IDLE   MOVE   REFLEX                   IDLE
GOOD_TIMING      IDLE   MOVE   REFLEX                   IDLE
LONG_GOOD_TIMING IDLE   MOVE   REFLEX                   IDLE
FIRST_COMMAND    MOVE   MOVE   REFLEX                   AUTOMATIC_ERROR_RECOVERY
FAULT            REFLEX REFLEX REFLEX                   REFLEX
RESET            IDLE   IDLE   AUTOMATIC_ERROR_RECOVERY AUTOMATIC_ERROR_RECOVERY
"""


def pairs(profile: Profile, table: str) -> list[tuple[Profile, State, Event, State]]:
    head, *rows = [line.split() for line in table.strip().splitlines()]
    return [
        (profile, State[state], Event[row[0]], State[after])
        for row in rows
        for state, after in zip(head, row[1:], strict=True)
    ]


EVERY_PAIR = pairs(LWR_FRI1, LWR_TABLE) + pairs(SUNRISE, SUNRISE_TABLE) + pairs(FCI, FCI_TABLE)


@pytest.mark.parametrize(
    ('profile', 'state', 'event', 'after'),
    EVERY_PAIR,
    ids=[f'{p.name}-{s.name}-{e.name}' for p, s, e, _ in EVERY_PAIR],
)
def test_an_event_leads_where_the_table_says(profile, state, event, after):
    assert profile.after(state, event) is after


def test_the_tables_leave_out_no_profile_state_or_event():
    expected = {
        (profile, state, event)
        for profile in PROFILES.values()
        for state in profile.states
        for event in Event
    }
    assert {pair[:3] for pair in EVERY_PAIR} == expected
    assert len(EVERY_PAIR) == len(expected) == (2 + 5 + 4) * 7


@EACH
def test_no_transition_leads_to_a_state_of_another_profile(profile):
    for after in profile.transitions.values():
        assert set(after.values()) <= set(profile.states)


@EACH
def test_only_a_first_command_leads_to_commanding_and_any_fault_or_reset_away_from_it(profile):
    for transitions in profile.transitions.values():
        into = {event for event, after in transitions.items() if after is profile.commanding}
        assert into <= {Event.FIRST_COMMAND}
    assert all(
        profile.after(state, event) is not profile.commanding
        for state in profile.states
        for event in (Event.FAULT, Event.RESET, Event.SILENCE)
    )


@EACH
def test_every_state_can_be_reached_from_every_other(profile):
    for start in profile.states:
        reached = {start}
        for _ in profile.states:
            reached |= {profile.after(state, event) for state in reached for event in Event}
        assert reached == set(profile.states)


@EACH
def test_quality_names_and_numbers_are_those_of_the_profile(profile):
    qualities = type(profile.entry)
    names = {
        'lwr_fri1': ['UNACCEPTABLE', 'BAD', 'OK', 'PERFECT'],
        'sunrise': ['POOR', 'FAIR', 'GOOD', 'EXCELLENT'],
        'fci': ['INSUFFICIENT', 'POOR', 'GOOD', 'EXCELLENT'],
    }
    assert [quality.name for quality in sorted(qualities)] == names[profile.name]
    assert [int(quality) for quality in sorted(qualities)] == [0, 1, 2, 3]
    assert (
        list(profile.thresholds) == sorted(qualities, reverse=True)[:3]
    )  # best first; the worst asks for nothing


def test_an_unknown_profile_is_refused_with_those_that_exist():
    with pytest.raises(UnknownNameError, match='fci, lwr_fri1, sunrise'):
        SessionSettings(profile='fri3')


# --- sessions -------------------------------------------------------------------------------------


def session_of(profile: Profile, **settings: float) -> Session:
    return Session(T, SessionSettings(profile=profile.name, **settings))


def states(session: Session, latenesses: list[int | None]) -> list[State]:
    """The states that a session goes through, each once in a row, while commands on the spot are
    offered.
    """
    seen = [session.state]
    for lateness in latenesses:
        session.record(lateness)
        seen.append(session.state)
        session.offer(0.0)
        seen.append(session.state)
    return [state for k, state in enumerate(seen) if k == 0 or state is not seen[k - 1]]


def commanding(profile: Profile, **settings: float) -> Session:
    session = session_of(profile, monitor_time=0.0, **settings)
    states(session, [0] * WINDOW)
    assert session.commanding
    return session


@EACH
def test_only_one_state_is_commanding(profile):
    session = session_of(profile)
    assert not session.commanding
    assert commanding(profile).state is profile.commanding


def test_a_life_of_an_lwr():
    assert states(session_of(LWR_FRI1, monitor_time=0.1), [0] * 60 + [None] * 200) == [
        State.MON,
        State.CMD,
        State.MON,
    ]


def test_a_life_of_a_sunrise_goes_through_every_state():
    session = session_of(SUNRISE, monitor_time=0.1, bridged_misses=5)
    # A client that responds late at first, then in time, and is no more.
    assert states(session, [3] * 50 + [0] * 300 + [None] * 200) == [
        State.IDLE,
        State.MONITORING_WAIT,
        State.MONITORING_READY,
        State.COMMANDING_WAIT,
        State.COMMANDING_ACTIVE,
        State.MONITORING_WAIT,
        State.MONITORING_READY,
        State.MONITORING_WAIT,
        State.IDLE,
    ]


@EACH
@pytest.mark.parametrize('monitor_time', [0.1, 0.5])
def test_command_mode_takes_the_monitor_time_of_good_timing(profile, monitor_time):
    session = session_of(profile, monitor_time=monitor_time)
    steps = {'lwr_fri1': 1, 'sunrise': 2, 'fci': 1}[
        profile.name
    ]  # cycles: on the way through COMMANDING_WAIT
    states(session, [0] * (round(monitor_time / T) - 1))
    assert not session.commanding
    states(session, [0] * steps)
    assert session.commanding


@pytest.mark.parametrize('profile', [LWR_FRI1, SUNRISE], ids=lambda profile: profile.name)
def test_quality_below_the_lowest_ends_command_mode_and_names_what_is_at_fault(profile):
    session = commanding(profile, bridged_misses=5)
    lowest = profile.lowest
    cycles = 0
    while session.commanding:
        assert session.timing.quality >= lowest
        session.record(
            0, latency=T * (1.0 + 0.02 * cycles)
        )  # worse and worse, yet no command is a cycle late
        cycles += 1
    bound = profile.thresholds[lowest].latency * T * 1e3
    assert session.timing.quality == lowest - 1
    assert session.reason.startswith(
        f'timing: the connection is {session.timing.quality.name}: latency '
    )
    assert session.reason.endswith(f', allowed {bound:g} ms')


@pytest.mark.parametrize(
    ('profile', 'ends'), [(LWR_FRI1, Quality.UNACCEPTABLE), (SUNRISE, SunriseQuality.FAIR)]
)
def test_an_lwr_commands_at_any_quality_but_unacceptable_and_a_sunrise_only_when_good(
    profile, ends
):
    session = commanding(profile)
    for k in range(WINDOW):
        session.record(None if k % 2 else 0)
    assert session.reason.startswith(f'timing: the connection is {ends.name}: response rate')


@EACH
@pytest.mark.parametrize('stop', ['limits', 'gap'])
def test_a_reason_keeps_the_session_from_commanding_until_reset(profile, stop):
    session = commanding(profile)
    if stop == 'limits':
        session.stop('position limit')
    else:
        session.reset()
        while not session.ready:
            session.record(0)
        session.offer(1.0)
    reason = session.reason
    assert reason != ''
    assert State.COMMANDING_WAIT not in states(session, [0] * 300)
    assert (session.reason, session.commanding) == (reason, False)
    session.reset()
    states(session, [0] * 10)
    assert (session.reason, session.commanding) == ('', True)


def test_a_command_after_silence_opens_a_sunrise_session_again():
    session = commanding(SUNRISE)
    states(session, [None] * WINDOW)
    assert session.state is State.IDLE
    session.record(7)
    assert session.state is State.MONITORING_WAIT


ACTIONS = st.lists(
    st.one_of(
        st.tuples(st.just('record'), st.sampled_from([None, 0, 0, 0, 1, 7]), st.integers(1, 130)),
        st.tuples(st.just('offer'), st.sampled_from([0.0, 0.1]), st.just(1)),
        st.tuples(st.sampled_from(['stop', 'reset']), st.none(), st.just(1)),
    ),
    max_size=40,
)


@pytest.mark.slow
@given(st.sampled_from(list(PROFILES)), ACTIONS)
def test_whatever_happens_a_session_changes_state_only_as_its_table_says(name, actions):
    session = session_of(PROFILES[name], monitor_time=3 * T)
    for action, value, times in actions:
        for _ in range(times):
            before = session.state
            getattr(session, action)(*{'stop': ['stopped'], 'reset': []}.get(action, [value]))
            allowed = {
                'offer': {Event.FIRST_COMMAND, Event.FAULT},
                'stop': {Event.FAULT},
                'reset': {Event.RESET},
                'record': set(Event) - {Event.FIRST_COMMAND, Event.RESET},
            }[action]
            assert session.state in {before} | {
                session.profile.after(before, event) for event in allowed
            }
            assert not (session.commanding and session.reason)
