"""Profiles of a session: a life in each, and whatever happens in a session."""

import math
from itertools import groupby

import pytest
from hypothesis import settings
from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, initialize, invariant, precondition, rule

from redres_ros.fake_robot.profile import PROFILES, Event
from redres_ros.fake_robot.session import Session, SessionSettings

T = 0.002  # [s]


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
    assert PROFILES['sunrise'].after('IDLE', Event.POOR_TIMING) == 'MONITORING_WAIT'


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
