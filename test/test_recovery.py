"""What happens when a part of the graph fails or misbehaves while the arm moves, and how it comes
back.

Real nodes over real DDS. At 100 Hz, and the robot's clock stands still for a late command, so that
what is tested is the fault and not the machine. Times of recovery are those of that clock. What a
robot does that waits for nobody is tested in virtual time (test_fault_matrix.py).
"""

import os
import signal
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pytest
import yaml

pytest.importorskip('rclpy', reason='needs ROS 2: pip install .[test]')

from graph_helpers import (
    PATIENCE,
    Observer,
    await_that,
    graph,
    log_lines,
    set_parameters,
)

from redres_ros import load_task
from redres_ros.demo.processes import NodeProcess

pytestmark = pytest.mark.realtime

RATE = 100.0  # [Hz]
ALL = {'rate': RATE, 'robot': 'lwr4_paper'}
STALL = 2.0  # [s] for which the robot waits for a command before it counts cycles as missed
OWN = {
    'controller': {'robot_interface': 'sim'},
    'sim': {'patience': STALL},
    'planner': {'autostart': True},
}
SIDE = np.array(
    ((0.0, 0.0, 0.0), (0.0, -0.1, 0.0))
)  # [m] to and fro, far from the stretched arm and joint limits

# [s] at most from sim/reset to command mode: 100 good packets, a new word, monitor_time
RECOVERY = 6.0
# [s] at most from the loss of a part to rest: bridging or command_timeout, then braking
STANDSTILL = 1.5


class Graph(NamedTuple):
    """The three nodes at work, the arm moving; start(name) starts another process of one."""

    observer: Observer
    processes: dict[str, NodeProcess]
    start: Callable[[str], NodeProcess]
    directory: Path

    def assert_undisturbed(self) -> None:
        """The robot has taken commands all the time since it began to."""
        assert not any(self.observer.reasons), self.observer.reasons
        assert [state for _, state in self.observer.session if state == 'CMD'] == ['CMD']

    def lines(self, name: str, words: str) -> int:
        """How many lines of the logs of all processes of a node hold these words."""
        logs = self.directory.glob(f'{name}*.log')
        return sum(words in line for log in logs for line in log.read_text().splitlines())

    def await_states(self, name: str) -> None:
        """Wait until a node has received states for a while, and will notice their end."""

        def received() -> bool:
            silences = self.lines(name, 'no joint_states')
            return self.lines(name, 'states of the robot accepted again') == silences

        await_that(received, f'states at the {name}')

    def kill(self, name: str) -> None:
        """SIGKILL: no last words."""
        os.kill(self.processes[name].pid, signal.SIGKILL)
        self.processes[name].wait(PATIENCE)

    def await_stop(self, *words: str) -> None:
        """Wait for the robot to stop, with these words in its reason."""
        await_that(
            lambda: not self.observer.commanding and bool(self.observer.reasons[-1]), 'a stop'
        )
        assert all(word in self.observer.reasons[-1] for word in words), self.observer.reasons[-1]


def endless_task(directory: Path) -> Path:
    """A file with ten minutes of motion."""
    task = load_task('rectangle')
    path = directory / 'endless.yaml'
    waypoints = [(task.waypoints[0] + point).tolist() for _ in range(200) for point in SIDE]
    path.write_text(
        yaml.safe_dump(
            {
                'robot': task.robot,
                'start': np.degrees(task.start).tolist(),
                'segment_time': 1.5,
                'waypoints': waypoints,
            }
        )
    )
    return path


