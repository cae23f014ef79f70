"""The controller, planner and sim as processes over real DDS, given good and bad input."""

import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

pytest.importorskip('rclpy', reason='needs ROS 2: pip install .[test]')

from builtin_interfaces.msg import Time
from diagnostic_msgs.msg import DiagnosticArray
from geometry_msgs.msg import PoseStamped, TwistStamped
from graph_helpers import (
    NAMES,
    PATIENCE,
    PERIOD,
    START,
    Probe,
    await_that,
    call,
    log_lines,
    nodes,
    set_parameters,
)
from nightly import NIGHTLY, by_day
from rclpy.publisher import Publisher
from rclpy.qos import QoSProfile
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64, String
from std_srvs.srv import SetBool, Trigger

from redres_ros.controller import Controller
from redres_ros.demo.processes import NodeProcess
from redres_ros.graph.client import CallError
from redres_ros.laws import LAWS, make_law
from redres_ros.loop.command_loop import CommandLoop
from redres_ros.loop.settings import LoopSettings
from redres_ros.nodes import controller, planner, sim
from redres_ros.nodes.conversions import to_pose
from redres_ros.nodes.runtime import own_domain
from redres_ros.nodes.topics import LATCHED
from redres_ros.robot_model import RobotModel

pytestmark = pytest.mark.slow

DX = np.array([0.02, -0.05, 0.03])
BOX = ('position', 'velocity', 'acceleration')
# of a controller that tests share, and what of it some of them set meanwhile
LIVE = {'law': 'minimum_acceleration', 'damping': 10.0, 'limits': BOX, 'switch_time': 0.0}
LIVE |= {'command_timeout': 0.1}


SECURED = {  # what somebody sets who wants keys, or no graph at all
    'ROS_SECURITY_ENABLE': 'true',
    'ROS_SECURITY_STRATEGY': 'Enforce',
    'ROS_SECURITY_KEYSTORE': '/no/keys',
}
MAINS = {'controller': controller.main, 'planner': planner.main, 'sim': sim.main}
BAD_STARTS = [  # node, parameters, environment, words that its one line must hold
    ('controller', 'law:=no_such_law', {}, ('no_such_law', 'minimum_acceleration')),
    ('controller', 'damping:=600.0', {}, ('600', '0 to 500')),
    ('controller', 'damping:=.nan', {}, ('damping', 'nan')),
    ('controller', 'rate:=fast', {}, ('rate', 'fast', 'decimal point')),
    ('controller', 'limits:=none,position', {}, ('none', 'position', 'expected names')),
    ('controller', 'preferences:=posture,foo', {}, ('foo', 'joint_centering')),
    ('controller', 'rate:=1.0e9', {}, ('rate', '2000')),
    ('controller', 'robot:=r2d2', {}, ('r2d2', 'lwr4_paper', '.urdf', 'topic')),
    ('controller', 'tip_frame:=nose', {}, ('nose', 'tool0')),
    ('planner', 'task:=no_such_task', {}, ('no_such_task', 'rectangle')),
    ('planner', 'task:=' + 'x' * 300, {}, ("unknown task 'xxx",)),
    ('planner', 'task:=/no/such/file.yaml', {}, ('/no/such/file.yaml',)),
    ('sim', 'rate:=300.0', {}, ('300', 'whole number', 'plant steps')),
    ('sim', 'start:=[0.0, 0.0]', {}, ('[0.0, 0.0]', '7')),
    ('sim', 'start:=[9.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0]', {}, ('lwr_a1_joint', '9')),
    ('sim', 'plant:=gazebo', {}, ('gazebo', 'mujoco')),
    ('sim', 'start:=[]', {}, ('start is nothing', 'an array of numbers')),
    ('sim', 'use_sim_time:=5', {}, ("'use_sim_time' to '5'",)),
    ('sim', 'use_sim_time:=true', {}, ('publishes no /clock',)),
    ('controller', 'limits:=[0.5]', {}, ('limits is [0.5]', 'position')),
    ('controller', 'use_sim_time:=x', {}, ("'use_sim_time' to 'x'",)),
    ('controller', 'rate:=500.0', {'ROS_DOMAIN_ID': 'abc'}, ('ROS_DOMAIN_ID', 'abc', '0 to 232')),
    ('controller', 'rate:=500.0', {'ROS_DOMAIN_ID': '233'}, ('ROS_DOMAIN_ID', '233', '0 to 232')),
    ('controller', 'rate:=500.0', {'ROS_DOMAIN_ID': '-1'}, ('ROS_DOMAIN_ID', '-1', '0 to 232')),
]


