"""Who may find the nodes: this host, unless the user says otherwise."""

import os
from pathlib import Path

import pytest

pytest.importorskip('rclpy', reason='needs ROS 2: pip install .[test]')

import rclpy
from graph_helpers import Probe, await_that
from sensor_msgs.msg import JointState

from redres_ros.demo.processes import NodeProcess, own_domain
from redres_ros.nodes.runtime import spun, start

RANGE = 'ROS_AUTOMATIC_DISCOVERY_RANGE'


@pytest.mark.parametrize(
    ('given', 'expected'),
    [
        ({}, 'LOCALHOST'),
        ({RANGE: 'SUBNET'}, 'SUBNET'),
        ({'ROS_STATIC_PEERS': '127.0.0.1'}, None),
    ],
)
def test_nodes_stay_on_this_host_unless_the_user_says_otherwise(
    given: dict[str, str], expected: str | None
) -> None:
    with own_domain():  # which puts the environment back afterwards
        del os.environ[RANGE]
        os.environ.update(given)
        start([])
        rclpy.try_shutdown()
        assert os.environ.get(RANGE) == expected


@pytest.mark.slow
def test_programs_on_this_host_find_the_nodes_whatever_they_are_set_to(tmp_path: Path) -> None:
    with own_domain():
        del os.environ[RANGE]
        sim = NodeProcess('sim', tmp_path / 'sim.log', {})
        os.environ[RANGE] = 'SUBNET'  # as ROS has it where nothing is set
        try:
            with spun(Probe) as probe:
                states = probe.listen(JointState, 'joint_states')
                await_that(lambda: len(states) > 3, 'states of the sim')
        finally:
            sim.end()
