"""Who may find the nodes: this host, unless the user says otherwise."""

import os
from pathlib import Path

import pytest

pytest.importorskip('rclpy', reason='needs ROS 2: pip install .[test]')

from graph_helpers import Probe, await_that, udp_sockets
from sensor_msgs.msg import JointState

from redres_ros.demo.processes import NodeProcess
from redres_ros.nodes import discovery
from redres_ros.nodes.discovery import own_domain
from redres_ros.nodes.runtime import spun

RANGE = 'ROS_AUTOMATIC_DISCOVERY_RANGE'
PROFILE = 'FASTRTPS_DEFAULT_PROFILES_FILE'
LOOPBACK = '0100007F'  # 127.0.0.1 as the kernel writes it
MULTICAST = '0100FFEF'  # 239.255.0.1, where participants look for each other


@pytest.fixture
def nothing_set(monkeypatch: pytest.MonkeyPatch) -> None:
    """An environment that says nothing about discovery, and is put back afterwards."""
    monkeypatch.setattr(os, 'environ', dict(os.environ))
    for name in discovery.CHOICES:
        os.environ.pop(name, None)


@pytest.mark.usefixtures('nothing_set')
@pytest.mark.parametrize('name', [RANGE, PROFILE, 'ROS_STATIC_PEERS'])
def test_what_the_user_says_of_discovery_stays(name: str) -> None:
    os.environ[name] = 'as the user has it'
    discovery.prepare()
    chosen = {name: os.environ[name] for name in discovery.CHOICES if name in os.environ}
    assert chosen == {name: 'as the user has it'}


@pytest.mark.usefixtures('nothing_set')
def test_another_dds_is_asked_to_stay_on_this_host_too(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(
        discovery, 'get_rmw_implementation_identifier', lambda: 'rmw_cyclonedds_cpp'
    )
    discovery.prepare()
    assert os.environ[RANGE] == 'LOCALHOST'
    assert PROFILE not in os.environ


def udp_addresses(pid: int) -> set[str]:
    """The local addresses of a process's UDP sockets, as the kernel writes them."""
    return {row[1].split(':')[0] for row in udp_sockets(pid)}


@pytest.mark.slow
def test_nodes_listen_on_this_host_alone_and_programs_here_find_them(tmp_path: Path) -> None:
    with own_domain():
        sim = NodeProcess('sim', tmp_path / 'sim.log', {})
        del os.environ[PROFILE]  # the listener is one that looks for everybody
        os.environ[RANGE] = 'SUBNET'
        try:
            with spun(Probe) as probe:
                states = probe.listen(JointState, 'joint_states')
                await_that(lambda: len(states) > 3, 'states of the sim')
            assert LOOPBACK in udp_addresses(sim.pid)
            assert udp_addresses(sim.pid) <= {LOOPBACK, MULTICAST}
            assert '/dev/shm/fastrtps' not in Path(f'/proc/{sim.pid}/maps').read_text()
        finally:
            sim.end()
