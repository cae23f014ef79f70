"""The graph of a demo or a test is found on this host alone."""

import os
from pathlib import Path

import pytest

pytest.importorskip('rclpy', reason='needs ROS 2: pip install .[test]')

from graph_helpers import Probe, await_that, udp_sockets
from sensor_msgs.msg import JointState

from redres_ros.demo.processes import NodeProcess
from redres_ros.errors import RedresError
from redres_ros.nodes import runtime
from redres_ros.nodes.runtime import own_domain, spun

LOOPBACK = '0100007F'  # 127.0.0.1 as the kernel writes it
MULTICAST = '0100FFEF'  # 239.255.0.1, where participants look for each other


def test_a_domain_is_set_for_a_block_alone(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv('ROS_DOMAIN_ID', '3')
    with own_domain(7):
        assert os.environ['ROS_DOMAIN_ID'] == '7'
    assert os.environ['ROS_DOMAIN_ID'] == '3'


@pytest.mark.parametrize('name', ['', 'ROS_AUTOMATIC_DISCOVERY_RANGE', 'ROS_STATIC_PEERS'])
def test_nodes_stay_on_this_host_unless_the_user_says_otherwise(name, monkeypatch):
    monkeypatch.setattr(os, 'environ', dict(os.environ, ROS_DOMAIN_ID='none'))
    for known in runtime._DISCOVERY:
        os.environ.pop(known, None)
    if name:
        os.environ[name] = 'as the user has it'
    with pytest.raises(RedresError, match='ROS_DOMAIN_ID'):
        runtime.start()
    chosen = {known for known in runtime._DISCOVERY if known in os.environ}
    assert chosen == ({name} if name else {runtime._RANGE, runtime._PROFILE})


def udp_addresses(pid: int) -> set[str]:
    """The local addresses of a process's UDP sockets, as the kernel writes them."""
    return {row[1].split(':')[0] for row in udp_sockets(pid)}


@pytest.mark.slow
def test_nodes_listen_on_this_host_alone_and_programs_here_find_them(tmp_path: Path) -> None:
    with own_domain() as domain:
        sim = NodeProcess('sim', tmp_path / 'sim.log', {})
        with own_domain() as other:
            assert other != domain
        del os.environ['FASTRTPS_DEFAULT_PROFILES_FILE']  # of one that looks for everybody
        try:
            with spun(Probe) as probe:
                states = probe.listen(JointState, 'joint_states')
                await_that(lambda: len(states) > 3, 'states of the sim')
            assert LOOPBACK in udp_addresses(sim.pid)
            assert udp_addresses(sim.pid) <= {LOOPBACK, MULTICAST}
            assert '/dev/shm/fastrtps' not in Path(f'/proc/{sim.pid}/maps').read_text()
        finally:
            sim.end()
