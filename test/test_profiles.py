"""Profiles of a session: every event in every state of each, and whatever happens in a session."""

import math

import pytest
from hypothesis import settings
from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, initialize, invariant, precondition, rule

from redres_ros.fake_robot.profile import PROFILES, Event, Profile
from redres_ros.fake_robot.session import Session, SessionSettings

T = 0.002  # [s]
EACH = pytest.mark.parametrize('profile', PROFILES.values(), ids=list(PROFILES))

# The state to which each event leads from each state, all of them: rows are events, columns states.
TABLES = {
    'lwr_fri1': """
                 MON CMD
SILENCE          MON MON
POOR_TIMING      MON CMD
GOOD_TIMING      MON CMD
LONG_GOOD_TIMING MON CMD
FIRST_COMMAND    CMD CMD
FAULT            MON MON
RESET            MON MON
""",
    'sunrise': """
                 IDLE            MONITORING_WAIT  MONITORING_READY COMMANDING_WAIT   COMMANDING_ACTIVE
SILENCE          IDLE            IDLE             IDLE             IDLE              IDLE
POOR_TIMING      MONITORING_WAIT MONITORING_WAIT  MONITORING_WAIT  MONITORING_WAIT   MONITORING_WAIT
GOOD_TIMING      MONITORING_WAIT MONITORING_READY MONITORING_READY COMMANDING_WAIT   COMMANDING_ACTIVE
LONG_GOOD_TIMING MONITORING_WAIT MONITORING_READY COMMANDING_WAIT  COMMANDING_WAIT   COMMANDING_ACTIVE
FIRST_COMMAND    IDLE            MONITORING_WAIT  MONITORING_READY COMMANDING_ACTIVE COMMANDING_ACTIVE
FAULT            IDLE            MONITORING_WAIT  MONITORING_WAIT  MONITORING_WAIT   MONITORING_WAIT
RESET            IDLE            MONITORING_WAIT  MONITORING_WAIT  MONITORING_WAIT   MONITORING_WAIT
""",  # noqa: E501
    'fci': """
                 IDLE   MOVE   REFLEX                   AUTOMATIC_ERROR_RECOVERY
SILENCE          IDLE   REFLEX REFLEX                   IDLE
POOR_TIMING      IDLE   MOVE   REFLEX                   IDLE
GOOD_TIMING      IDLE   MOVE   REFLEX                   IDLE
LONG_GOOD_TIMING IDLE   MOVE   REFLEX                   IDLE
FIRST_COMMAND    MOVE   MOVE   REFLEX                   AUTOMATIC_ERROR_RECOVERY
FAULT            REFLEX REFLEX REFLEX                   REFLEX
RESET            IDLE   IDLE   AUTOMATIC_ERROR_RECOVERY AUTOMATIC_ERROR_RECOVERY
""",
}  # a table is best read in one piece


def read(table: str) -> dict[tuple[str, Event], str]:
    head, *rows = [line.split() for line in table.strip().splitlines()]
    return {
        (state, Event[row[0]]): after
        for row in rows
        for state, after in zip(head, row[1:], strict=True)
    }


@EACH
def test_every_event_leads_from_every_state_where_the_table_says(profile):
    table = read(TABLES[profile.name])
    assert set(table) == {(state, event) for state in profile.transitions for event in Event}
    for (state, event), after in table.items():
        assert profile.after(state, event) == after


def lives_through(profile: Profile, latenesses: list[int | None]) -> list[str]:
    """The states of a session, each once in a row, while commands are offered where the arm is."""
    session = Session(T, SessionSettings(profile=profile.name, monitor_time=0.1))
    seen = [session.state]
    for lateness in latenesses:
        session.record(lateness)
        seen.append(session.state)
        session.offer(0.0)
        seen.append(session.state)
    return [state for k, state in enumerate(seen) if k == 0 or state != seen[k - 1]]


def test_a_client_that_is_late_at_first_then_in_time_and_then_silent_sees_these_states():
    latenesses = [3] * 50 + [0] * 300 + [None] * 200
    assert lives_through(PROFILES['lwr_fri1'], latenesses) == ['MON', 'CMD', 'MON']
    assert lives_through(PROFILES['fci'], latenesses) == ['IDLE', 'MOVE', 'REFLEX']
    assert lives_through(PROFILES['sunrise'], latenesses) == [
        'IDLE',
        'MONITORING_WAIT',
        'MONITORING_READY',
        'COMMANDING_WAIT',
        'COMMANDING_ACTIVE',
        'MONITORING_WAIT',
        'MONITORING_READY',
        'MONITORING_WAIT',
        'IDLE',
    ]


class AnySession(RuleBasedStateMachine):
    """Whatever happens: the state changes as the table says; command mode begins with a good first
    command alone, and never goes with a reason, which is the first one until a reset.
    """

    @initialize(name=st.sampled_from(list(PROFILES)))
    def begin(self, name: str) -> None:
        self.session = Session(T, SessionSettings(profile=name, monitor_time=3 * T))
        self.good_since = 0  # cycles in time, one after the other

    def check(self, before: str, *events: Event) -> None:
        profile = self.session.profile
        allowed = {before, *(profile.after(before, event) for event in events)}
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
            self.good_since = self.good_since + 1 if lateness == 0 else 0

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
            assert not session.commanding or self.good_since >= 1
        if was_ready and not session.commanding:
            assert f'the first command is {distance:.3g} rad' in session.reason

    @rule()
    def stop(self) -> None:
        before = self.session.state
        expected = self.session.reason or 'stopped'
        self.session.stop('stopped')
        self.check(before, Event.FAULT)
        assert self.session.reason == expected
        assert not self.session.commanding

    @rule()
    def reset(self) -> None:
        before = self.session.state
        self.session.reset()
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
        self.good_since = 150
        assert self.session.commanding

    @invariant()
    def commands_without_a_reason(self) -> None:
        if hasattr(self, 'session'):
            assert not (self.session.commanding and self.session.reason)


TestAnySession = AnySession.TestCase
TestAnySession.settings = settings(max_examples=60, stateful_step_count=20)