@pytest.fixture
def as_it_was() -> Iterator[None]:
    """What a node sets for its process is as before afterwards."""
    numbers = (signal.SIGINT, signal.SIGTERM)
    handlers = [signal.getsignal(number) for number in numbers]
    errors = np.geterr()
    with own_domain():
        yield
    np.seterr(**errors)
    for number, handler in zip(numbers, handlers, strict=True):
        signal.signal(number, handler)


@pytest.mark.parametrize(('node', 'parameter', 'environment', 'words'), BAD_STARTS)
def test_a_node_that_cannot_start_says_why_in_one_line(
    node: str,
    parameter: str,
    environment: dict[str, str],
    words: tuple[str, ...],
    as_it_was: None,
    monkeypatch: pytest.MonkeyPatch,
    capfd: pytest.CaptureFixture[str],
) -> None:
    for name, value in environment.items():
        monkeypatch.setenv(name, value)
    assert MAINS[node](['--ros-args', '-p', parameter]) == 1
    assert_one_line(capfd.readouterr().err, words)


@pytest.mark.parametrize(
    ('parameter', 'environment', 'words'),
    by_day(
        1,
        [
            ('law:=no_such_law', {}, ('no_such_law', 'minimum_acceleration')),
            ('rate:=500.0', {'RMW_IMPLEMENTATION': 'rmw_none'}, ('rmw_none',)),
            ('rate:=500.0', SECURED, ('SECURITY', '/no/keys')),
        ],
    ),
)
def test_a_process_of_a_node_that_cannot_start_ends_with_a_status_and_one_line(
    parameter: str, environment: dict[str, str], words: tuple[str, ...]
) -> None:
    command = [sys.executable, '-m', 'redres_ros.nodes.controller', '--ros-args', '-p', parameter]
    with own_domain():
        done = subprocess.run(
            command,
            text=True,
            timeout=PATIENCE,
            capture_output=True,
            check=False,
            env={**os.environ, **environment},
        )
    assert done.returncode not in (0, -signal.SIGKILL)
    assert_one_line(done.stderr, words)


def assert_one_line(printed: str, words: tuple[str, ...]) -> None:
    lines = printed.strip().splitlines()
    assert len(lines) == 1, printed
    assert all(word in lines[0] for word in words), lines[0]


SIGNALS = (
    {'sim': signal.SIGINT, 'controller': signal.SIGTERM, 'planner': signal.SIGINT},
    {'sim': signal.SIGTERM, 'controller': signal.SIGINT, 'planner': signal.SIGTERM},
)


@pytest.mark.parametrize('numbers', SIGNALS if NIGHTLY else SIGNALS[:1])
def test_every_node_ends_with_status_0_on_a_signal(
    tmp_path: Path, numbers: dict[str, signal.Signals]
) -> None:
    with nodes(tmp_path, sim={}, controller={}, planner={}) as (probe, processes):
        await_that(
            lambda: {'sim', 'controller', 'planner'} <= set(probe.get_node_names()), 'the nodes'
        )
        for name, number in numbers.items():
            os.kill(processes[name].pid, number)
        assert [process.wait(PATIENCE) for process in processes.values()] == [0, 0, 0]
    for name in processes:
        assert 'Traceback' not in (tmp_path / f'{name}.log').read_text()


@pytest.mark.nightly
def test_all_nodes_in_one_process_end_with_status_0_too(tmp_path: Path) -> None:
    with nodes(tmp_path, composed={}) as (probe, processes):
        await_that(
            lambda: {'sim', 'controller', 'planner'} <= set(probe.get_node_names()), 'the nodes'
        )
        os.kill(processes['composed'].pid, signal.SIGINT)
        assert processes['composed'].wait(PATIENCE) == 0
    assert 'Traceback' not in (tmp_path / 'composed.log').read_text()


