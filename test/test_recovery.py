"""What happens when the robot or the controller dies while the arm moves, and how it comes back.

Real nodes over real DDS. At 100 Hz, and the robot's clock stands still for a late command, so that
what is tested is the fault and not the machine. Times of recovery are those of that clock. Other
faults are tested in virtual time (test_fault_matrix.py).
"""

import os
import signal
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pytest

pytest.importorskip('rclpy', reason='needs ROS 2: pip install .[test]')

from graph_helpers import PATIENCE, Observer, await_that, graph, log_lines, write_task

from redres_ros import load_task
from redres_ros.demo.processes import NodeProcess

pytestmark = pytest.mark.realtime

ALL = {'rate': 100.0, 'robot': 'lwr4_paper'}
OWN: dict[str, dict[str, Any]] = {
    'controller': {'robot_interface': 'sim'},
    'sim': {'patience': 2.0},  # [s] for a command, before cycles count as missed
}
SIDE = ((0.0, 0.0, 0.0), (0.0, -0.1, 0.0))  # [m], far from the stretched arm and joint limits

# [s] at most from sim/reset to command mode: 100 good packets, a new word, monitor_time
RECOVERY = 6.0
# [s] at most from the loss of a part to rest: bridging or command_timeout, then braking
STANDSTILL = 1.5


class Graph(NamedTuple):
    """The three nodes at work, the arm moving; start(name, log) starts another process of one."""

    observer: Observer
    processes: dict[str, NodeProcess]
    start: Callable[[str, str], NodeProcess]
    directory: Path

    def count(self, words: str) -> int:
        """How many lines of the controller have these words."""
        return sum(words in line for line in log_lines(self.directory, 'controller'))

    def silences(self) -> int:
        return self.count('no joint_states')

    def kill(self, name: str) -> None:
        """SIGKILL: no last words."""
        os.kill(self.processes[name].pid, signal.SIGKILL)
        self.processes[name].wait(PATIENCE)

    def await_going_on(self) -> None:
        observer = self.observer
        await_that(lambda: observer.commanding and observer.speed > 0.02, 'motion in command mode')


@pytest.fixture
def moving(tmp_path: Path) -> Iterator[Graph]:
    """A graph whose arm moves; afterwards nothing may have jumped, and no node have failed."""
    waypoints = load_task('rectangle').waypoints[0] + np.array(200 * SIDE)  # ten minutes
    task = write_task(tmp_path / 'endless.yaml', waypoints, 1.5)
    with graph(Observer) as (observer, start):
        own = OWN | {'planner': {'autostart': True, 'task': task}}

        def start_one(name: str, log: str) -> NodeProcess:
            return start(name, tmp_path / f'{log}.log', **ALL, **own[name])

        moving = Graph(observer, {name: start_one(name, name) for name in own}, start_one, tmp_path)
        moving.await_going_on()
        await_that(lambda: bool(observer.commands), 'commands')
        yield moving
        observer.assert_all_was_well()
    assert not any('Traceback' in path.read_text() for path in tmp_path.glob('*.log'))


def test_a_robot_that_starts_again_is_followed_without_restarting_anything(moving: Graph) -> None:
    observer = moving.observer
    observer.assert_all_was_well()
    # Only then it notices the next one.
    await_that(
        lambda: moving.count('states of the robot accepted again') == moving.silences(),
        'the end of the silence before the robot was there',
    )
    silences = moving.silences()
    moving.kill('sim')
    await_that(lambda: moving.silences() > silences, 'the silence')
    observer.states.clear()
    observer.commands.clear()
    killed = observer.at
    moving.start('sim', 'sim_2')
    observer.await_command_mode(killed + 1)
    await_that(lambda: len(observer.states) > 1 and bool(observer.commands), 'the new robot')
    moving.await_going_on()
    assert not log_lines(moving.directory, 'sim_2')
    moving.processes['controller'].check()
    moving.processes['planner'].check()


def test_a_controller_that_was_killed_is_succeeded_by_another_one(moving: Graph) -> None:
    observer = moving.observer
    killed = observer.at
    moving.kill('controller')
    await_that(lambda: not observer.commanding and bool(observer.reasons[-1]), 'a stop')
    assert 'timing' in observer.reasons[-1]
    assert observer.await_standstill(killed) < STANDSTILL
    commands = len(observer.commands)
    moving.start('controller', 'controller_2')
    await_that(lambda: len(observer.commands) > commands, 'commands')
    assert not observer.commanding  # before somebody has seen to it
    assert observer.reset() < RECOVERY
    moving.await_going_on()
