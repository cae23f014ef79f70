"""Another vendor's DDS takes part: the nodes use nothing that only Fast DDS has."""

import importlib.util
import json
import os
from pathlib import Path

import pytest
from programs import run_python

pytest.importorskip('rclpy', reason='needs ROS 2: pip install .[test]')

from graph_helpers import NAMES, PATIENCE

from redres_ros.demo.processes import NodeProcess
from redres_ros.nodes.runtime import own_domain

pytestmark = [
    pytest.mark.nightly,
    pytest.mark.skipif(
        importlib.util.find_spec('cyclonedds') is None,
        reason='needs another DDS: pip install cyclonedds',
    ),
]

SCRIPT = Path(__file__).with_name('other_dds.py')


def test_without_ros_it_receives_states_and_commands_and_steers_the_arm(tmp_path: Path) -> None:
    with own_domain() as domain:
        nodes = [
            NodeProcess('sim', tmp_path / 'sim.log', {'patience': PATIENCE}),
            NodeProcess('controller', tmp_path / 'controller.log', {}),
        ]
        try:
            done = run_python(SCRIPT, domain, '1000', env={**os.environ, 'PYTHONPATH': ''})
        finally:
            for node in nodes:
                node.end()
    assert done.returncode == 0, done.stderr
    found = json.loads(done.stdout)
    assert found['ros'] is False
    assert tuple(found['joints']) == NAMES
    assert found['returned'] > 100  # on a busy machine not every state is
    assert found['moved'] > 0.01  # [rad]
