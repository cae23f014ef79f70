"""The fake robot as a whole: when a command acts, how the arm stops and starts again, and that it
never jumps.
"""

import numpy as np
import pytest
from fake_robot_helpers import Q0, Connection
from hypothesis import given, settings
from hypothesis import strategies as st

from redres_ros.errors import JointNamesError
from redres_ros.fake_robot.plant import IdealPlant, MujocoPlant
from redres_ros.fake_robot.robot import ClientCommand, FakeRobot
from redres_ros.fake_robot.session import SessionSettings
from redres_ros.robots import find_arm
from redres_ros.robots.joint_limits import JointLimits

T = 0.002  # [s]
ARM = find_arm('lwr4')
LIMITS = JointLimits.of(ARM)
ROUNDING = 1e-12  # [rad]
SPEED = 0.3 * np.array([1, -1, 1, -1, 1, 1, -1])  # [rad/s]


def make_robot(ideal: bool = True, monitor_time: float = 0.0) -> FakeRobot:
    plant = IdealPlant(LIMITS.joint_names, T, Q0) if ideal else MujocoPlant(ARM, T, Q0)
    return FakeRobot(plant, LIMITS, SessionSettings(monitor_time=monitor_time))


def cruise(tick: int, velocity: np.ndarray = SPEED) -> np.ndarray:
    """Command for the state of a tick: from rest at Q0 up to a velocity within 100 cycles, then on
    with it.
    """
    ramp = np.minimum(np.arange(max(tick, 0) + 1) / 100.0, 1.0).sum()
    return Q0 + T * velocity * ramp


def run(robot: FakeRobot, cycles: int, velocity: np.ndarray = SPEED, late: int = 0) -> FakeRobot:
    """Advance with commands that follow the cruise."""
    for _ in range(cycles):
        tick = robot.tick - 1 - late
        robot.advance(*([ClientCommand(tick, cruise(tick, velocity))] if tick >= 0 else []))
    return robot


def rest(robot: FakeRobot, cycles: int = 1000) -> np.ndarray:
    """References (N, 7) while nobody commands."""
    references = [robot.reference]
    for _ in range(cycles):
        robot.advance()
        references.append(robot.reference)
    return np.array(references)


def assert_accelerations_are_kept(references: list[np.ndarray] | np.ndarray) -> None:
    changes = np.abs(np.diff(references, 2, axis=0))
    assert (changes <= LIMITS.acceleration * T * T + ROUNDING).all()


def test_a_command_to_one_state_is_where_an_ideal_arm_is_two_ticks_later():
    robot = make_robot()
    for k in range(300):
        assert (robot.plant.q == (cruise(k - 2) if k >= 2 else Q0)).all()
        run(robot, 1)
    assert robot.session.timing.counts['in time'] == 299  # at tick 0 nobody can have responded


def test_of_several_commands_the_newest_counts():
    robot = run(make_robot(), 200)
    robot.advance()
    tick = robot.tick - 1
    robot.advance(ClientCommand(tick - 1, cruise(tick - 1)), ClientCommand(tick, cruise(tick)))
    assert robot.reference == pytest.approx(cruise(tick), abs=ROUNDING)
    counts = robot.session.timing.counts
    assert (counts['in time'], counts['late']) == (200, 0)


@pytest.mark.parametrize('ideal', [True, False])
def test_an_arm_that_mirrors_its_measured_position_is_let_in_after_the_monitor_time(ideal):
    robot = make_robot(ideal, monitor_time=0.1)
    commands: list[ClientCommand] = []
    while not robot.session.commanding and robot.tick < 100:
        mirrored = ClientCommand(robot.tick, robot.plant.q)
        robot.advance(*commands)
        commands = [mirrored]
        assert robot.reference == pytest.approx(Q0, abs=1e-9)
    assert robot.tick == 51  # 50 commands, the first of them at tick 1