def test_the_responses_are_those_of_the_library(tmp_path: Path) -> None:
    law = make_law('minimum_acceleration', damping=7.0)
    following = CommandLoop(
        Controller(RobotModel.named('lwr4_paper'), law, 0.002, switch_time=0.1, limits=BOX)
    )
    with nodes(tmp_path, controller={'damping': 7.0, 'switch_time': 0.1}) as (probe, _):
        q = START
        for _ in range(20):
            q_ref, dq = probe.ask(q)
            response = following.step(probe.stamp, q, 0.0)
            assert response is not None
            np.testing.assert_array_equal(q_ref, response.command.q_ref)
            np.testing.assert_array_equal(dq, response.command.dq)
            probe.steer(DX)
            following.enter_twist(probe.stamp, DX, 0.0)
            q = q_ref
        assert np.linalg.norm(q - START) > 1e-6


@pytest.mark.nightly
def test_in_lock_step_it_does_not_matter_whether_the_session_is_reported_before_the_first_state(
    tmp_path: Path,
) -> None:
    controller = Controller(
        RobotModel.named('lwr4_paper'),
        make_law('minimum_acceleration'),
        0.002,
        switch_time=0.1,
        limits=BOX,
    )
    following = CommandLoop(controller, LoopSettings(lockstep=True))
    with nodes(tmp_path, controller={'lockstep': True, 'switch_time': 0.1}) as (probe, _):
        session = probe.create_publisher(String, 'sim/session_state', LATCHED)
        await_that(lambda: session.get_subscription_count() == 1, 'a listener to the session')
        session.publish(String(data='MON'))
        probe.settle()
        for _ in range(5):
            state = probe.state(START)
            probe.send(state)
            probe.steer(DX)
            q_ref, _ = probe.response_to(state)
            assert following.step(probe.stamp, START, 0.0) is None
            response = following.enter_twist(probe.stamp, DX, 0.0)
            assert response is not None
            np.testing.assert_array_equal(q_ref, response.command.q_ref)
        assert np.linalg.norm(q_ref - START) > 1e-6


Shared = tuple[Probe, Callable[[], list[str]]]


@pytest.fixture(scope='class')
def resting(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Shared]:
    """A probe beside a controller whose arm stands still at the start, and the lines that the
    controller has printed.
    """
    directory = tmp_path_factory.mktemp('resting')
    with nodes(directory, controller=LIVE) as (probe, _):
        yield probe, lambda: log_lines(directory, 'controller')


@pytest.fixture
def movable(resting: Shared) -> Iterator[Callable[..., Probe]]:
    """The same controller, for a test that moves its arm: takes live parameters, gives the probe.
    Afterwards it is as it was.
    """
    probe, _ = resting

    def with_parameters(**values: Any) -> Probe:
        if values:
            set_parameters(probe, 'controller', values)
        probe.ask(START)
        return probe

    yield with_parameters
    set_parameters(probe, 'controller', LIVE)
    time.sleep(0.6)  # a robot that starts again is silent before
    probe.stamp += 10 * 10**9
    probe.ask(START)


