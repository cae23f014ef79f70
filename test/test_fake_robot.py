"""The fake robot as a whole: when a command acts, how the arm stops and starts again, and that it
never jumps.
"""

import numpy as np
import pytest
from fake_robot_helpers import Door
from hypothesis import given, settings
from hypothesis import strategies as st

from redres_ros.errors import JointNamesError, RedresError
from redres_ros.fake_robot.command_validator import CommandValidator
from redres_ros.fake_robot.plant import IdealPlant, MujocoPlant
from redres_ros.fake_robot.robot import ClientCommand, FakeRobot
from redres_ros.fake_robot.session import Session, SessionSettings
from redres_ros.robots import find_arm
from redres_ros.robots.joint_limits import JointLimits

T = 0.002  # [s]
ARM = find_arm('lwr4')
LIMITS = JointLimits.of(ARM)
Q0 = np.radians((28.08, 104.12, 114.59, 94.85, 14.32, -28.12, 0.0))
ROUNDING = 1e-12  # [rad]
SPEED = 0.3 * np.array([1, -1, 1, -1, 1, 1, -1])  # [rad/s]


def make_robot(ideal: bool = True, q0: np.ndarray = Q0, **session_settings: float) -> FakeRobot:
    plant = IdealPlant(LIMITS.joint_names, T, q0) if ideal else MujocoPlant(ARM, T, q0)
    return FakeRobot(
        plant, CommandValidator(LIMITS, T), Session(T, SessionSettings(**session_settings))
    )


def cruise(tick: int, velocity: np.ndarray = SPEED, since: int = 0) -> np.ndarray:
    """Command for the state of a tick: from rest at Q0 up to a velocity within 100 cycles, then on
    with it.
    """
    ramp = np.minimum(np.arange(max(tick - since, 0) + 1) / 100.0, 1.0).sum()
    return Q0 + T * velocity * ramp


def command(robot: FakeRobot, **kwargs: np.ndarray) -> ClientCommand:
    """What a client that responds in time has to say at this tick."""
    return ClientCommand(robot.tick - 1, cruise(robot.tick - 1, **kwargs))


def run(robot: FakeRobot, cycles: int, **kwargs: np.ndarray) -> FakeRobot:
    for _ in range(cycles):
        robot.advance(command(robot, **kwargs) if robot.tick else None)
    return robot


def rest(robot: FakeRobot, cycles: int = 1000) -> np.ndarray:
    """References (N, 7), from two cycles before, while nobody commands."""
    references = [robot.reference]
    for _ in range(cycles):
        robot.advance(None)
        references.append(robot.reference)
    return np.array(references)


# --- when a command acts --------------------------------------------------------------------------


def test_a_command_to_one_state_is_where_an_ideal_arm_is_two_ticks_later():
    robot = make_robot(monitor_time=0.0)
    positions = []
    for _ in range(300):
        positions.append(robot.q)
        robot.advance(command(robot) if robot.tick else None)
    assert (positions[1] == Q0).all()
    for k in range(2, 300):
        assert (positions[k] == cruise(k - 2)).all()


def test_before_command_mode_the_arm_holds_its_position():
    robot = make_robot(monitor_time=0.5)
    robot.advance(None)
    for _ in range(249):
        robot.advance(ClientCommand(robot.tick - 1, Q0 + 0.005))
        assert (robot.q == Q0).all()
    assert not robot.session.commanding


def test_at_tick_zero_nobody_can_have_responded():
    robot = make_robot()
    robot.advance(None)
    assert robot.session.counts.cycles == 0


def test_of_several_commands_the_newest_counts():
    robot = run(make_robot(monitor_time=0.0), 200)
    alone = run(make_robot(monitor_time=0.0), 200)
    alone.advance(None)
    robot.advance(None)
    alone.advance(command(alone))
    robot.advance(ClientCommand(robot.tick - 2, cruise(robot.tick - 2)), command(robot))
    assert robot.reference == pytest.approx(alone.reference, abs=ROUNDING)
    assert (robot.session.counts.in_time, robot.session.counts.late) == (200, 0)


# --- entering command mode ------------------------------------------------------------------------


def test_a_first_command_nearby_is_reached_without_a_jump():
    robot = make_robot(monitor_time=0.0)
    gap = 0.009 * np.array([1, -1, 1, -1, 1, -1, 1])
    references = [robot.reference, robot.reference]
    for _ in range(200):
        robot.advance(ClientCommand(robot.tick - 1, Q0 + gap) if robot.tick else None)
        references.append(robot.reference)
    assert robot.session.commanding
    assert (robot.reference == Q0 + gap).all()
    assert (np.abs(np.diff(references, 2, axis=0)) <= LIMITS.acceleration * T * T + ROUNDING).all()