def test_a_first_command_nearby_is_reached_without_a_jump():
    robot = make_robot()
    goal = Q0 + 0.009 * np.array([1, -1, 1, -1, 1, -1, 1])
    references = [robot.reference, robot.reference]
    for tick in range(200):
        robot.advance(*([ClientCommand(tick - 1, goal)] if tick else []))
        references.append(robot.reference)
    assert robot.session.commanding
    assert (robot.reference == goal).all()
    assert_accelerations_are_kept(references)


def test_a_first_command_too_far_away_moves_nothing():
    robot = make_robot()
    robot.advance()
    for tick in range(10):
        robot.advance(ClientCommand(tick, Q0 + 0.011))
    assert robot.session.reason.startswith('interpolation error')
    assert (robot.plant.q == Q0).all()


def test_the_first_command_follows_a_standstill_whatever_was_mirrored_before():
    robot = make_robot(monitor_time=0.02)
    robot.advance()
    for tick in range(10):
        robot.advance(ClientCommand(tick, Q0 + 0.0005 * tick))
    assert robot.session.commanding
    assert (rest(robot, 5) <= Q0 + 0.0045 + ROUNDING).all()


@pytest.mark.parametrize('misses', [1, 5])
def test_misses_are_bridged_with_the_last_velocity(misses):
    robot = run(make_robot(), 200)
    for _ in range(misses):
        robot.advance()
        assert robot.reference == pytest.approx(cruise(robot.tick - 2), abs=ROUNDING)
    run(robot, 50)
    assert (robot.plant.q == cruise(robot.tick - 2)).all()
    assert robot.session.timing.counts['bridged'] == misses


def test_after_a_lost_state_the_velocity_is_that_per_tick():
    robot = run(make_robot(), 200)
    for _ in range(5):
        robot.advance()
        run(robot, 1)
        robot.advance()
        assert robot.reference == pytest.approx(cruise(robot.tick - 2), abs=ROUNDING)
        run(robot, 10)


@pytest.mark.parametrize('lateness', [1, 5])
def test_a_late_command_is_brought_up_to_date(lateness):
    robot = run(make_robot(), 200)
    for _ in range(lateness):
        robot.advance()
    for _ in range(35):  # a few more and the connection would be UNACCEPTABLE
        run(robot, 1, late=lateness)
        assert robot.reference == pytest.approx(cruise(robot.tick - 2), abs=ROUNDING)
    assert robot.session.commanding
    assert robot.session.timing.counts['late'] == 35


def test_commands_that_get_lost_or_out_of_order_on_their_way_do_no_harm():
    robot = make_robot()
    connection = Connection(robot)
    connection.receiver.network.set_faults(loss=0.015, disorder=0.02)
    references = []
    for tick in range(5000):
        connection.advance()
        connection.send(tick, Q0 + 0.1 * (1.0 - np.cos(0.01 * max(tick - 200, 0))))
        references.append(robot.reference)
    assert (robot.session.commanding, robot.session.reason) == (True, '')
    assert robot.session.timing.counts['bridged'] > 50
    assert robot.session.refusals.keys() == {'out of order'}
    assert_accelerations_are_kept(references)


def test_one_miss_too_many_stops_the_arm_within_its_acceleration_limits():
    robot = run(make_robot(), 200)
    references = rest(robot)
    assert robot.session.reason == 'timing: the newest command is 6 cycles late, 5 are bridged'
    assert (references[-1] == references[-2]).all()
    assert_accelerations_are_kept(references)


def test_too_high_an_acceleration_ends_in_a_protective_stop():
    robot = run(make_robot(), 200)
    before = robot.reference
    jump = 0.01 * np.eye(7)[4]  # 5 rad/s more, in one cycle
    robot.advance(ClientCommand(robot.tick - 1, cruise(robot.tick - 1) + jump))
    reason = 'protective stop: lwr_a4_joint commanded 250 rad/s^2 over 20 ms, allowed 43.6'
    assert robot.session.reason == reason
    moved = (rest(robot)[-1] - before) * np.sign(SPEED)
    assert (np.abs(moved - SPEED**2 / (2.0 * LIMITS.acceleration)) <= np.abs(SPEED) * T).all()


