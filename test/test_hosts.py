"""The robot on one host and its client on another: two network namespaces, joined by a virtual
cable that is cut.
"""

import os
import shutil
import signal
import subprocess
import sys
from collections.abc import Iterator
from contextlib import ExitStack
from pathlib import Path

import pytest

pytest.importorskip('rclpy', reason='needs ROS 2: pip install .[test]')

from graph_helpers import PATIENCE

pytestmark = [pytest.mark.nightly, pytest.mark.realtime]

ROS = {
    'ROS_DOMAIN_ID': '7',
    'ROS_AUTOMATIC_DISCOVERY_RANGE': 'SUBNET',
}  # the namespaces are ours alone
PARAMETERS = (
    'rate:=100.0',
    'patience:=2.0',
    'dynamics:=identified',
    'autostart:=true',
)
RECOVERY = 6.0  # [s] on the robot's clock, as for a fault on one host

# Runs beside the robot. Its lines are what the test knows: session states as they come, and how the
# arm is.
OBSERVER = """
import sys, threading
from graph_helpers import Observer, await_that
from redres_ros.nodes.runtime import spun
with spun(Observer) as observer:
    for line in sys.stdin:
        match line.strip():
            case 'await command': print(f'{observer.await_command_mode():.3f}', flush=True)
            case 'await motion': observer.await_motion(); print('moves', flush=True)
            case 'await stop':
                await_that(
                    lambda: not observer.commanding and observer.reasons and observer.reasons[-1],
                    'a stop',
                )
                print(observer.reasons[-1], flush=True)
            case 'await rest': print(f'{observer.await_standstill(observer.at):.3f}', flush=True)
            case 'reset': print(f'{observer.reset():.3f}', flush=True)
            case 'check': observer.assert_all_was_well(); print('well', flush=True)
"""


def run(*command: str) -> None:
    """A command of iproute2. Raises with what it said."""
    done = subprocess.run(command, text=True, capture_output=True, check=False)
    if done.returncode:
        raise OSError(f'{" ".join(command)}: {done.stderr.strip()}')


@pytest.fixture
def hosts() -> Iterator[tuple[str, str]]:
    """Names of two namespaces at the ends of a cable; skips where they are not permitted."""
    if shutil.which('ip') is None:
        pytest.skip('there is no ip command: install iproute2')
    names = tuple(f'redres_{end}_{os.getpid()}' for end in ('robot', 'client'))
    with ExitStack() as stack:
        try:
            for name in names:
                run('ip', 'netns', 'add', name)
                stack.callback(run, 'ip', 'netns', 'delete', name)
            run(
                'ip',
                '-n',
                names[0],
                'link',
                'add',
                'cable',
                'type',
                'veth',
                'peer',
                'name',
                'cable',
                'netns',
                names[1],
            )
            for number, name in enumerate(names, 1):
                run('ip', '-n', name, 'address', 'add', f'10.77.0.{number}/24', 'dev', 'cable')
                for link in ('lo', 'cable'):
                    run('ip', '-n', name, 'link', 'set', link, 'up')
                run(
                    'ip', '-n', name, 'route', 'add', 'default', 'dev', 'cable'
                )  # multicast goes there too
        except OSError as error:
            pytest.skip(f'network namespaces are not permitted here: {error}')
        yield names


class Observer:
    """The program above in a namespace."""

    def __init__(self, host: str, log: Path) -> None:
        paths = (str(Path(__file__).parent), os.environ.get('PYTHONPATH', ''))
        environment = {**os.environ, **ROS, 'PYTHONPATH': os.pathsep.join(filter(None, paths))}
        self._log = log
        self._process = subprocess.Popen(
            ['ip', 'netns', 'exec', host, sys.executable, '-c', OBSERVER],
            text=True,
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=log.open('w'),
            env=environment,
        )

    def ask(self, what: str) -> str:
        """Its response."""
        print(what, file=self._process.stdin, flush=True)
        response = self._process.stdout.readline().strip()
        assert response, self._log.read_text()
        return response

    def end(self) -> None:
        """End it."""
        self._process.stdin.close()
        self._process.wait(PATIENCE)


def start(host: str, node: str, log: Path) -> subprocess.Popen[bytes]:
    """A node in a namespace."""
    command = [
        'ip',
        'netns',
        'exec',
        host,
        sys.executable,
        '-m',
        f'redres_ros.nodes.{node}',
        '--ros-args',
    ]
    command += [word for parameter in PARAMETERS for word in ('-p', parameter)]
    return subprocess.Popen(
        command, stdout=log.open('wb'), stderr=subprocess.STDOUT, env={**os.environ, **ROS}
    )


def end(process: subprocess.Popen[bytes]) -> None:
    process.send_signal(signal.SIGINT)
    assert process.wait(PATIENCE) == 0


def test_a_cable_that_is_cut_stops_the_arm_and_reset_brings_it_back(
    hosts: tuple[str, str], tmp_path: Path
) -> None:
    robot, client = hosts
    with ExitStack() as stack:
        for host, node in ((robot, 'sim'), (client, 'controller'), (client, 'planner')):
            stack.callback(end, start(host, node, tmp_path / f'{node}.log'))
        observer = Observer(robot, tmp_path / 'observer.log')
        stack.callback(observer.end)
        assert float(observer.ask('await command')) > 0.0
        assert observer.ask('await motion') == 'moves'
        run('ip', '-n', robot, 'link', 'set', 'cable', 'down')
        assert 'timing' in observer.ask('await stop')
        run('ip', '-n', robot, 'link', 'set', 'cable', 'up')
        run('ip', '-n', robot, 'route', 'replace', 'default', 'dev', 'cable')  # went with the link
        observer.ask('await rest')
        assert 0.0 < float(observer.ask('reset')) < RECOVERY
        assert observer.ask('await motion') == 'moves'
        assert observer.ask('check') == 'well'
    lines = (tmp_path / 'controller.log').read_text()
    assert 'no joint_states' in lines and 'joint_states is back' in lines
