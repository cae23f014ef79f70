"""Who may find the nodes: this host, unless the user says otherwise."""

import os

import pytest

pytest.importorskip('rclpy', reason='needs ROS 2: pip install .[test]')

import rclpy

from redres_ros.demo.processes import own_domain
from redres_ros.nodes.runtime import start

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
