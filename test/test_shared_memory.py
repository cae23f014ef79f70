"""What Fast DDS leaves in /dev/shm: a node that ends leaves nothing, and the dead are tidied up."""

import os
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

pytest.importorskip('rclpy', reason='needs ROS 2: pip install .[test]')

from graph_helpers import PATIENCE, Probe, await_that, graph
from sensor_msgs.msg import JointState

from redres_ros.demo.processes import NodeProcess, own_domain, remember_files
from redres_ros.demo.shared_memory import FOLDER, files_of, files_of_domain, remove_dead

pytestmark = pytest.mark.slow


def await_files(process: NodeProcess) -> set[str]:
    """What a node uses once it listens."""
    until = time.monotonic() + PATIENCE
    used: set[str] = set()
    while time.monotonic() < until and sum('port' in name for name in used) < 2:
        process.check()
        time.sleep(0.2)
        used = files_of(process.pid)
    assert used
    return used


@contextmanager
def domain_with_shared_memory() -> Iterator[int]:
    """A domain whose nodes use shared memory, as where the user says LOCALHOST."""
    with own_domain() as domain:
        del os.environ['FASTRTPS_DEFAULT_PROFILES_FILE']
        os.environ['ROS_AUTOMATIC_DISCOVERY_RANGE'] = 'LOCALHOST'
        yield domain


def left(names: set[str]) -> set[str]:
    """Those of the names that are still there and that nobody else uses by now."""
    others: set[str] = set()
    for entry in Path('/proc').iterdir():
        if entry.name.isdecimal():
            others |= files_of(int(entry.name))
    return {name for name in names if (FOLDER / name).exists()} - others


def test_nodes_that_end_leave_no_shared_memory(tmp_path: Path) -> None:
    with domain_with_shared_memory():
        nodes = [NodeProcess(name, tmp_path / name, {}) for name in ('sim', 'controller')]
        used = set.union(*map(await_files, nodes))
        for node in nodes:
            node.end()
    assert left(used) == set()


def test_on_the_subnet_a_node_uses_none_that_could_be_left(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    with graph(Probe) as (probe, start):
        states = probe.listen(JointState, 'joint_states')
        monkeypatch.setenv('ROS_AUTOMATIC_DISCOVERY_RANGE', 'SUBNET')
        node = start('sim', tmp_path / 'log')
        await_that(lambda: bool(states), 'states')
        assert files_of(node.pid) == set()


def test_what_was_killed_is_tidied_up_at_the_next_start_in_its_domain(tmp_path: Path) -> None:
    with domain_with_shared_memory() as domain:
        node = NodeProcess('controller', tmp_path / 'log', {})
        used = await_files(node)
        remember_files([node.pid])
        os.kill(node.pid, signal.SIGKILL)
        node.wait(PATIENCE)
        assert left(used)
        with own_domain(domain):
            assert left(used) == set()


def test_what_is_alive_is_left_alone(tmp_path: Path) -> None:
    with domain_with_shared_memory() as domain:
        node = NodeProcess('controller', tmp_path / 'log', {})
        used = await_files(node)
        assert remove_dead(used | files_of_domain(domain)) == []
        assert all((FOLDER / name).exists() for name in used)
        node.end()


def test_a_lock_alone_protects_from_being_removed() -> None:
    name = f'fastrtps_{os.getpid():016x}'
    holder = (
        'import fcntl, sys\n'
        f'file = open("{FOLDER}/{name}_el", "ab")\n'
        'fcntl.flock(file, fcntl.LOCK_EX)\n'
        'print(flush=True)\nsys.stdin.read()\n'
    )
    (FOLDER / name).touch()
    try:
        with subprocess.Popen(
            [sys.executable, '-c', holder], stdin=subprocess.PIPE, stdout=subprocess.PIPE
        ) as process:
            assert process.stdout
            process.stdout.readline()
            assert remove_dead([name]) == []
            process.communicate()
        assert remove_dead([name]) == [name]
        assert not (FOLDER / name).exists()
    finally:
        (FOLDER / name).unlink(missing_ok=True)
        (FOLDER / f'{name}_el').unlink(missing_ok=True)
