"""A task runs again and again: joints go to its start first. The real nodes, in virtual time."""

from collections.abc import Iterator

import numpy as np
import pytest

pytest.importorskip('rclpy', reason='needs ROS 2: pip install .[test]')

from virtual_graph import VirtualRun, virtual_run

from redres_ros import LAWS, RobotModel
from redres_ros.planning.task_executor import TaskState
from redres_ros.robots import ARMS

pytestmark = pytest.mark.slow

THERE = 0.02  # [rad]


def state(run: VirtualRun) -> TaskState:
    return run.nodes['planner']._run.state


def from_start(run: VirtualRun) -> float:
    """Distance of the joint farthest from the start of the task [rad]."""
    distance: float = np.abs(
        run.nodes['sim']._robot.plant.q - run.nodes['planner']._task.start
    ).max()
    return distance


def run_once(run: VirtualRun) -> None:
    response = run.graph.call('planner/start')
    assert response.success, response.message
    over = (TaskState.FINISHED, TaskState.STUCK, TaskState.IDLE)
    assert run.run_until(lambda: state(run) in over, 120.0)
    assert state(run) is TaskState.FINISHED, run.graph.log[-3:]
    assert run.commanding


def run_with_a_switch_and_a_hold(run: VirtualRun, law: str) -> None:
    assert run.set('controller', law=law)
    run_once(run)
    run.graph.call('controller/hold', data=True)
    run.run(1.0)
    run.graph.call('controller/hold', data=False)
    run_once(run)


@pytest.fixture
def run() -> Iterator[VirtualRun]:
    """A graph whose arm is where its task has ended."""
    with virtual_run() as run:
        run.run(0.5)
        run_once(run)
        yield run


def test_with_the_default_law_a_task_is_run_again_after_a_law_switch_and_a_hold(
    run: VirtualRun,
) -> None:
    assert from_start(run) > 1.0  # this law leaves the posture in which it began
    run_with_a_switch_and_a_hold(run, 'minimum_velocity')


@pytest.mark.nightly
@pytest.mark.parametrize('law', LAWS)
@pytest.mark.parametrize('robot', ARMS)
def test_every_task_runs_again_with_every_law_after_a_switch_and_a_hold(
    robot: str, law: str
) -> None:
    with virtual_run(robot=robot) as run:
        run.run(0.5)
        run_with_a_switch_and_a_hold(run, law)


def test_stop_on_the_way_home_brings_the_joints_to_rest(run: VirtualRun) -> None:
    run.graph.call('planner/home')
    run.run(1.0)
    assert 'comes to rest' in run.graph.call('planner/stop').message
    run.run(1.0)
    q = run.nodes['sim']._robot.plant.q.copy()
    run.run(1.0)
    assert state(run) is TaskState.IDLE
    assert from_start(run) > THERE
    assert np.abs(run.nodes['sim']._robot.plant.q - q).max() < 1e-6


def test_an_obstacle_on_the_way_home_is_not_hit_and_named(run: VirtualRun) -> None:
    """A sphere where the tip would be half way; the motion is given up before it."""
    model = RobotModel.named('lwr4_paper')
    q = run.nodes['sim']._robot.plant.q.copy()
    x, _ = model.tip((q + run.nodes['planner']._task.start) / 2.0)
    changes = {
        'limits': ['position', 'velocity', 'acceleration', 'collision'],
        'scene.obstacles': f'sphere {x[0]} {x[1]} {x[2]} 0.05',
    }
    assert run.set('controller', **changes)
    run.run(0.5)
    run.nodes['planner']._run.monitor.stuck_after = 1.0
    run.nodes['planner']._run.monitor.give_up_after = 3.0
    run.graph.call('planner/home')
    nearest = np.inf
    while state(run) not in (TaskState.STUCK, TaskState.FINISHED):
        run.run(0.1)
        tip, _ = model.tip(run.nodes['sim']._robot.plant.q)
        nearest = min(nearest, float(np.linalg.norm(tip - x)))
    assert state(run) is TaskState.STUCK
    assert nearest > 0.05
    assert any('no progress' in line and 'collision' in line for _, line in run.graph.log)