@contextmanager
def moving_graph(directory: Path, **sim: float) -> Iterator[Graph]:
    """A graph in command mode whose arm moves; afterwards nothing may have jumped, and no node have
    failed.

    sim: what is set in the sim besides.
    """
    with graph(Observer) as (observer, start):
        counts: dict[str, int] = {}
        processes: dict[str, NodeProcess] = {}
        own = OWN | {
            'sim': {**OWN['sim'], **sim},
            'planner': {**OWN['planner'], 'task': str(endless_task(directory))},
        }

        def start_one(name: str) -> NodeProcess:
            counts[name] = counts.get(name, 0) + 1
            log = name if counts[name] == 1 else f'{name}_{counts[name]}'
            return start(name, directory / f'{log}.log', **ALL, **own[name])

        processes.update({name: start_one(name) for name in OWN})
        observer.await_command_mode()
        observer.await_motion()
        await_that(lambda: bool(observer.commands), 'commands')
        yield Graph(observer, processes, start_one, directory)
        observer.assert_all_was_well()
    assert not any('Traceback' in path.read_text() for path in directory.glob('*.log'))


def await_going_on(observer: Observer) -> None:
    """Wait until the arm moves in command mode again."""
    await_that(lambda: observer.commanding and observer.speed > 0.02, 'motion in command mode')


@pytest.fixture(scope='class')
def moving(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Graph]:
    """The arm moves."""
    with moving_graph(tmp_path_factory.mktemp('moving')) as shared:
        yield shared


class TestStopped:
    """What stops the robot, and lets reset bring it back. These tests share one graph."""

    def test_commands_that_get_lost_stop_the_arm_and_reset_lets_it_go_on(
        self, moving: Graph
    ) -> None:
        observer = moving.observer
        lost = moving.observer.at
        set_parameters(observer, 'sim', {'command_loss': 1.0})
        moving.await_stop('timing')
        assert observer.await_standstill(lost) < STANDSTILL
        set_parameters(observer, 'sim', {'command_loss': 0.0})
        assert observer.reset() < RECOVERY
        await_going_on(observer)

    def test_a_robot_that_starts_again_is_followed_without_restarting_anything(
        self, moving: Graph
    ) -> None:
        observer = moving.observer
        observer.assert_all_was_well()
        moving.await_states('controller')
        silences = moving.lines('controller', 'no joint_states')
        moving.kill('sim')
        await_that(lambda: moving.lines('controller', 'no joint_states') > silences, 'the silence')
        observer.states.clear()
        observer.commands.clear()
        killed = observer.at
        moving.processes['sim'] = moving.start('sim')
        observer.await_command_mode(killed + 1)
        await_that(lambda: len(observer.states) > 1 and bool(observer.commands), 'the new robot')
        await_going_on(observer)
        assert not log_lines(moving.directory, 'sim_2')
        moving.processes['controller'].check()
        moving.processes['planner'].check()

    def test_a_controller_that_was_killed_is_succeeded_by_another_one(self, moving: Graph) -> None:
        observer = moving.observer
        killed = moving.observer.at
        moving.kill('controller')
        moving.await_stop('timing')
        assert observer.await_standstill(killed) < STANDSTILL
        commands = len(observer.commands)
        moving.start('controller')
        await_that(lambda: len(observer.commands) > commands, 'commands')
        assert not observer.commanding  # before somebody has seen to it
        assert observer.reset() < RECOVERY
        await_going_on(observer)


@pytest.fixture(scope='class')
def undisturbed(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Graph]:
    """The arm moves, and goes on moving."""
    with moving_graph(tmp_path_factory.mktemp('undisturbed'), patience=PATIENCE) as shared:
        yield shared
        assert set(shared.observer.filter_counts) == {0}


class TestUndisturbed:
    """What does not stop a robot that waits for commands. These tests share one graph."""

    def test_a_planner_that_dies_lets_the_arm_come_to_rest_in_command_mode(
        self, undisturbed: Graph
    ) -> None:
        observer = undisturbed.observer
        undisturbed.kill('planner')
        assert observer.await_standstill(observer.at) < STANDSTILL
        undisturbed.assert_undisturbed()
        undisturbed.processes['planner'] = undisturbed.start('planner')
        await_going_on(observer)
        undisturbed.assert_undisturbed()