def test_a_first_command_too_far_away_moves_nothing():
    robot = make_robot(monitor_time=0.0)
    robot.advance(None)
    for _ in range(10):
        robot.advance(ClientCommand(robot.tick - 1, Q0 + 0.011))
    assert robot.session.reason.startswith('interpolation error')
    assert (robot.q == Q0).all()


def test_the_first_command_follows_a_standstill_whatever_was_mirrored_before():
    robot = make_robot(monitor_time=0.02)
    robot.advance(None)
    for tick in range(10):
        robot.advance(ClientCommand(tick, Q0 + 0.0005 * tick))
    assert robot.session.commanding
    for _ in range(5):
        robot.advance(None)
        assert (robot.reference <= Q0 + 0.0045 + ROUNDING).all()


@pytest.mark.parametrize('ideal', [True, False])
def test_an_arm_that_mirrors_its_measured_position_is_let_in(ideal):
    robot = make_robot(ideal, monitor_time=0.1)
    previous = None
    while not robot.session.commanding and robot.tick < 100:
        mirrored = ClientCommand(robot.tick, robot.q)
        robot.advance(previous)
        previous = mirrored
    assert robot.tick == 51  # 50 commands, the first of them at tick 1
    assert robot.reference == pytest.approx(Q0, abs=1e-9)


# --- missing and late commands --------------------------------------------------------------------


@pytest.mark.parametrize('misses', [1, 5])
def test_misses_are_bridged_with_the_last_velocity(misses):
    robot = run(make_robot(monitor_time=0.0), 200)
    for _ in range(misses):
        robot.advance(None)
        assert robot.reference == pytest.approx(cruise(robot.tick - 2), abs=ROUNDING)
    run(robot, 50)
    assert (robot.q == cruise(robot.tick - 2)).all()
    assert (robot.session.counts.bridged, robot.session.counts.longest_run) == (misses, misses)


def test_after_a_lost_state_the_velocity_is_that_per_tick():
    robot = run(make_robot(monitor_time=0.0), 200)
    for _ in range(5):
        robot.advance(None)
        run(robot, 1)
        robot.advance(None)
        assert robot.reference == pytest.approx(cruise(robot.tick - 2), abs=ROUNDING)
        run(robot, 10)


@pytest.mark.parametrize('lateness', [1, 5])
def test_a_late_command_is_brought_up_to_date(lateness):
    robot = run(make_robot(monitor_time=0.0), 200)
    for _ in range(lateness):
        robot.advance(None)
    for _ in range(35):  # a few more and the connection would be UNACCEPTABLE
        robot.advance(ClientCommand(robot.tick - 1 - lateness, cruise(robot.tick - 1 - lateness)))
        assert robot.reference == pytest.approx(cruise(robot.tick - 2), abs=ROUNDING)
    assert robot.session.commanding
    assert robot.session.counts.late == 35


def test_one_miss_too_many_stops_the_arm_within_its_acceleration_limits():
    robot = run(make_robot(monitor_time=0.0), 200)
    references = rest(robot)
    assert robot.session.reason == 'timing: the newest command is 6 cycles late, 5 are bridged'
    assert (references[-1] == references[-2]).all()
    assert (np.abs(np.diff(references, 2, axis=0)) <= LIMITS.acceleration * T * T + ROUNDING).all()


def test_counts_add_up():
    robot = run(make_robot(monitor_time=0.0), 200)
    robot.advance(None)
    robot.advance(ClientCommand(robot.tick - 2, cruise(robot.tick - 2)))
    run(robot, 10)
    counts = robot.session.counts
    assert (counts.cycles, counts.in_time, counts.late, counts.missed) == (211, 209, 1, 1)
    assert (counts.longest_run, counts.bridged, counts.refused) == (2, 2, 0)


# --- limits ---------------------------------------------------------------------------------------


def test_too_high_an_acceleration_ends_in_a_protective_stop():
    robot = run(make_robot(monitor_time=0.0), 200)
    before = robot.reference
    robot.advance(
        ClientCommand(robot.tick - 1, cruise(robot.tick - 1) + 0.01 * np.eye(7)[4])
    )  # 5 rad/s more, in one cycle
    assert (
        robot.session.reason
        == 'protective stop: lwr_a4_joint commanded 250 rad/s^2 over 20 ms, allowed 43.6'
    )
    way = (rest(robot)[-1] - before) * np.sign(SPEED)
    assert (np.abs(way - SPEED**2 / (2.0 * LIMITS.acceleration)) <= np.abs(SPEED) * T).all()