def test_after_a_stop_commands_move_nothing_until_a_reset_begins_anew_where_the_arm_is():
    robot = run(make_robot(), 200)
    held = rest(robot)[-1]
    run(robot, 100)
    assert (robot.plant.q == held).all()
    assert robot.session.reason.startswith('timing')
    robot.session.reset()
    for _ in range(200):
        robot.advance(ClientCommand(robot.tick - 1, held))
    assert (robot.session.commanding, robot.session.reason) == (True, '')
    assert (robot.plant.q == held).all()


def test_an_arm_that_was_bent_when_it_stopped_is_let_in_again_where_it_stands():
    robot = run(make_robot(ideal=False), 10, 0.0 * SPEED)
    robot.plant.push(np.array([0.0, 0.0, -300.0]))
    run(robot, 100, 0.0 * SPEED)
    assert np.abs(robot.plant.q - robot.reference).max() > 0.01
    rest(robot)
    robot.session.reset()
    for _ in range(100):
        robot.advance(ClientCommand(robot.tick - 1, robot.plant.q))
    assert (robot.session.commanding, robot.session.reason) == (True, '')


def test_reset_in_motion_brakes_and_lets_nobody_in_before_standstill():
    robot = run(make_robot(), 200, 3.0 * SPEED)
    robot.session.reset()
    references = [robot.reference]
    while not robot.session.commanding and robot.tick < 300:
        robot.advance(ClientCommand(robot.tick - 1, robot.reference))
        references.append(robot.reference)
    assert (robot.session.commanding, robot.session.reason) == (True, '')
    assert len(references) > 0.9 / (LIMITS.acceleration[0] * T)
    assert_accelerations_are_kept(references)


EVENTS = st.one_of(
    st.tuples(st.just('in time'), st.floats(-1.5, 1.5)),
    st.tuples(st.just('late'), st.integers(1, 8)),
    st.tuples(st.just('miss'), st.integers(1, 8)),
    st.tuples(st.just('reset'), st.none()),
    st.tuples(st.just('nan'), st.none()),
    st.tuples(st.just('jump'), st.floats(-1.0, 1.0)),
)


@settings(max_examples=60)
@given(st.lists(EVENTS, max_size=40), st.integers(0, 2**32 - 1))
def test_whatever_the_client_does_the_reference_keeps_velocity_and_position_limits(events, seed):
    robot = make_robot()
    connection = Connection(robot)
    random = np.random.default_rng(seed)
    command = Q0
    references = [robot.reference]

    def advance(cycles: int = 1) -> None:
        for _ in range(cycles):
            connection.advance()
            references.append(robot.reference)

    advance()
    for kind, value in events:
        if kind == 'reset':
            robot.session.reset()
            command = robot.reference
        elif kind == 'miss':
            advance(value)
        elif kind == 'jump':
            command = command + value * random.uniform(-1.0, 1.0, 7)
        elif kind == 'in time':
            for _ in range(10):
                command = command + T * value * LIMITS.velocity * random.uniform(0.5, 1.0, 7)
                connection.send(robot.tick - 1, command)
                advance()
        else:
            late = value or 0
            connection.send(robot.tick - 1 - late, command if late else np.full(7, np.nan))
            advance()
    assert (np.abs(np.diff(references, axis=0)) <= LIMITS.velocity * T + ROUNDING).all()
    assert (np.abs(references) <= LIMITS.upper).all()


@pytest.mark.parametrize('ideal', [True, False])
def test_what_the_robot_shows_is_not_overwritten(ideal):
    robot = run(make_robot(ideal), 10)
    shown = [robot.reference, robot.plant.q, robot.plant.dq]
    before = np.array(shown)
    run(robot, 10)
    assert (np.array(shown) == before).all()


def test_limits_of_another_arm_do_not_make_a_robot():
    with pytest.raises(JointNamesError):
        FakeRobot(IdealPlant(LIMITS.joint_names[::-1], T, Q0), LIMITS)