class TestOneController:
    """One controller gets it all, and is none the worse for it."""

    @pytest.mark.parametrize(
        ('spoil', 'words'),
        [
            (
                lambda message: setattr(message, 'name', ['a', *message.name[1:]]),
                ('missing lwr_a1_joint', 'not of this arm a'),
            ),
            (
                lambda message: setattr(message, 'name', message.name[:-1]),
                ('missing lwr_a6_joint',),
            ),
            (
                lambda message: setattr(message, 'position', message.position[:-1]),
                ('6 positions', '7 joints'),
            ),
            (lambda message: message.position.__setitem__(2, float('nan')), ('nan', 'finite')),
            (lambda message: message.position.__setitem__(2, float('inf')), ('inf', 'finite')),
            (
                lambda message: setattr(message.header.stamp, 'sec', message.header.stamp.sec - 1),
                ('before the newest', 'later stamp'),
            ),
            (
                lambda message: setattr(message.header, 'stamp', Time()),
                ('no stamp',),
            ),
        ],
        ids=[
            'another joint',
            'a name too few',
            'a position too few',
            'not a number',
            'infinite',
            'of a second ago',
            'without a stamp',
        ],
    )
    def test_a_bad_state_gets_no_response_and_is_reported_once(
        self,
        resting: Shared,
        spoil: Callable[[Any], None],
        words: tuple[str, ...],
    ) -> None:
        probe, lines = resting
        before, _ = probe.ask(START)
        responses = set(probe.responses)
        reported = len(lines())
        message = probe.state(START)
        spoil(message)

        def refused() -> bool:
            probe.send(message)
            return any('joint_states refused' in line for line in lines()[reported:])

        await_that(refused, 'the refusal')
        for _ in range(4):
            probe.send(message)
            probe.settle()
        assert set(probe.responses) == responses
        after, _ = probe.ask(START)
        np.testing.assert_array_equal(after, before)
        await_that(
            lambda: any('accepted again' in line for line in lines()[reported:]),
            'the line of recovery',
        )
        refusals = [line for line in lines()[reported:] if 'joint_states refused' in line]
        assert len(refusals) == 1
        assert all(word in refusals[0] for word in words), refusals[0]

    @pytest.mark.parametrize(
        ('dx', 'frame', 'words'),
        [
            (DX, 'nose', ('nose', 'tool0', 'world')),
            (1e9 * DX, 'world', ('m/s', 'max_linear')),
            (np.array([0.1, np.nan, 0.0]), 'world', ('nan', 'finite')),
        ],
    )
    def test_a_bad_task_velocity_does_not_move_the_arm(
        self,
        resting: Shared,
        dx: np.ndarray,
        frame: str,
        words: tuple[str, ...],
    ) -> None:
        probe, lines = resting
        q_ref, _ = probe.ask(START)
        reported = len(lines())
        for _ in range(5):
            probe.steer(dx, frame)
            q_ref, dq = probe.ask(q_ref)
            np.testing.assert_array_equal(dq, np.zeros(7))
        await_that(
            lambda: any('refused' in line for line in lines()[reported:]), 'the refusal in the log'
        )
        refusals = [line for line in lines()[reported:] if 'refused' in line]
        assert len(refusals) == 1
        assert all(word in refusals[0] for word in words), refusals[0]

    def test_joints_are_matched_by_name(self, resting: Shared) -> None:
        probe, _ = resting
        order = np.array([3, 0, 6, 1, 5, 2, 4])
        straight, _ = probe.ask(START)
        shuffled, _ = probe.ask(START[order], tuple(NAMES[i] for i in order))
        np.testing.assert_array_equal(straight, START)
        np.testing.assert_array_equal(shuffled, START)

    @pytest.mark.parametrize('side', ['ahead of', 'behind'])
    def test_a_task_velocity_far_from_the_robots_clock_is_refused_by_name_and_never_acts(
        self, resting: Shared, side: str
    ) -> None:
        probe, _ = resting
        away = 75 * PERIOD if side == 'ahead of' else -75 * PERIOD
        health = probe.listen(DiagnosticArray, '/diagnostics')
        probe.ask(START)
        probe.steer(DX, stamp=probe.stamp + away)
        words = f"{side} the robot's clock"
        await_that(
            lambda: any(words in array.status[0].message for array in health), 'the diagnostics'
        )
        for _ in range(100):
            _, dq = probe.ask(START)
            np.testing.assert_array_equal(dq, np.zeros(7))

    def test_the_torque_that_is_published_is_that_of_the_model(self, resting: Shared) -> None:
        probe, _ = resting
        norms = probe.listen(Float64, 'controller/joint_torque_norm')
        await_that(lambda: probe.ask(START) and bool(norms), 'joint_torque_norm')
        model = RobotModel.named('lwr4_paper')
        # Standing still, the torque is what carries the arm.
        assert norms[-1].data == pytest.approx(
            np.linalg.norm(model.state(START, np.zeros(7)).n), rel=1e-12
        )

    def test_a_namespace_makes_a_second_robot(self, resting: Shared) -> None:
        probe, _ = resting
        command = [
            sys.executable,
            '-m',
            'redres_ros.nodes.controller',
            '--ros-args',
            '-r',
            '__ns:=/left',
        ]
        second = subprocess.Popen(command, stderr=subprocess.DEVNULL)
        try:
            expected = {'/joint_command', '/left/joint_command', '/left/controller/law'}
            await_that(
                lambda: expected <= {name for name, _ in probe.get_topic_names_and_types()},
                'topics of both',
            )
        finally:
            second.terminate()
            second.wait(PATIENCE)

    def test_a_stale_task_velocity_brings_the_arm_to_rest_without_a_jump(
        self,
        movable: Callable[..., Probe],
    ) -> None:
        T = 0.002
        switch_time = 0.1
        probe = movable(switch_time=switch_time, command_timeout=0.3)
        q_ref = START
        speeds = []
        for tick in range(300):
            if tick < 80 and tick % 10 == 0:
                probe.steer(DX)
            q_ref, dq = probe.ask(q_ref)
            speeds.append(dq)
        speeds = np.array(speeds)
        cruising = np.linalg.norm(speeds[79])
        assert cruising > 0.01
        np.testing.assert_array_equal(speeds[-1], np.zeros(7))
        # Blending over switch_time with the quintic changes the speed by at most 15/8 of its mean
        # rate.
        assert (
            np.linalg.norm(np.diff(speeds[80:], axis=0), axis=1).max()
            < 2.0 * cruising * T / switch_time
        )

    def test_a_task_velocity_in_the_axes_of_a_link_is_turned_into_those_of_the_base(
        self,
        movable: Callable[..., Probe],
    ) -> None:
        model = RobotModel.named('lwr4_paper')
        small = 0.03 * DX  # within one cycle's acceleration
        probe = movable()
        q_ref = START
        for frame in ('tool0', 'link_4', '', 'world'):
            base = frame in ('', 'world')
            expected = small if base else model.pose(q_ref, frame)[1] @ small
            for _ in range(3):  # from the last one to this
                probe.steer(small, frame)
                q = q_ref
                q_ref, dq = probe.ask(q)
            J = model.state(q, dq).J[:3]
            np.testing.assert_allclose(J @ dq, expected, rtol=0.0, atol=1e-6)

    def test_hold_begins_at_once_in_the_middle_of_a_blend(
        self, movable: Callable[..., Probe]
    ) -> None:
        probe = movable(switch_time=0.5, limits='none', command_timeout=5.0)
        q_ref = START
        for tick in range(100):
            if tick % 20 == 0:
                probe.steer(DX)
            q_ref, dq = probe.ask(q_ref)
        assert np.linalg.norm(dq) > 0.01
        call(probe, SetBool, 'controller/hold', SetBool.Request(data=True))
        speeds = []
        for tick in range(25):
            if tick % 20 == 0:
                probe.steer(DX)
            q_ref, dq = probe.ask(q_ref)
            speeds.append(np.linalg.norm(dq))
        call(probe, SetBool, 'controller/hold', SetBool.Request(data=False))
        assert speeds[-1] < speeds[0]

    def test_hold_stops_the_arm_and_lets_it_go_again(self, movable: Callable[..., Probe]) -> None:
        probe = movable(switch_time=0.02, command_timeout=5.0)
        q_ref = START

        def speed_after(ticks: int) -> float:
            nonlocal q_ref
            for tick in range(ticks):
                if tick % 5 == 0:
                    probe.steer(DX)
                q_ref, dq = probe.ask(q_ref)
            return float(np.linalg.norm(dq))

        assert speed_after(15) > 0.01
        call(probe, SetBool, 'controller/hold', SetBool.Request(data=True))
        assert speed_after(15) == 0.0
        call(probe, SetBool, 'controller/hold', SetBool.Request(data=False))
        assert speed_after(15) > 0.01

    def test_law_and_gains_are_switched_live_and_refused_with_a_reason(
        self,
        movable: Callable[..., Probe],
    ) -> None:
        probe = movable()
        laws = probe.listen(String, 'controller/law')
        probe.ask(START)
        for name in LAWS:
            set_parameters(probe, 'controller', {'law': name, 'damping': 20.0})
            await_that(
                lambda name=name: probe.ask(START) and laws and laws[-1].data == name,
                f'{name} in force',
            )
        for values, words in (
            ({'law': 'none'}, ('none', 'minimum_torque')),
            ({'damping': 501.0}, ('501', '500')),
            ({'damping': float('nan')}, ('nan',)),
            ({'law': 7}, ('STRING', 'INTEGER')),
            ({'rate': 100.0}, ('rate',)),
            ({'law': 'minimum_velocity', 'damping': -1.0}, ('-1',)),
        ):
            with pytest.raises(CallError) as refusal:
                set_parameters(probe, 'controller', values)
            assert all(word in str(refusal.value) for word in words), refusal.value
        probe.ask(START)
        assert laws[-1].data == 'minimum_torque'