def test_too_high_a_velocity_is_limited_and_not_stopped():
    robot = make_robot(monitor_time=0.0)
    fast = 1.2 * LIMITS.velocity[0] * np.eye(7)[0]
    steps = []
    for _ in range(350):
        before = robot.reference
        robot.advance(command(robot, velocity=fast) if robot.tick else None)
        steps.append(robot.reference - before)
    assert robot.session.commanding
    assert np.max(steps, axis=0)[0] == pytest.approx(LIMITS.velocity[0] * T, abs=ROUNDING)
    assert robot.reference[0] < cruise(348, fast)[0] - 0.1


@pytest.mark.parametrize(('joint', 'speed'), [(1, 0.3), (1, 1.5), (5, 3.0)])
def test_an_arm_that_runs_at_a_position_limit_stops_before_it(joint, speed):
    robot = make_robot(monitor_time=0.0)
    toward = speed * np.eye(7)[joint]
    for _ in range(3000):
        robot.advance(command(robot, velocity=toward) if robot.tick else None)
        assert robot.q[joint] <= LIMITS.upper[joint]
    assert robot.session.reason.startswith(f'position limit: {LIMITS.joint_names[joint]}')
    assert robot.q[joint] == pytest.approx(LIMITS.upper[joint], abs=np.radians(1.0))


# --- after a stop ---------------------------------------------------------------------------------


def test_after_a_stop_commands_move_nothing_until_reset():
    robot = run(make_robot(monitor_time=0.0), 200)
    held = rest(robot)[-1]
    run(robot, 100)
    assert (robot.q == held).all()
    assert robot.session.reason.startswith('timing')


def test_reset_begins_anew_where_the_arm_stands():
    robot = run(make_robot(monitor_time=0.1), 300, since=50)
    held = rest(robot)[-1]
    robot.reset()
    assert robot.session.reason == ''
    for _ in range(200):
        robot.advance(ClientCommand(robot.tick - 1, held))
    assert robot.session.commanding
    assert (robot.q == held).all()


def test_reset_in_motion_brakes_and_lets_nobody_in_before_standstill():
    robot = run(make_robot(monitor_time=0.0), 200, velocity=3.0 * SPEED)
    robot.reset()
    references = [robot.reference]
    while not robot.session.commanding and robot.tick < 300:
        robot.advance(ClientCommand(robot.tick - 1, robot.reference))
        references.append(robot.reference)
    assert (robot.session.commanding, robot.session.reason) == (True, '')
    assert len(references) > 0.9 / (LIMITS.acceleration[0] * T)
    assert (np.abs(np.diff(references, 2, axis=0)) <= LIMITS.acceleration * T * T + ROUNDING).all()


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
    robot = make_robot(monitor_time=0.0)
    door = Door(robot)
    random = np.random.default_rng(seed)
    command = Q0
    references = [robot.reference]

    def advance() -> None:
        door.advance()
        references.append(robot.reference)

    advance()
    for kind, value in events:
        if kind == 'reset':
            robot.reset()
            command = robot.reference
        elif kind == 'nan':
            door.send(robot.tick - 1, np.full(7, np.nan))
            advance()
        elif kind == 'miss':
            for _ in range(value):
                advance()
        elif kind == 'late':
            door.send(robot.tick - 1 - value, command)
            advance()
        elif kind == 'jump':
            command = command + value * random.uniform(-1.0, 1.0, 7)
        else:
            for _ in range(10):
                command = command + T * value * LIMITS.velocity * random.uniform(0.5, 1.0, 7)
                door.send(robot.tick - 1, command)
                advance()
    assert (np.abs(np.diff(references, axis=0)) <= LIMITS.velocity * T + ROUNDING).all()
    assert (np.abs(references) <= LIMITS.upper).all()


def test_the_reference_in_hand_is_a_copy():
    robot = run(make_robot(monitor_time=0.0), 10)
    robot.reference[:] = 9.0
    robot.q[:] = 9.0
    run(robot, 1)
    assert (robot.q == cruise(robot.tick - 2)).all()


# --- construction ---------------------------------------------------------------------------------


def test_parts_of_different_cycles_do_not_make_a_robot():
    plant = IdealPlant(LIMITS.joint_names, T, Q0)
    with pytest.raises(RedresError, match=r'0\.002, 0\.001'):
        FakeRobot(plant, CommandValidator(LIMITS, 0.001), Session(T))


def test_parts_of_different_arms_do_not_make_a_robot():
    plant = IdealPlant(LIMITS.joint_names[::-1], T, Q0)
    with pytest.raises(JointNamesError):
        FakeRobot(plant, CommandValidator(LIMITS, T), Session(T))
