"""The receiver: every kind of command that is refused, and how it is counted; what is let in."""

import numpy as np
import pytest
from fake_robot_helpers import EPOCH, Door

from redres_ros.fake_robot.command_validator import CommandValidator
from redres_ros.fake_robot.plant import IdealPlant
from redres_ros.fake_robot.robot import FakeRobot
from redres_ros.fake_robot.session import Refusal, Session, SessionSettings
from redres_ros.robots import find_arm
from redres_ros.robots.joint_limits import JointLimits

T = 0.002  # [s]
LIMITS = JointLimits.of(find_arm('lwr4'))
NAMES = LIMITS.joint_names
Q0 = np.radians((28.08, 104.12, 114.59, 94.85, 14.32, -28.12, 0.0))


def make_door(cycles: int = 200) -> Door:
    """A robot in command mode whose client has responded to every state up to now from the spot."""
    plant = IdealPlant(NAMES, T, Q0)
    session = Session(T, SessionSettings(monitor_time=0.0))
    door = Door(FakeRobot(plant, CommandValidator(LIMITS, T), session))
    for tick in range(cycles):
        door.advance()
        door.send(tick, Q0)
    assert cycles < 100 or session.commanding
    return door


def refused(door: Door) -> dict[Refusal, int]:
    """The kinds of which there were any, and how many."""
    return {kind: count for kind, count in door.robot.session.refusals.items() if count}


WRONG_TICKS = {  # by how much its tick differs from the one before the present one
    'for the present state': (1, Refusal.NO_STATE),
    'for a future state': (1000, Refusal.NO_STATE),
    'for a state before the first': (-300, Refusal.NO_STATE),
    'for a state of long ago': (-101, Refusal.OUT_OF_DATE),
    'for a state before that of the last': (-2, Refusal.OUT_OF_ORDER),
}


@pytest.mark.parametrize(('off', 'kind'), WRONG_TICKS.values(), ids=list(WRONG_TICKS))
def test_a_command_for_the_wrong_state_is_refused_as_what_it_is_and_is_a_miss(off, kind):
    door = make_door()
    door.advance()
    door.send(door.robot.tick - 1 + off, Q0 + 1.0)
    before = door.robot.session.counts
    door.advance()
    after = door.robot.session.counts
    assert refused(door) == {kind: 1}
    assert (after.refused, after.missed) == (1, before.missed + 1)
    assert (door.robot.reference == Q0).all()


def test_a_stamp_between_two_states_is_for_none():
    door = make_door()
    door.receiver.put(EPOCH + 1, NAMES, Q0)
    assert door.receiver.take(door.robot.tick)[-1].tick == door.robot.tick - 1
    assert refused(door) == {Refusal.NO_STATE: 1}


WRONG_CONTENT = {
    'one not finite': (NAMES, np.where(np.arange(7) == 3, np.nan, Q0), Refusal.NOT_FINITE),
    'infinite': (NAMES, np.full(7, np.inf), Refusal.NOT_FINITE),
    'too few': (NAMES, np.zeros(6), Refusal.WRONG_LENGTH),
    'too many': (NAMES, np.zeros(8), Refusal.WRONG_LENGTH),
    'none': (NAMES, np.zeros(0), Refusal.WRONG_LENGTH),
    'a matrix': (NAMES, np.zeros((7, 1)), Refusal.WRONG_LENGTH),
    'a joint missing': (NAMES[:6], Q0[:6], Refusal.WRONG_NAMES),
    'another joint': ((*NAMES[:6], 'gripper'), Q0, Refusal.WRONG_NAMES),
    'a joint twice': ((*NAMES[:6], NAMES[0]), Q0, Refusal.WRONG_NAMES),
    'without names': ((), Q0, Refusal.WRONG_NAMES),
}


@pytest.mark.parametrize(
    ('names', 'positions', 'kind'), WRONG_CONTENT.values(), ids=list(WRONG_CONTENT)
)
def test_a_message_that_is_no_command_is_refused_as_what_it_is(names, positions, kind):
    door = make_door(0)
    door.advance()
    door.send(0, positions, names)
    assert door.receiver.take(1) == []
    assert refused(door) == {kind: 1}


@pytest.mark.parametrize('joint', range(7))
@pytest.mark.parametrize('value', [np.nan, np.inf, -np.inf])
def test_a_value_that_is_not_finite_is_refused_by_the_name_of_its_joint(joint, value):
    door = make_door()
    door.advance()
    door.send(door.robot.tick - 1, np.where(np.arange(7) == joint, value, Q0))
    door.advance()
    words = f'{NAMES[joint]} commanded {value} rad; expected a finite value'
    assert str(door.robot.session.command_error) == words


def test_a_refused_command_is_a_miss_and_its_cause_is_kept():
    door = make_door()
    door.advance()
    for _ in range(6):
        door.send(door.robot.tick - 1, np.full(7, np.nan))
        door.advance()
    reason = door.robot.session.reason
    assert reason.startswith('timing: the newest command is 6 cycles late')
    assert reason.endswith(f'last refused: {NAMES[0]} commanded nan rad; expected a finite value')


def test_an_error_is_forgotten_with_the_next_valid_command_and_its_count_is_not():
    door = make_door()
    door.advance()
    door.send(door.robot.tick - 1, np.zeros(6))
    door.advance()
    assert door.robot.session.command_error.kind is Refusal.WRONG_LENGTH
    door.send(door.robot.tick - 1, Q0)
    door.advance()
    assert door.robot.session.command_error is None
    assert door.robot.session.counts.refused == 1


def test_joints_are_matched_by_name():
    door = make_door(0)
    door.advance()
    order = [3, 1, 6, 0, 2, 5, 4]
    door.send(0, Q0[order], tuple(NAMES[j] for j in order))
    assert (door.receiver.take(1)[0].q == Q0).all()


def test_a_second_command_for_the_same_state_counts_as_none():
    door = make_door()
    door.send(door.robot.tick - 1, Q0 + 1.0)
    commands = door.receiver.take(door.robot.tick)
    assert [command.tick for command in commands] == [door.robot.tick - 1]
    assert (commands[0].q == Q0).all()
    assert refused(door) == {}


def test_what_the_robot_gets_are_valid_commands_in_the_order_of_their_ticks():
    door = make_door()
    for _ in range(4):
        door.advance()
    now = door.robot.tick
    for off in (-3, -2, -3, 0, -1, -2, -1):
        door.send(now + off, Q0)
    assert [command.tick for command in door.receiver.take(now)] == [now - 3, now - 2, now - 1]
    # -3 again, 0, and -2 again; -1 again is the same command once more
    assert refused(door) == {Refusal.OUT_OF_ORDER: 2, Refusal.NO_STATE: 1}


def test_while_two_publishers_respond_no_command_is_taken():
    door = make_door()
    door.receiver.publishers = 2
    door.advance()
    assert refused(door) == {}  # one of them is silent, as one that was killed
    for _ in range(2):
        door.send(door.robot.tick - 1, Q0)
    assert door.receiver.take(door.robot.tick) == []
    assert refused(door) == {Refusal.SECOND_PUBLISHER: 2}
    assert 'joint_command has 2 publishers that send commands' in str(
        door.robot.session.command_error
    )
    door.receiver.publishers = 1
    door.send(door.robot.tick - 1, Q0)
    assert len(door.receiver.take(door.robot.tick)) == 1
