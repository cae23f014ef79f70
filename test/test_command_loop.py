"""What stands between the ticks of the controller, tried without ROS."""

import contextlib
import sys
from collections.abc import Callable
from types import FrameType
from typing import Any
from unittest.mock import Mock

import numpy as np
import pytest

from redres_ros import Controller, RobotModel, load_task, make_law
from redres_ros.command import RobotInterface
from redres_ros.errors import ArrayError, RedresError
from redres_ros.geometry import quintic
from redres_ros.loop.command_loop import CommandLoop, Response
from redres_ros.loop.cycle_counter import ClockError
from redres_ros.loop.holding import HeldReference
from redres_ros.loop.modes import Mode
from redres_ros.loop.velocity_input import LoopSettings, VelocityError
from redres_ros.robots import find_arm

T = 0.002  # [s]
NS = 2_000_000  # [ns]
EPOCH = 1_700_000_000 * 10**9  # [ns]
START = load_task('rectangle').start
MOST_CALLS = 35  # of Python, from a state to its command
MOST_FILES = 12
GENTLE = np.array((0.0, -0.003, 0.0))  # [m/s] reached in one cycle
Interface = str | RobotInterface
JOINT_LIMITS = ('position', 'velocity', 'acceleration')


def make_controller(switch_time: float = 0.1, interface: Interface = 'fri') -> Controller:
    model = RobotModel.named('lwr4_paper')
    options = {'switch_time': switch_time, 'robot_interface': interface}
    return Controller(model, 'minimum_acceleration', T, **options)


def velocity(cycle: int) -> np.ndarray:
    """To the side and back, (3,) [m/s]."""
    return np.array((0.0, -0.4, 0.0)) * quintic(cycle * T / 2.0)[1] / 2.0


class Robot:
    """An ideal arm, and a source of task velocities, at one cycle after the other."""

    def __init__(self, following: CommandLoop, start: np.ndarray = START) -> None:
        self.following = following
        self.q = start
        self.cycle = 0
        self.references: list[np.ndarray] = []
        self.cycles: list[int] = []  # of the references

    @property
    def stamp(self) -> int:
        return EPOCH + self.cycle * NS

    @property
    def now(self) -> float:
        return self.cycle * T

    def ask(self, stamp: int | None = None) -> Response | None:
        """The response to the next state."""
        self.cycle += 1
        at = self.stamp if stamp is None else stamp
        return self.take(self.following.step(at, self.q, self.now))

    def steer(self, dx: np.ndarray, stamp: int | None = None) -> Response | None:
        """Give a task velocity, of the newest state by default."""
        at = self.stamp if stamp is None else stamp
        return self.take(self.following.enter_velocity(at, dx, self.now + 3e-4))

    def take(self, response: Response | None) -> Response | None:
        if response is not None:
            self.q = response.command.q_ref
            self.references.append(self.q)
            self.cycles.append(self.cycle)
        return response

    def follow(self, cycles: int, source: Callable[[int], np.ndarray] = velocity) -> None:
        """State and task velocity, for some cycles."""
        for _ in range(cycles):
            self.ask()
            self.steer(source(self.cycle))


def make(switch_time: float = 0.1, interface: Interface = 'fri', **settings: Any) -> Robot:
    return Robot(CommandLoop(make_controller(switch_time, interface), LoopSettings(**settings)))


def at_speed(**settings: Any) -> Robot:
    """A robot under way, with nothing waiting."""
    robot = make(switch_time=0.0, **settings)
    robot.follow(500)
    return robot


def limited(switch_time: float = 0.1, interface: Interface = 'fri', scale: float = 1.0) -> Robot:
    """A robot whose controller has limits on."""
    controller = make_controller(switch_time, interface)
    controller.set_limits(JOINT_LIMITS, limit_scale=scale)
    return Robot(CommandLoop(controller))


