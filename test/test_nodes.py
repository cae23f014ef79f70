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
from rclpy.qos import QoSProfile
from sensor_msgs.msg import JointState
from std_msgs.msg import String
from std_srvs.srv import SetBool, Trigger

from redres_ros.controller import Controller
from redres_ros.demo.processes import NodeProcess
from redres_ros.graph.client import CallError
from redres_ros.laws import LAWS, make_law
from redres_ros.loop.command_loop import CommandLoop
from redres_ros.nodes import controller, planner, sim
from redres_ros.nodes.runtime import own_domain
from redres_ros.nodes.topics import LATCHED
from redres_ros.robot_model import RobotModel

pytestmark = pytest.mark.slow

DX = np.array([0.02, -0.05, 0.03])
BOX = ('position', 'velocity', 'acceleration')

SECURED = {  # what somebody sets who wants keys, or no graph at all
    'ROS_SECURITY_ENABLE': 'true',
    'ROS_SECURITY_STRATEGY': 'Enforce',
    'ROS_SECURITY_KEYSTORE': '/no/keys',
}
MAINS = {'controller': controller.main, 'planner': planner.main, 'sim': sim.main}
BAD_STARTS = [  # node, parameter, words that its one line must hold
    ('controller', 'law:=no_such_law', ('no_such_law', 'minimum_acceleration')),
    ('controller', 'damping:=600.0', ('600', '0 to 500')),
    ('controller', 'damping:=.nan', ('damping', 'nan')),
    ('controller', 'rate:=fast', ('rate', 'fast', 'decimal point')),
    ('controller', 'rate:=1.0e9', ('rate', '2000')),
    ('controller', 'limits:=none,position', ('none', 'position', 'expected names')),
    ('controller', 'limits:=[0.5]', ('limits is [0.5]', 'position')),
    ('controller', 'robot:=r2d2', ('r2d2', 'lwr4_paper', '.urdf', 'topic')),
    ('controller', 'tip_frame:=nose', ('nose', 'tool0')),
    ('controller', 'bridging:=hold', ('bridging is no parameter any more', 'robot_interface')),
    ('controller', 'use_sim_time:=x', ("'use_sim_time' to 'x'",)),
    ('planner', 'task:=no_such_task', ('no_such_task', 'rectangle')),
    ('planner', 'task:=/no/such/file.yaml', ('/no/such/file.yaml',)),
    ('sim', 'start:=[0.0, 0.0]', ('[0.0, 0.0]', '7')),
    ('sim', 'start:=[]', ('start is nothing', 'an array of numbers')),
    ('sim', 'plant:=gazebo', ('gazebo', 'mujoco')),
    ('sim', 'use_sim_time:=true', ('publishes no /clock',)),
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


def assert_one_line(printed: str, words: tuple[str, ...]) -> None:
    lines = printed.strip().splitlines()
    assert len(lines) == 1, printed
    assert all(word in lines[0] for word in words), lines[0]


@pytest.mark.parametrize(('node', 'parameter', 'words'), BAD_STARTS)
def test_a_node_that_cannot_start_says_why_in_one_line(
    node: str,
    parameter: str,
    words: tuple[str, ...],
    as_it_was: None,
    capfd: pytest.CaptureFixture[str],
) -> None:
    assert MAINS[node](['--ros-args', '-p', parameter]) == 1
    assert_one_line(capfd.readouterr().err, words)


@pytest.mark.parametrize('domain', ['abc', '233', '-1'])
def test_a_domain_that_does_not_exist_is_refused(
    domain: str,
    as_it_was: None,
    monkeypatch: pytest.MonkeyPatch,
    capfd: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.setenv('ROS_DOMAIN_ID', domain)
    assert planner.main([]) == 1
    assert_one_line(capfd.readouterr().err, ('ROS_DOMAIN_ID', domain, '0 to 232'))


@pytest.mark.parametrize(
    ('environment', 'words'),
    by_day(1, [({'RMW_IMPLEMENTATION': 'rmw_none'}, ('rmw_none',)), (SECURED, ('/no/keys',))]),
)
def test_a_process_of_a_node_that_cannot_start_ends_with_a_status_and_one_line(
    environment: dict[str, str], words: tuple[str, ...]
) -> None:
    command = [sys.executable, '-m', 'redres_ros.nodes.planner']
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


SIGNALS = (
    {'sim': signal.SIGINT, 'controller': signal.SIGTERM, 'planner': signal.SIGINT},
    {'sim': signal.SIGTERM, 'controller': signal.SIGINT, 'planner': signal.SIGTERM},
    {'composed': signal.SIGINT},
)


@pytest.mark.parametrize('numbers', SIGNALS if NIGHTLY else SIGNALS[:1])
def test_every_node_ends_with_status_0_on_a_signal(
    tmp_path: Path, numbers: dict[str, signal.Signals]
) -> None:
    with nodes(tmp_path, **{name: {} for name in numbers}) as (probe, processes):
        await_that(
            lambda: {'sim', 'controller', 'planner'} <= set(probe.get_node_names()), 'the nodes'
        )
        for name, number in numbers.items():
            os.kill(processes[name].pid, number)
        assert {process.wait(PATIENCE) for process in processes.values()} == {0}
    for name in processes:
        assert 'Traceback' not in (tmp_path / f'{name}.log').read_text()


def test_the_responses_are_those_of_the_library(tmp_path: Path) -> None:
    law = make_law('minimum_acceleration', damping=7.0)
    loop = CommandLoop(
        Controller(RobotModel.named('lwr4_paper'), law, 0.002, switch_time=0.1, limits=BOX)
    )
    with nodes(tmp_path, controller={'damping': 7.0, 'switch_time': 0.1}) as (probe, _):
        q = START
        for _ in range(20):
            q_ref, dq = probe.ask(q)
            response = loop.step(probe.stamp, q, 0.0)
            assert response is not None
            np.testing.assert_array_equal(q_ref, response.command.q_ref)
            np.testing.assert_array_equal(dq, response.command.dq)
            probe.steer(DX)
            loop.enter_twist(probe.stamp, DX, 0.0)
            q = q_ref
        assert np.linalg.norm(q - START) > 1e-6


Shared = tuple[Probe, Callable[[], list[str]]]


@pytest.fixture(scope='class')
def resting(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Shared]:
    """A probe beside a controller whose arm stands still at the start, and the lines that the
    controller has printed.
    """
    directory = tmp_path_factory.mktemp('resting')
    with nodes(directory, controller={'switch_time': 0.02, 'command_timeout': 5.0}) as (probe, _):
        yield probe, lambda: log_lines(directory, 'controller')


class TestOneController:
    """One controller gets it all, and is none the worse for it."""

    @pytest.mark.parametrize(
        ('spoil', 'words'),
        [
            pytest.param(
                lambda message: setattr(message, 'name', ['a', *message.name[1:]]),
                ('missing lwr_a1_joint', 'not of this arm a'),
                id='another joint',
            ),
            pytest.param(
                lambda message: setattr(message, 'position', message.position[:-1]),
                ('6 positions', '7 joints'),
                id='a position too few',
            ),
            pytest.param(
                lambda message: message.position.__setitem__(2, float('nan')),
                ('nan', 'finite'),
                id='not a number',
            ),
            pytest.param(
                lambda message: setattr(message.header.stamp, 'sec', message.header.stamp.sec - 1),
                ('before the newest', 'later stamp'),
                id='of a second ago',
            ),
            pytest.param(
                lambda message: setattr(message.header, 'stamp', Time()),
                ('no stamp',),
                id='without a stamp',
            ),
        ],
    )
    def test_a_bad_state_gets_no_response_and_is_reported_once(
        self, resting: Shared, spoil: Callable[[Any], None], words: tuple[str, ...]
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
        self, resting: Shared, dx: np.ndarray, frame: str, words: tuple[str, ...]
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
        shuffled, _ = probe.ask(START[order], tuple(NAMES[i] for i in order))
        np.testing.assert_array_equal(shuffled, START)

    def test_hold_stops_the_arm_and_lets_it_go_again(self, resting: Shared) -> None:
        probe, _ = resting
        q_ref, _ = probe.ask(START)

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
        call(probe, SetBool, 'controller/hold', SetBool.Request(data=True))
        assert speed_after(15) == 0.0

    def test_parameters_are_set_live_and_refused_with_a_reason(self, resting: Shared) -> None:
        probe, _ = resting
        laws = probe.listen(String, 'controller/law')
        probe.ask(START)
        for name in LAWS:
            set_parameters(probe, 'controller', {'law': name, 'damping': 20})
            await_that(
                lambda name=name: probe.ask(START) and laws and laws[-1].data == name,
                f'{name} in force',
            )
        for values in (
            {'limits': 'none'},
            {'limits': ['velocity', 'torque'], 'limit_scale': 0.5},
            {'preferences': 'posture, joint_centering', 'posture.gain': 2},
            {'secondary_tasks': ['orientation'], 'task_gain': 5},
            {'max_linear': 1},
        ):
            set_parameters(probe, 'controller', values)
            probe.ask(START)
        for values, words in (
            ({'law': 'none'}, ('none', 'minimum_torque')),
            ({'law': 7}, ('STRING', 'INTEGER')),
            ({'law': 'minimum_velocity', 'damping': -1.0}, ('-1',)),
            ({'damping': 501.0}, ('501', '500')),
            ({'damping': float('nan')}, ('nan',)),
            ({'rate': 100.0}, ('rate',)),
            ({'bridging': 'hold'}, ('bridging is no parameter any more', 'robot_interface')),
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
        probe.ask(START)
        assert laws[-1].data == 'minimum_torque'


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
def robot(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Shared]:
    """A probe beside a sim, for tests that leave it as it was, and the lines of its log."""
    directory = tmp_path_factory.mktemp('robot')
    with nodes(directory, sim={'plant': 'ideal'}) as (probe, _):
        yield probe, lambda: log_lines(directory, 'sim')


class TestOneSim:
    """One sim, which every test leaves as it was."""

    def test_the_sim_stamps_its_states_exactly_one_period_apart(self, robot: Shared) -> None:
        states = robot[0].listen(JointState, 'joint_states', QoSProfile(depth=1000))
        await_that(lambda: len(states) > 200, 'states')
        stamps = np.array(
            [state.header.stamp.sec * 10**9 + state.header.stamp.nanosec for state in states]
        )
        assert set(np.unique((stamps - stamps[0]) % PERIOD)) == {0}
        assert np.diff(stamps).min() == PERIOD

    def test_the_sim_reports_its_session_and_the_five_statistics(self, robot: Shared) -> None:
        probe, _ = robot
        state = probe.listen(String, 'sim/session_state', LATCHED)
        reports = probe.listen(DiagnosticArray, '/diagnostics')
        await_that(lambda: bool(state and reports), 'session state and diagnostics')
        assert state[-1].data == 'MON'
        keys = {pair.key for pair in reports[-1].status[0].values}
        assert {'response_rate', 'latency', 'jitter', 'miss_rate', 'miss_count'} <= keys
        assert call(probe, Trigger, 'sim/reset', Trigger.Request()).success

    def test_faults_of_the_sim_are_set_live_and_refused_with_a_reason(self, robot: Shared) -> None:
        probe, _ = robot
        states = probe.listen(JointState, 'joint_states')
        await_that(lambda: len(states) > 10, 'states')
        set_parameters(probe, 'sim', {'state_loss': 1.0})

        def silent() -> bool:
            received = len(states)
            time.sleep(100.0 * PERIOD / 1e9)
            return len(states) == received

        await_that(silent, 'a time in which a hundred states are lost')
        set_parameters(probe, 'sim', {'state_loss': 0.0})
        await_that(lambda: not silent(), 'states again')
        for values, words in (
            ({'frozen_joint': 8}, ('8', '7')),
            ({'state_loss': 2.0}, ('2', '1')),
            ({'plant': 'mujoco'}, ('plant',)),
        ):
            with pytest.raises(CallError) as refusal:
                set_parameters(probe, 'sim', values)
            assert all(word in str(refusal.value) for word in words), refusal.value

    def test_the_sim_names_a_second_publisher_and_takes_no_commands(self, robot: Shared) -> None:
        probe, lines = robot
        states = probe.listen(JointState, 'joint_states')
        await_that(lambda: len(states) > 10, 'states')
        rivals = [
            probe.create_publisher(JointState, 'joint_command', QoSProfile(depth=1))
            for _ in range(2)
        ]

        def refused() -> bool:
            for rival in rivals:
                rival.publish(states[-1])
            return any('2 publishers' in line for line in lines())

        await_that(refused, '2 publishers')
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