def test_a_target_pose_is_approached_in_a_straight_line_and_a_bad_one_refused(
    tmp_path: Path,
) -> None:
    model = RobotModel.named('lwr4_paper')
    x, _ = model.tip(START)
    way = np.array((0.0, -0.1, 0.05))  # [m]
    with nodes(tmp_path, planner={'lockstep': True}) as (probe, _):
        targets = probe.create_publisher(PoseStamped, 'target_pose', 1)
        await_that(lambda: targets.get_subscription_count() == 1, 'a listener to target_pose')
        twists = probe.listen(TwistStamped, 'cartesian_velocity')
        target = to_pose(0, 'nose', x + way, np.eye(3))
        targets.publish(target)
        await_that(
            lambda: any('nose' in line for line in log_lines(tmp_path, 'planner')), 'the refusal'
        )
        target.header.frame_id = ''

        def speed() -> float:
            probe.send(probe.state(START))
            if not twists:  # until the planner has had a state
                targets.publish(target)
            time.sleep(PERIOD / 1e9)
            linear = twists[-1].twist.linear if twists else TwistStamped().twist.linear
            along = np.array((linear.x, linear.y, linear.z))
            assert np.linalg.norm(np.cross(along, way)) < 1e-6
            return float(along @ way)

        await_that(lambda: speed() > 0.0, 'a velocity towards the target', every=0.0)