def assert_gentle(robot: Robot, *, holds: bool = False, scale: float = 1.0) -> None:
    """All references since the start keep V and A, for a robot that extrapolates, or holds."""
    model = RobotModel.named('lwr4_paper')
    A = scale * np.array(model.arm.acceleration_limit)
    v = np.zeros(model.n)
    for k in range(1, len(robot.references)):
        missed = robot.cycles[k] - robot.cycles[k - 1] - 1
        if missed and holds:
            v = np.zeros(model.n)
        p = robot.references[k - 1] + missed * T * v
        dq = (robot.references[k] - p) / T
        assert (np.abs(dq) <= model.dq_max * (1.0 + 1e-9)).all()
        assert (np.abs(dq - v) <= A * T + 1e-9).all()
        v = dq


def speed(response: Response | None) -> float:
    return float(np.linalg.norm(response.command.dq))


@pytest.mark.parametrize('lag', [1, 2, 5])
def test_the_loop_is_that_of_the_controller_with_task_velocities_some_cycles_late(lag: int) -> None:
    robot = make(twist_lag=lag)
    robot.follow(800)
    controller = make_controller()
    q = START
    for cycle in range(1, 801):
        if cycle <= lag:  # nothing asks for motion yet
            controller.hold()
            dx = np.zeros(3)
        else:
            controller.resume()
            dx = velocity(cycle - lag)
        q = controller.update(q, dx).q_ref
        np.testing.assert_array_equal(q, robot.references[cycle - 1])


def test_in_lock_step_each_state_is_commanded_with_its_own_task_velocity() -> None:
    robot = make(lockstep=True)
    controller = make_controller()
    q = START
    for cycle in range(1, 500):
        assert robot.ask() is None
        assert robot.take(robot.following.step(robot.stamp, robot.q, robot.now)) is None
        robot.steer(velocity(cycle))
        q = controller.update(q, velocity(cycle)).q_ref
        np.testing.assert_array_equal(q, robot.q)


def test_jitter_drift_and_a_clock_that_is_set_leave_every_reference_as_it_is() -> None:
    perfect = make()
    perfect.follow(900)
    robot = make()
    random = np.random.default_rng(3)
    stamps = []
    responses = []
    for cycle in range(1, 901):
        drifted = cycle * 1.005
        set_by = 0.3 if cycle > 450 else 0.0  # [s]
        jitter = random.uniform(-0.45, 0.45)
        stamps.append(EPOCH + round((drifted + jitter) * NS + set_by * 1e9))
        responses.append(robot.ask(stamps[-1]) is not None)
        robot.steer(velocity(cycle), stamps[-1])
    assert all(responses)
    np.testing.assert_array_equal(robot.references, perfect.references)


def test_a_joint_of_more_than_a_turn_is_followed_over_its_end() -> None:
    references = []
    for wraps in (False, True):
        model = RobotModel.named('gen3')
        controller = Controller(model, make_law('minimum_velocity'), T, task='pose')
        following = CommandLoop(controller, LoopSettings(max_angular=10.0))
        start = np.array((*find_arm('gen3').start[:6], 0.5 - np.pi))
        robot = Robot(following, start)
        spin = np.zeros(6)
        for _ in range(1500):
            reported = robot.q
            if wraps:  # the same angles between -pi and pi
                reported = (robot.q + np.pi) % (2.0 * np.pi) - np.pi
            robot.cycle += 1
            robot.take(following.step(robot.stamp, reported, robot.now))
            spin[3:] = 0.5 * model.tip(robot.q)[1][:, 2]  # about the last joint's axis
            robot.steer(spin)
        references.append(robot.references)
        assert robot.q[6] < -np.pi - 0.5
    np.testing.assert_allclose(references[1], references[0], rtol=0.0, atol=1e-9)


