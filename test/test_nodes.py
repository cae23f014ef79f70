"""The nodes as processes over real DDS: how they start, respond and end."""

import os
import signal
import time
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from programs import run_python

pytest.importorskip('rclpy', reason='needs ROS 2: pip install .[test]')

from graph_helpers import PATIENCE, START, await_that, log_lines, nodes
from nightly import by_day
from rclpy.qos import QoSProfile
from sensor_msgs.msg import JointState

from redres_ros.demo.processes import NodeProcess
from redres_ros.nodes.entry import run_node
from redres_ros.nodes.runtime import own_domain

pytestmark = pytest.mark.slow


SECURED = {  # what somebody sets who wants keys, or no graph at all
    'ROS_SECURITY_ENABLE': 'true',
    'ROS_SECURITY_STRATEGY': 'Enforce',
    'ROS_SECURITY_KEYSTORE': '/no/keys',
}
BAD_STARTS = [  # node, parameter, words that its one line must hold
    ('controller', 'law:=no_such_law', ('no_such_law', 'minimum_acceleration')),
    ('controller', 'damping:=600.0', ('600', '0 to 500')),
    ('controller', 'damping:=.nan', ('damping', 'nan')),
    ('controller', 'rate:=fast', ('rate', 'fast', 'DOUBLE')),
    ('controller', 'rate:=1.0e9', ('rate', '2000')),
    ('controller', 'limits:=none,position', ('none', 'position', 'expected names')),
    ('controller', 'limits:=[0.5]', ('limits', '[0.5]', 'STRING_ARRAY')),
    ('controller', 'robot:=r2d2', ('r2d2', 'lwr4_paper', '.urdf', 'topic')),
    ('controller', 'robot:=/no/such/arm.urdf', ('cannot read /no/such/arm',)),
    ('controller', 'acceleration_limit:=[1.0]', ('has 1 values', 'lwr_a1_joint')),
    ('controller', 'acceleration_limit:=/no/limits.yaml', ('cannot read /no/limits.yaml',)),
    ('controller', 'tip_frame:=nose', ('nose', 'tool0')),
    ('controller', 'bridging:=hold', ('bridging is no parameter any more', 'robot_interface')),
    ('controller', 'use_sim_time:=x', ("'use_sim_time' to 'x'",)),
    ('planner', 'task:=no_such_task', ('no_such_task', 'rectangle')),
    ('planner', 'task:=/no/such/file.yaml', ('/no/such/file.yaml',)),
    ('sim', 'start:=[0.0, 0.0]', ('(2,)', '(7,)')),
    ('sim', 'robot:=topic', ("unknown robot 'topic'", 'lwr4_paper')),
    ('sim', 'start:=[]', ('start is nothing', 'DOUBLE_ARRAY')),
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
    assert run_node(node, ['--ros-args', '-p', parameter]) == 1
    assert_one_line(capfd.readouterr().err, words)


@pytest.mark.parametrize('domain', ['abc', '233', '-1'])
def test_a_domain_that_does_not_exist_is_refused(
    domain: str, as_it_was: None, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setenv('ROS_DOMAIN_ID', domain)
    assert run_node('planner', []) == 1
    assert_one_line(capfd.readouterr().err, ('ROS_DOMAIN_ID', domain, '0 to 232'))


@pytest.mark.parametrize(
    ('environment', 'words'),
    by_day(1, [({'RMW_IMPLEMENTATION': 'rmw_none'}, ('rmw_none',)), (SECURED, ('/no/keys',))]),
)
def test_a_process_of_a_node_that_cannot_start_ends_with_a_status_and_one_line(
    environment: dict[str, str], words: tuple[str, ...]
) -> None:
    variables = {**os.environ, **environment}
    done = run_python('-m', 'redres_ros.nodes.entry', 'planner', env=variables)
    assert done.returncode not in (0, -signal.SIGKILL)
    assert_one_line(done.stderr, words)


def test_every_node_ends_with_status_0_on_a_signal(tmp_path: Path) -> None:
    numbers = {'sim': signal.SIGINT, 'controller': signal.SIGTERM, 'planner': signal.SIGINT}
    with nodes(tmp_path, sim={}, controller={}, planner={}) as (probe, processes):
        await_that(lambda: numbers.keys() <= set(probe.get_node_names()), 'the nodes')
        for name, number in numbers.items():
            os.kill(processes[name].pid, number)
        assert {process.wait(PATIENCE) for process in processes.values()} == {0}
    for name in processes:
        assert 'Traceback' not in (tmp_path / f'{name}.log').read_text()


def test_the_sim_names_a_second_publisher_and_takes_no_commands(tmp_path: Path) -> None:
    with nodes(tmp_path, sim={'plant': 'ideal'}) as (probe, _):
        states = probe.listen(JointState, 'joint_states')
        await_that(lambda: len(states) > 10, 'states')
        rivals = [
            probe.create_publisher(JointState, 'joint_command', QoSProfile(depth=1))
            for _ in range(2)
        ]

        def refused() -> bool:
            for rival in rivals:
                rival.publish(states[-1])
            return any('2 publishers' in line for line in log_lines(tmp_path, 'sim'))

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


def test_states_of_another_broadcaster_on_the_topic_displace_none_of_the_arm(
    tmp_path: Path,
) -> None:
    fingers = JointState(name=['left', 'right'], position=[0.0, 0.0])
    with nodes(tmp_path, controller={}) as (probe, _):
        probe.ask(START)
        probe.send(fingers)
        probe.ask(START)
        probe.settle()
        begin = len(probe.responses)
        for _ in range(100):
            probe.send(probe.state(START))
            probe.send(fingers)
            time.sleep(0.01)
        probe.settle()
        assert len(probe.responses) - begin > 80  # without care about 20
