"""The receiver: every kind of command that is refused, and how it is counted; what is let in."""

import numpy as np
import pytest
from fake_robot_helpers import Q0, Connection

from redres_ros.fake_robot.plant import IdealPlant
from redres_ros.fake_robot.robot import FakeRobot
from redres_ros.fake_robot.session import SessionSettings
from redres_ros.robots import find_arm
from redres_ros.robots.joint_limits import JointLimits

T = 0.002  # [s]
LIMITS = JointLimits.of(find_arm('lwr4'))
NAMES = LIMITS.joint_names


def make_connection(cycles: int = 200) -> Connection:
    """A robot in command mode whose client has responded to every state up to now with Q0."""
    plant = IdealPlant(NAMES, T, Q0)
    connection = Connection(FakeRobot(plant, LIMITS, SessionSettings(monitor_time=0.0)))
    for tick in range(cycles):
        connection.advance()
        connection.send(tick, Q0)
    assert cycles < 100 or connection.robot.session.commanding
    return connection


WRONG_TICKS = {  # by how much its tick differs from the one before the present one
    'for the present state': (1, 'for no state'),
    'for a future state': (1000, 'for no state'),
    'for a state before the first': (-300, 'for no state'),
    'for a state of long ago': (-101, 'out of date'),
    'for a state before that of the last': (-2, 'out of order'),
}


@pytest.mark.parametrize(('off', 'kind'), WRONG_TICKS.values(), ids=list(WRONG_TICKS))
def test_a_command_for_the_wrong_state_is_refused_as_what_it_is_and_is_a_miss(off, kind):
    connection = make_connection()
    connection.advance()
    session = connection.robot.session
    missed = session.timing.counts['missed']
    connection.send(connection.robot.tick - 1 + off, Q0 + 1.0)
    connection.advance()
    assert session.refusals == {kind: 1}
    assert session.timing.counts['missed'] == missed + 1
    assert (connection.robot.reference == Q0).all()


@pytest.mark.parametrize(('off', 'is_taken'), [(-100, True), (-101, False)])
def test_a_command_may_be_a_hundred_cycles_late(off, is_taken):
    connection = make_connection(1)
    for _ in range(300):
        connection.advance()
    connection.send(connection.robot.tick - 1 + off, Q0)
    assert bool(connection.receiver.take()) is is_taken


WRONG_CONTENT = {
    'infinite': (NAMES, np.full(7, np.inf), 'not finite'),
    'too few': (NAMES, np.zeros(6), 'wrong length'),
    'a matrix': (NAMES, np.zeros((7, 1)), 'wrong length'),
    'another joint': ((*NAMES[:6], 'gripper'), Q0, 'wrong joint names'),
    'a joint twice': ((*NAMES, NAMES[0]), np.zeros(8), 'wrong joint names'),
    'without names': ((), Q0, 'wrong joint names'),
}


@pytest.mark.parametrize(
    ('names', 'positions', 'kind'), WRONG_CONTENT.values(), ids=list(WRONG_CONTENT)
)
def test_a_message_that_is_no_command_is_refused_as_what_it_is(names, positions, kind):
    connection = make_connection(0)
    connection.advance()
    connection.send(0, positions, names)
    assert connection.receiver.take() == []
    assert connection.robot.session.refusals == {kind: 1}


def test_joints_are_matched_by_name():
    connection = make_connection(0)
    connection.advance()
    order = [3, 1, 6, 0, 2, 5, 4]
    connection.send(0, Q0[order], tuple(NAMES[j] for j in order))
    assert (connection.receiver.take()[0].q == Q0).all()


def test_what_the_robot_gets_are_valid_commands_in_the_order_of_their_ticks():
    connection = make_connection()
    for _ in range(4):
        connection.advance()
    now = connection.robot.tick
    for number, off in enumerate((-3, -2, -3, 0, -1, -2, -1)):
        connection.send(now + off, Q0 + number)
    commands = connection.receiver.take()
    assert [command.tick for command in commands] == [now - 3, now - 2, now - 1]
    assert (commands[-1].q == Q0 + 4).all()  # of two for the same state the first
    # -3 again, 0, and -2 again; -1 again is the same command once more
    refusals = {'out of order': 2, 'for no state': 1}
    assert connection.robot.session.refusals == refusals


def test_while_two_publishers_respond_no_command_is_taken():
    connection = make_connection()
    session = connection.robot.session
    connection.receiver.publishers = 2
    connection.advance()
    assert not session.refusals  # one of them is silent, as one that was killed
    for _ in range(2):
        connection.send(connection.robot.tick - 1, Q0)
    assert connection.receiver.take() == []
    assert session.refusals == {'second publisher': 2}
    assert 'joint_command has 2 publishers that send commands' in str(session.command_error)
    connection.receiver.publishers = 1
    connection.send(connection.robot.tick - 1, Q0)
    assert len(connection.receiver.take()) == 1