@pytest.mark.parametrize('of_joints', [False, True])
@pytest.mark.parametrize('every', [1, 10])
def test_a_second_source_of_velocities_makes_no_jump_of_the_reference(every, of_joints):
    """A planner, and 0.3 s later somebody with a joystick who wants to go the other way."""
    robot = limited(switch_time=0.0)
    following = robot.following
    for cycle in range(1000):
        robot.ask()
        robot.steer(np.array((0.0, -0.4, 0.0)))
        if cycle * T < 0.3 or cycle % every:
            continue
        dx = np.full(7, 0.5) if of_joints else np.array((0.0, 0.4, 0.3))
        robot.take(following.enter_velocity(0, dx, robot.now + 6e-4, of_joints=of_joints))
    assert_gentle(robot)
    assert following.safety_filter.count == 0
    assert following.error == ''


@pytest.mark.parametrize('word', ['CMD', 'MON'])
def test_a_state_that_is_not_finite_is_refused_and_changes_nothing(word: str) -> None:
    robot = make()
    robot.following.enter_session(word)
    robot.ask()
    before = robot.q
    with pytest.raises(ArrayError, match='must be finite'):
        robot.following.step(robot.stamp + NS, np.full(7, np.nan), robot.now + T)
    robot.ask()
    assert (robot.q == before).all()


def test_the_same_state_again_gets_the_same_response_and_another_one_with_its_stamp_none() -> None:
    robot = at_speed()
    response = robot.ask()
    assert robot.following.step(robot.stamp, robot.following.q, robot.now) is response
    with pytest.raises(ClockError, match='other positions'):
        robot.following.step(robot.stamp, START + 0.1, robot.now)