def test_limits_preferences_and_tasks_are_set_live_with_gains_of_any_number(
    tmp_path: Path,
) -> None:
    with nodes(tmp_path, controller={'damping': 20, 'posture.gain': 3}) as (probe, _):
        probe.ask(START)
        for values in (
            {'damping': 400},
            {'limits': 'none'},
            {'limits': ['velocity', 'torque'], 'limit_scale': 0.5},
            {'preferences': 'posture, joint_centering', 'posture.gain': 2},
            {'secondary_tasks': ['orientation'], 'task_gain': 5},
            {'max_linear': 1},
        ):
            set_parameters(probe, 'controller', values)
            probe.ask(START)
        for values, words in (
            ({'limits': ['foo']}, ('foo', 'position')),
            ({'limits': ['none', 'position']}, ('none', 'expected names')),
            ({'limits': ['position', 'position']}, ('position', 'named twice')),
            ({'limit_scale': 2}, ('2', '1')),
            ({'task_gain': -1.0}, ('-1', '0')),
            ({'secondary_tasks': ['orientation@knee']}, ('knee', 'link_4')),
            ({'secondary_tasks': ['joint@a8']}, ('a8', 'lwr_a1_joint')),
        ):
            with pytest.raises(CallError) as refusal:
                set_parameters(probe, 'controller', values)
            assert all(word in str(refusal.value) for word in words), refusal.value


def test_the_sim_refuses_commands_for_no_state_and_keeps_still(tmp_path: Path) -> None:
    with nodes(tmp_path, sim={'plant': 'ideal'}) as (probe, _):
        states = probe.listen(JointState, 'joint_states')
        publisher = probe.create_publisher(JointState, 'joint_command', QoSProfile(depth=1))
        await_that(lambda: len(states) > 10, 'states')
        for spoiled in (np.full(7, np.nan), START + 1.0):
            message = probe.state(spoiled)
            seen = len(states)

            def received(message: JointState = message, seen: int = seen) -> bool:
                publisher.publish(message)
                lines = log_lines(tmp_path, 'sim')
                refused = any('joint_command refused' in line for line in lines)
                return refused and len(states) > seen + 10

            await_that(received, 'the refusal, and more states')
        assert all(list(state.position) == START.tolist() for state in states)