def test_a_state_after_a_stray_that_took_its_cycle_gets_the_same_command() -> None:
    robot = at_speed()
    stray = robot.ask(robot.stamp + NS // 2)
    response = robot.following.step(robot.stamp, robot.q, robot.now)
    assert (response.stamp, response.command) == (robot.stamp, stray.command)


@pytest.mark.parametrize('moved', [False, True])
def test_after_a_long_gap_the_controller_begins_anew_and_says_why(moved: bool) -> None:
    robot = at_speed(interface='ros2_control' if moved else 'fri')
    pushed = robot.q - 0.03
    for _ in range(20 * moved):  # others move the arm, and its reference comes after it
        robot.q = pushed
        robot.ask()
    robot.cycle += 100
    assert robot.ask() is not None
    assert 'no state came in 100 cycles, allowed 5' in robot.following.warning
    robot.ask()
    assert robot.following.warning == ''
    robot.following.hold(False)
    robot.follow(200)
    assert robot.following.mode is Mode.MOVING


def test_an_arm_that_is_held_goes_on_from_its_reference_after_a_gap_however_far_it_sags() -> None:
    robot = at_speed(interface='ros2_control')
    reference = robot.q
    robot.cycle += 50
    robot.q = reference - 0.01  # [rad] more than any joint may move in a cycle
    response = robot.ask()
    assert 'from the last reference' in robot.following.warning
    assert np.abs(response.command.q_ref - reference).max() < 1e-4
    assert speed(response) < 0.05  # and at rest


@pytest.mark.parametrize(
    ('interface', 'held', 'away', 'same'),
    [
        ('ros2_control', False, 0.003, True),
        ('ros2_control', True, 0.01, False),
        ('fri', True, 0.01, True),
    ],
)
def test_after_seconds_of_silence_a_reference_stays_if_a_servo_explains_where_the_arm_is(
    interface: str, held: bool, away: float, same: bool
) -> None:
    robot = at_speed(interface=interface)
    robot.following.hold(held)
    robot.follow(300 if held else 1)
    reference = robot.q
    robot.cycle += round(1.5 / T)
    robot.q = reference - away
    response = robot.ask()
    expected = reference if same else reference - away
    np.testing.assert_array_equal(response.command.q_ref, expected)


@pytest.mark.parametrize('sag', [0.004, 0.03, 0.09])  # [rad]
@pytest.mark.parametrize('moves', [False, True])
def test_an_arm_that_sags_under_its_reference_does_not_creep(sag: float, moves: bool) -> None:
    robot = limited(interface='ros2_control')
    q = START
    held = []
    for cycle in range(5000):
        robot.q = q
        robot.ask()
        if moves and cycle < 1000:
            robot.steer(velocity(cycle))
        if cycle > (500 if moves else 1000) and robot.following.mode is Mode.HOLDING:
            held.append(robot.references[-1])
        q = q + 0.1 * (robot.references[-1] - sag - q)  # a servo
    assert len(held) > 3900
    np.testing.assert_array_equal(held, [held[0]] * len(held))
    if not moves:
        assert np.abs(q - START).max() < 2.1 * sag


@pytest.mark.parametrize(('noise', 'problem'), [(0.01, 'do not come to rest'), (1e-4, '')])
def test_that_an_arm_does_not_come_to_rest_is_reported(noise: float, problem: str) -> None:
    robot = limited(interface='ros2_control')
    random = np.random.default_rng(1)
    for _ in range(1000):
        robot.q = START + noise * random.normal(size=7)
        robot.ask()
    assert problem in robot.following.error
    assert bool(problem) == bool(robot.following.error)


def test_an_error_in_a_catch_up_ends_like_any_other(monkeypatch: pytest.MonkeyPatch) -> None:
    robot = at_speed(interface='ros2_control')
    impossible = Mock(side_effect=RedresError('no velocity leads there'))
    monkeypatch.setattr(HeldReference, 'catch_up', impossible)
    pushed = robot.q - 0.03
    for _ in range(300):
        robot.q = pushed
        robot.ask()
    assert impossible.called
    robot.following.hold(False)
    robot.follow(200)
    assert robot.following.mode is Mode.MOVING


def test_an_arm_that_sags_elsewhere_than_where_it_rested_is_not_placed_anew() -> None:
    robot = limited(interface='ros2_control')
    q = START
    rests: list[list[np.ndarray]] = [[], [], [], []]
    for cycle in range(7000):
        robot.q = q
        robot.ask()
        stage = cycle // 1000  # it rests, moves away, rests, moves back, ...
        if stage % 2:
            robot.steer(velocity(cycle % 1000) * (2 - stage % 4))
        elif robot.following.mode is Mode.HOLDING:
            rests[stage // 2].append(robot.references[-1])
        q = q + 0.1 * (0.05 * START + 0.95 * robot.references[-1] - q)  # a servo
    assert not any(np.diff(rest, axis=0).any() for rest in rests)


def test_an_arm_that_is_pushed_and_let_go_comes_back_to_its_reference() -> None:
    robot = make()
    robot.ask()
    held = robot.q
    for push in np.linspace(0.0, 0.3, 500).tolist() + [0.3] * 500 + [0.0]:
        robot.q = held + push
        robot.ask()
        np.testing.assert_array_equal(robot.references[-1], held)


@pytest.mark.parametrize('before_the_gap', range(100, 400, 100))
def test_a_robot_that_goes_on_by_itself_in_a_gap_does_not_leave_its_range(before_the_gap):
    longest = 20  # cycles
    robot = limited(interface=RobotInterface('velocity', restart_after=longest))
    model = RobotModel.named('lwr4_paper')
    to_the_ends = np.sign(START) * model.dq_max
    for cycle in range(before_the_gap + 400):
        if 0 <= cycle - before_the_gap < longest:
            robot.cycle += 1
            robot.q = robot.q + (robot.references[-1] - robot.references[-2])
        else:
            robot.ask()
            with contextlib.suppress(VelocityError):  # right after the gap
                robot.following.enter_velocity(0, to_the_ends, robot.now, of_joints=True)
        assert (robot.q <= model.q_max).all()
        assert (robot.q >= model.q_min).all()
    assert robot.following.safety_filter.count == 0
    assert robot.following.error == ''


@pytest.mark.parametrize(
    ('interface', 'held_up', 'first_counts'),
    [
        ('ros2_control', 0.95, False),  # the robot had published its next state by then
        ('ros2_control', 0.5, True),
        ('fri', 0.5, True),
    ],
)
def test_of_two_responses_in_one_cycle_of_a_robot_that_holds_the_first_does_not_count(
    interface: str, held_up: float, first_counts: bool
) -> None:
    robot = at_speed(interface=interface)
    before = robot.q
    robot.ask()
    base = robot.q if first_counts else before
    robot.following.sent = robot.now + held_up * T
    response = robot.ask()
    np.testing.assert_allclose(response.command.q_ref, base + T * response.command.dq, atol=1e-15)


def test_a_single_state_to_which_no_arm_can_have_leapt_stops_nothing() -> None:
    robot = limited()
    robot.follow(500)
    robot.q = robot.q + 0.2
    robot.follow(50)
    assert robot.following.mode is Mode.MOVING
    assert_gentle(robot)


@pytest.mark.parametrize(
    ('disturb', 'words', 'off'),
    [
        (lambda q, stuck, k: q + (-1.0) ** k, 'does another robot publish joint_states', 1.1),
        (lambda q, stuck, k: np.array((stuck[0], *q[1:])), 'does not follow: lwr_a1_joint', 0.2),
    ],
    ids=['states leap to and fro', 'a joint is blocked'],
)
def test_an_arm_that_does_not_follow_stops_within_its_limits(disturb, words, off):
    robot = limited()
    robot.follow(500)
    stuck = robot.q
    for k in range(1500):
        robot.q = disturb(robot.q, stuck, k)
        assert np.abs(robot.q - robot.references[-1]).max() < off  # [rad]
        robot.ask()
        robot.steer(velocity(robot.cycle))
    assert robot.following.mode is Mode.HOLDING
    assert words in robot.following.error
    assert_gentle(robot)


@pytest.mark.parametrize('meanwhile', ['velocity', 'other velocity', 'let go on'])
def test_an_arm_that_a_wall_pushes_back_is_not_placed_there_in_one_step(meanwhile: str) -> None:
    scale = 1.0 if meanwhile == 'velocity' else 0.05
    robot = limited(interface='ros2_control', scale=scale)
    of_joints = meanwhile == 'other velocity'
    for _ in range(500):
        robot.ask()
        dx = np.full(7, 0.02) if of_joints else velocity(robot.cycle)
        robot.following.enter_velocity(robot.stamp, dx, robot.now, of_joints=of_joints)
    pushed = robot.q.copy()
    for k in range(800):
        pushed[1] -= 0.003 * (k < 10)  # [rad]
        robot.q = pushed + 1e-4 * (-1.0) ** k  # noise of its sensors
        robot.ask()
        if meanwhile == 'let go on' and k == 40:
            robot.following.hold(False)
        if k < 60:
            robot.steer(velocity(robot.cycle), stamp=0)
    assert np.abs(robot.references[-1] - robot.q).max() < 1e-3
    assert_gentle(robot, holds=True, scale=scale)


@pytest.mark.parametrize('lets_go', [False, True])
def test_a_bent_arm_that_its_reference_approaches_does_not_count_as_stuck(lets_go: bool) -> None:
    robot = limited()
    robot.follow(500)
    robot.follow(500, lambda cycle: np.zeros(3))
    bent = robot.q - np.array((0.0, 0.15, 0.0, 0.0, 0.0, 0.0, 0.0))  # by what it presses on
    while np.abs(robot.references[-1] - bent).max() > 1e-5:
        robot.q = bent
        robot.ask()
        if not lets_go or robot.cycle not in range(1060, 1200):
            robot.steer(velocity(robot.cycle % 1000))
        assert robot.following.mode is not Mode.MIRRORING
    assert_gentle(robot)


def test_a_robot_that_executes_nothing_is_noticed_within_50_ms_and_then_mirrored() -> None:
    robot = limited()
    robot.follow(600)
    stuck = robot.q
    begun = robot.cycle
    while robot.following.mode is not Mode.MIRRORING:
        robot.ask()
        robot.q = stuck
        robot.steer(velocity(robot.cycle))
    assert (robot.cycle - begun) * T <= 0.05
    for _ in range(100):
        response = robot.ask()
        robot.q = stuck
        robot.steer(velocity(robot.cycle))
        np.testing.assert_array_equal(response.command.q_ref, stuck)
        assert response.scaling == 0.0


@pytest.mark.parametrize('jump', [10, -10])  # [s]
def test_a_clock_that_jumps_after_a_silence_makes_the_controller_begin_where_the_arm_is(jump):
    robot = make()
    robot.follow(300)
    moving = robot.q
    stamp = robot.stamp + jump * 10**9
    response = robot.following.step(stamp, moving, robot.now + 0.6)
    # At most the first share of a blend from standing still.
    np.testing.assert_allclose(response.command.q_ref, moving, rtol=0.0, atol=1e-6)
    assert speed(response) < 1e-3


@pytest.mark.parametrize('interface', ['fri', 'ros2_control'])
@pytest.mark.parametrize('jump', [-T, -2 * T, -0.02, -0.5, 3600.0])  # [s]
def test_a_clock_that_is_set_while_the_arm_moves_is_a_gap(jump: float, interface: str) -> None:
    robot = limited(interface=interface)
    source = np.array((0.0, -0.3, 0.0))
    for cycle in range(400):
        offset = round(jump * 1e9) if cycle >= 300 else 0
        with contextlib.suppress(ClockError):
            robot.ask(EPOCH + (robot.cycle + 1) * NS + offset)
        robot.steer(source, stamp=0)
        if cycle == 302:
            assert robot.cycles[-1] - robot.cycles[-3] == 3  # one state is not believed
    assert speed(robot.following.newest_response) > 0.1
    assert_gentle(robot, holds=interface == 'ros2_control')


def test_a_controller_activated_while_the_robot_waits_responds_to_the_state_it_repeats() -> None:
    robot = make()
    robot.following.deactivate()
    assert robot.ask() is None
    robot.following.activate()
    response = robot.following.step(robot.stamp, robot.q, robot.now)
    np.testing.assert_array_equal(response.command.q_ref, robot.q)


def test_a_controller_activated_again_in_motion_makes_no_step() -> None:
    robot = limited()
    robot.follow(500)
    for cycles in (0, 1, 5, 15):
        robot.following.deactivate()
        robot.follow(cycles)
        robot.following.activate()
        robot.follow(100)
    assert_gentle(robot)


def test_velocities_that_a_limit_scales_to_nothing_are_reported_with_it() -> None:
    robot = limited()
    robot.q = RobotModel.named('lwr4_paper').q_max - 0.1
    dq = np.array((0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.8))
    reported = 'no progress for 5 s: lwr_a6_joint: position'
    for pause, seconds, warning in ((0.5, 3.0, ''), (0.5, 3.0, reported), (2.1, 0.5, '')):
        for _ in range(round(pause / T)):
            robot.ask()
        for _ in range(round(seconds / T)):
            robot.ask()
            robot.take(robot.following.enter_velocity(0, dq, robot.now, of_joints=True))
        assert robot.following.warning.partition(';')[0] == warning


def test_null_space_motion_without_end_is_brought_to_rest_and_reported_until_the_next() -> None:
    period = 0.01  # [s]
    model = RobotModel.named('gen3')
    law = make_law('minimum_torque')
    loop = CommandLoop(Controller(model, law, period, limits=JOINT_LIMITS))
    q = np.array(model.arm.start) + 0.3 * np.random.default_rng(1).normal(size=model.n)
    for cycle in range(1, 810):
        if cycle == 800:
            assert loop.mode is Mode.HOLDING
            assert 'null-space motion' in loop.error
        stamp = EPOCH + cycle * round(1e9 * period)
        response = loop.step(stamp, q, cycle * period)
        q = response.command.q_ref
        dx = np.array((0.0, 0.0 if 50 <= cycle < 800 else 0.05, 0.0))  # [m/s]
        loop.enter_velocity(stamp, dx, cycle * period)
    assert loop.mode is Mode.MOVING
    assert loop.error == ''


@pytest.mark.parametrize('ahead', [0.3, 5.0, -0.3, -5.0])
def test_a_task_velocity_far_from_the_clock_of_the_robot_is_refused_and_never_acts(ahead):
    robot = make(switch_time=0.0)
    robot.follow(1, lambda _: np.zeros(3))
    side = "ahead of the robot's clock" if ahead > 0.0 else "behind the robot's clock"
    with pytest.raises(VelocityError, match=side):
        robot.steer(GENTLE, robot.stamp + round(ahead * 1e9))
    for _ in range(int((abs(ahead) + 0.5) / T)):
        assert speed(robot.ask()) == 0.0


@pytest.mark.parametrize('behind', [3.0, -3.0])
def test_a_task_velocity_stamped_by_this_computer_is_judged_by_its_arrival(behind: float) -> None:
    robot = make(switch_time=0.0)
    robot.follow(1, lambda _: np.zeros(3))
    for _ in range(100):
        time_of_day = robot.stamp + round(behind * 1e9)
        robot.following.enter_velocity(time_of_day, GENTLE, robot.now, time_of_day + 1_000_000)
        moving = speed(robot.ask())
    assert moving > 0.0
    late = time_of_day - 200_000_000
    with pytest.raises(VelocityError, match='stamp it as the newest joint_states, or 0 for now'):
        robot.following.enter_velocity(late, GENTLE, robot.now, time_of_day)


@pytest.mark.parametrize('behind', [3.0, -3.0])
def test_measurements_stamped_by_this_computer_are_judged_by_their_arrival(behind: float) -> None:
    robot = make(switch_time=0.0)
    robot.follow(1, lambda _: np.zeros(3))
    now = robot.stamp + round(behind * 1e9)
    loop = robot.following
    too_old = pytest.raises(ClockError, match="the robot's clock; allowed")
    for late, refused in ((1_000_000, contextlib.nullcontext()), (200_000_000, too_old)):
        with refused:
            loop.measurements.enter_wrench(now - late, np.zeros(6), '', now)
        with refused:
            loop.measurements.enter('external_torques', now - late, np.zeros(4), now)


def test_a_task_velocity_of_a_robot_without_a_state_yet_is_passed_over_without_a_word() -> None:
    robot = make(switch_time=0.0)
    robot.follow(1, lambda _: np.zeros(3))
    silence = 3.0  # [s]
    stamp = robot.stamp + round(silence * 1e9)
    assert robot.following.enter_velocity(stamp, GENTLE, robot.now + silence) is None
    assert speed(robot.ask()) == 0.0


def test_a_task_velocity_that_is_too_fast_is_refused_and_never_acts() -> None:
    robot = at_speed()
    other = at_speed()
    robot.ask()
    with pytest.raises(VelocityError, match='^2.0003 m/s; allowed: 2 '):
        robot.steer(np.array((2.0003, 0.0, 0.0)))
    with pytest.raises(VelocityError, match='1e\\+09 m/s; allowed: 2'):
        robot.steer(np.array((1e9, 0.0, 0.0)))
    robot.steer(velocity(robot.cycle))
    other.follow(1)
    robot.follow(5)
    other.follow(5)
    np.testing.assert_array_equal(robot.references, other.references)


@pytest.mark.parametrize('stamped', [True, False])
def test_without_new_task_velocities_the_arm_stands_after_the_timeout(stamped: bool) -> None:
    robot = make(switch_time=0.0, command_timeout=0.02)
    for _ in range(20):
        robot.ask()
        robot.steer(GENTLE, None if stamped else 0)
    speeds = [speed(robot.ask()) for _ in range(20)]
    assert all(speeds[:9])
    assert not any(speeds[11:])


def test_a_task_velocity_of_no_state_ends_with_the_timeout_though_the_robots_clock_stands() -> None:
    robot = make(switch_time=0.0)
    for _ in range(20):
        robot.ask()
        robot.steer(GENTLE, 0)
    assert speed(robot.ask()) > 0.0
    robot.cycle += 1
    response = robot.following.step(robot.stamp, robot.q, robot.now + 3.0)
    assert speed(response) == 0.0
    assert response is not None and response.scaling == 0.0


def test_with_patience_a_state_waits_for_its_task_velocity_however_late_it_is() -> None:
    perfect = at_speed()
    robot = at_speed(interface=RobotInterface('velocity', patience=1.0))
    random = np.random.default_rng(4)
    for _ in range(100):
        robot.ask()  # commanded, as the one of the last state has come
        robot.cycle += 1  # of this state none has come when the next one does
        assert robot.following.step(robot.stamp, robot.q, robot.now) is None
        robot.take(robot.following.respond_if_due(robot.now + random.uniform(0.0, 0.9)))
        robot.steer(velocity(robot.cycle - 1), robot.stamp - NS)
        robot.steer(velocity(robot.cycle))
    perfect.follow(200)
    np.testing.assert_array_equal(robot.references, perfect.references)


def test_patience_ends_and_then_nothing_waits_until_task_velocities_come_again() -> None:
    robot = at_speed(interface=RobotInterface('velocity', patience=1.0))
    assert robot.ask() is not None
    robot.cycle += 1
    assert robot.following.step(robot.stamp, robot.q, robot.now) is None
    assert robot.following.respond_if_due(robot.now + 0.9) is None
    assert robot.take(robot.following.respond_if_due(robot.now + 1.1)) is not None
    for _ in range(100):
        assert robot.ask() is not None
    robot.steer(velocity(0))
    assert robot.ask() is not None
    robot.cycle += 1
    assert robot.following.step(robot.stamp, robot.q, robot.now) is None


def test_the_arm_follows_from_where_the_robot_begins_to_take_commands() -> None:
    robot = make(switch_time=0.0)
    robot.following.enter_session('MON')
    robot.follow(20, lambda _: GENTLE)
    response = robot.ask()
    assert response is not None and response.scaling == 0.0
    # as from a standstill
    np.testing.assert_allclose(response.command.dq, response.command.ddq * T)
    robot.steer(GENTLE)
    robot.following.enter_session('CMD')
    response = robot.ask()
    assert response is not None and response.scaling == 1.0


def test_another_robot_must_say_that_it_takes_commands_unless_none_ever_did() -> None:
    for word, expected in (('CMD', 0.0), (None, 1.0)):
        robot = make(switch_time=0.0)
        if word:
            robot.following.enter_session(word)
        robot.follow(5)
        robot.cycle += 5_000
        robot.ask(robot.stamp - 20 * 10**9)
        robot.following.enter_velocity(0, GENTLE, robot.now + 0.1)
        robot.cycle += 1
        response = robot.following.step(robot.stamp - 20 * 10**9 + NS, robot.q, robot.now + 0.1)
        assert response is not None and response.scaling == expected


def test_a_reader_follows_a_state_to_its_command_in_few_calls() -> None:
    """From the state of an arm that moves within limits."""
    robot = limited()
    robot.ask()
    for _ in range(300):
        robot.steer(velocity(robot.cycle), stamp=0)
        robot.ask()
    robot.steer(velocity(robot.cycle), stamp=0)
    calls: list[str] = []

    def note(frame: FrameType, event: str, _: object) -> None:
        if event == 'call' and 'redres_ros' in frame.f_code.co_filename:
            calls.append(frame.f_code.co_filename)

    robot.cycle += 1
    sys.setprofile(note)
    try:
        response = robot.following.step(robot.stamp, robot.q, robot.now)
    finally:
        sys.setprofile(None)
    assert speed(response) > 1e-3
    assert len(calls) <= MOST_CALLS
    assert len(set(calls)) <= MOST_FILES