@pytest.mark.nightly
def test_without_a_clock_to_take_the_time_from_a_node_says_so_once_and_watches_on(
    tmp_path: Path,
) -> None:
    with nodes(tmp_path, controller={'use_sim_time': True}) as (probe, _):
        reports = probe.listen(DiagnosticArray, '/diagnostics')

        def lines() -> list[str]:
            return [line for line in log_lines(tmp_path, 'controller') if '/clock' in line]

        await_that(lambda: any('no joint_states' in r.status[0].message for r in reports), 'health')
        await_that(lambda: len(lines()) == 1, 'the warning')
        seen = len(reports)
        await_that(lambda: len(reports) > seen + 3, 'more reports')
        assert len(lines()) == 1


@pytest.fixture(scope='class')
def robot(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Probe]:
    """A probe beside a sim, for tests that leave it as it was."""
    with nodes(tmp_path_factory.mktemp('robot'), sim={}) as (probe, _):
        yield probe


class TestOneSim:
    """One sim, which every test leaves as it was."""

    def test_the_sim_stamps_its_states_exactly_one_period_apart(self, robot: Probe) -> None:
        states = robot.listen(JointState, 'joint_states', QoSProfile(depth=1000))
        await_that(lambda: len(states) > 200, 'states')
        stamps = np.array(
            [state.header.stamp.sec * 10**9 + state.header.stamp.nanosec for state in states]
        )
        assert set(np.unique((stamps - stamps[0]) % PERIOD)) == {0}
        assert np.diff(stamps).min() == PERIOD

    def test_the_sim_reports_its_session_and_the_five_statistics(self, robot: Probe) -> None:
        state = robot.listen(String, 'sim/session_state', LATCHED)
        reports = robot.listen(DiagnosticArray, '/diagnostics')
        await_that(lambda: bool(state and reports), 'session state and diagnostics')
        assert state[-1].data == 'MON'
        keys = {pair.key for pair in reports[-1].status[0].values}
        assert {'response_rate', 'latency', 'jitter', 'miss_rate', 'miss_count'} <= keys
        assert call(robot, Trigger, 'sim/reset', Trigger.Request()).success

    def test_faults_of_the_sim_are_set_live_and_refused_with_a_reason(self, robot: Probe) -> None:
        states = robot.listen(JointState, 'joint_states')
        await_that(lambda: len(states) > 10, 'states')
        set_parameters(robot, 'sim', {'state_loss': 1.0})

        def silent() -> bool:
            received = len(states)
            time.sleep(100.0 * PERIOD / 1e9)
            return len(states) == received

        await_that(silent, 'a time in which a hundred states are lost')
        lost_from = len(states)
        set_parameters(robot, 'sim', {'state_loss': 0.0})
        await_that(lambda: len(states) > lost_from + 10, 'states again')
        for values, words in (
            ({'frozen_joint': 8}, ('8', '7')),
            ({'state_loss': 2.0}, ('2', '1')),
            ({'fault_seed': 1}, ('fault_seed', 'constant')),
        ):
            with pytest.raises(CallError) as refusal:
                set_parameters(robot, 'sim', values)
            assert all(word in str(refusal.value) for word in words), refusal.value


def test_a_second_publisher_of_commands_is_refused_and_named(tmp_path: Path) -> None:
    with nodes(tmp_path, sim={'plant': 'ideal'}) as (probe, _):
        one, two = (
            probe.create_publisher(JointState, 'joint_command', QoSProfile(depth=1))
            for _ in range(2)
        )
        states = probe.listen(JointState, 'joint_states')

        def reported(*rivals: Publisher) -> bool:
            if states:
                for rival in rivals:
                    rival.publish(states[-1])
            return any('2 publishers' in line for line in log_lines(tmp_path, 'sim'))

        for _ in range(50):  # the other one is there but silent, as one that was killed
            time.sleep(0.01)
            assert not reported(one)
        await_that(lambda: reported(one, two), 'the refusal')
        assert all(list(state.position) == START.tolist() for state in states)


def test_node_processes_run_the_package_that_started_them_in_a_folder_with_another_one(
    tmp_path, monkeypatch
):
    other = tmp_path / 'redres_ros'
    other.mkdir()
    (other / '__init__.py').write_text("raise SystemExit('the other one')")
    monkeypatch.chdir(tmp_path)
    process = NodeProcess('nodes.absent', tmp_path / 'log', {})
    assert process.wait(60.0) == 1
    assert process.last_line().endswith('No module named redres_ros.nodes.absent')
