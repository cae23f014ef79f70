"""What the planner takes for a goal, and what ends one: the real nodes, in virtual time."""

import time
from collections.abc import Iterator
from copy import deepcopy
from typing import Any

import numpy as np
import pytest

pytest.importorskip('rclpy', reason='needs ROS 2: pip install .[test]')

from diagnostic_msgs.msg import DiagnosticArray
from std_msgs.msg import String
from virtual_graph import VirtualRun, virtual_run

from redres_ros import RobotModel
from redres_ros.nodes.conversions import to_nanoseconds, to_pose, to_time
from redres_ros.planning.task_executor import TaskState

pytestmark = pytest.mark.slow

LOOP = {'rate': 100.0}
SIM = {**LOOP, 'patience': 0.0, 'plant': 'ideal', 'monitor_time': 0.1}
SIDEWAYS = np.array((0.0, -0.1, 0.05))  # [m]
SECOND = 1_000_000_000  # [ns]
STILL = 1e-6  # [rad] by which an arm at rest moves: rounding


@pytest.fixture
def run() -> Iterator[VirtualRun]:
    """A robot in command mode whose planner waits for a goal."""
    with virtual_run(sim=SIM, controller=LOOP, planner=LOOP) as made:
        made.graph.kept['/diagnostics'] = []
        made.run(0.5)
        assert made.commanding
        yield made


def position(run: VirtualRun) -> np.ndarray:
    """Of the robot's joints, (n,) [rad]."""
    return run.nodes['sim']._robot.plant.q.copy()


def state(run: VirtualRun) -> TaskState:
    return run.nodes['planner']._run.state


def send_target(run: VirtualRun, *, stamp: int = 0, way: np.ndarray = SIDEWAYS) -> None:
    """Publish a target that lies a way (3,) [m] from the tip."""
    model = RobotModel.named('lwr4_paper')
    x, R = model.tip(position(run))
    run.graph.publish('target_pose', to_pose(stamp, '', x + way, R))


def now(run: VirtualRun) -> int:
    """Stamp of the newest state that the planner got [ns]."""
    return run.nodes['planner']._stamp


def logged(run: VirtualRun, *words: str) -> bool:
    """Whether a line of the planner's log has all of these words."""
    lines = [line for node, line in run.graph.log if node == 'planner']
    return any(all(word in line for word in words) for line in lines)


def diagnosed(run: VirtualRun, *words: str) -> bool:
    """Whether the planner's newest status has all of these words."""
    run.run(1.1)
    statuses = [
        message.status[0].message
        for _, message in run.graph.kept['/diagnostics']
        if isinstance(message, DiagnosticArray) and message.status[0].name == '/planner'
    ]
    return all(word in statuses[-1] for word in words)


def assert_nothing_moves(run: VirtualRun, seconds: float = 1.0) -> None:
    q = position(run)
    run.run(seconds)
    assert np.abs(position(run) - q).max() < STILL


def drop(message: Any, time: float) -> list[tuple[float, Any]]:
    return []


# --- what is refused ------------------------------------------------------------------------------


@pytest.mark.parametrize('age', [3000.0, 1.5, -1.5])
def test_a_target_of_another_time_is_refused_with_its_age(run: VirtualRun, age: float) -> None:
    send_target(run, stamp=now(run) - round(age * SECOND))
    assert_nothing_moves(run)
    side = 'behind' if age > 0.0 else 'ahead of'
    assert logged(run, 'target_pose refused', side, 'a zero stamp')
    assert diagnosed(run, 'target_pose refused', side)


@pytest.mark.parametrize('age', [0.0, 0.5])
def test_a_target_of_now_is_taken(run: VirtualRun, age: float) -> None:
    send_target(run, stamp=now(run) - round(age * SECOND))
    run.run(0.5)
    assert state(run) is TaskState.MOVING


def test_a_target_stamped_by_this_computer_is_taken_by_a_robot_whose_clock_is_seconds_behind(
    run: VirtualRun, monkeypatch: pytest.MonkeyPatch
) -> None:
    clock = run.graph.clock
    monkeypatch.setattr(time, 'time_ns', lambda: clock.time_ns() + 3 * SECOND)
    send_target(run, stamp=time.time_ns() - round(1.5 * SECOND))  # old by either clock
    assert_nothing_moves(run)
    send_target(run, stamp=time.time_ns())
    run.run(0.5)
    assert state(run) is TaskState.MOVING


def test_a_zero_stamp_means_now(run: VirtualRun) -> None:
    send_target(run, stamp=0)
    run.run(0.5)
    assert state(run) is TaskState.MOVING


def test_a_target_for_a_robot_that_has_stopped_is_refused_and_never_carried_out(
    run: VirtualRun,
) -> None:
    run.nodes['sim']._session.stop('protective stop: for the test')
    run.run(0.1)
    send_target(run)
    run.run(0.1)
    assert logged(run, 'target_pose refused', 'protective stop: for the test', 'sim/reset')
    run.graph.call('sim/reset')
    assert run.run_until(lambda: run.commanding, 2.0)
    assert_nothing_moves(run)


def test_a_target_out_of_reach_is_refused_with_the_bound(run: VirtualRun) -> None:
    send_target(run, way=np.array((0.0, 50.0, 0.0)))
    run.run(0.1)
    assert state(run) is TaskState.IDLE
    assert logged(run, 'target_pose refused', 'distance from the first joint', '1.3135')
    assert diagnosed(run, 'distance from the first joint')


def test_a_target_before_the_first_state_is_refused() -> None:
    with virtual_run(sim=SIM, controller=LOOP, planner=LOOP) as made:
        made.graph.publish('target_pose', to_pose(0, '', np.array((0.3, 0.3, 0.3)), np.eye(3)))
        assert logged(made, 'target_pose refused', 'no joint_states')
        made.run(1.0)
        assert state(made) is TaskState.IDLE


def test_a_refused_start_has_its_reason_on_the_log_and_on_diagnostics(run: VirtualRun) -> None:
    run.nodes['sim']._session.stop('protective stop: for the test')
    run.run(0.1)
    assert not run.graph.call('planner/start').success
    assert logged(run, 'planner/start refused', 'protective stop: for the test')


def test_nothing_begins_while_the_controller_is_inactive(run: VirtualRun) -> None:
    run.graph.publish('controller/mode', String(data='inactive'), latched=True)
    response = run.graph.call('planner/start')
    assert not response.success
    assert 'the controller is inactive' in response.message


# --- what ends a goal that waits ------------------------------------------------------------------


@pytest.fixture
def waiting(run: VirtualRun) -> VirtualRun:
    """The planner has a target and knows nothing of a controller that would follow."""
    run.graph.publish('controller/mode', String(data='mirroring'))
    for topic in ('controller/mode', 'controller/task_scaling'):
        run.graph.faults[topic, 'planner'] = drop
    run.run(0.5)
    send_target(run)
    run.run(0.2)
    assert state(run) is TaskState.WAITING
    return run


def assert_over(run: VirtualRun, *words: str) -> None:
    """The goal was given up, for a reason that is reported, and is not carried out later."""
    assert logged(run, 'the goal is over', *words)
    assert diagnosed(run, *words)
    run.graph.faults.clear()
    run.graph.call('sim/reset')
    run.run(0.5)
    assert state(run) is TaskState.IDLE
    assert_nothing_moves(run)


def test_a_goal_does_not_wait_longer_than_resume_within(waiting: VirtualRun) -> None:
    waiting.run(2.1)
    assert_over(waiting, 'resume_within')


def test_a_stop_of_the_robot_ends_a_goal_that_waits(waiting: VirtualRun) -> None:
    waiting.nodes['sim']._session.stop('protective stop: for the test')
    waiting.run(0.2)
    assert logged(waiting, 'the robot has stopped: protective stop', 'the goal is over')
    waiting.graph.call('sim/reset')
    assert_over(waiting)


def test_a_hold_ends_a_goal_that_waits(waiting: VirtualRun) -> None:
    del waiting.graph.faults['controller/mode', 'planner']
    waiting.graph.publish('controller/mode', String(data='holding'), latched=True)
    waiting.run(0.7)
    assert_over(waiting, 'controller/hold')


def test_a_robot_that_starts_again_ends_a_goal_that_waits(waiting: VirtualRun) -> None:
    def of_another_clock(message: Any, time: float) -> list[tuple[float, Any]]:
        other = deepcopy(message)
        other.header.stamp = to_time(to_nanoseconds(other.header.stamp) + 100 * SECOND)
        return [(0.0, other)]

    waiting.graph.faults['joint_states', 'planner'] = of_another_clock
    waiting.run(3.0)  # until the first state of that clock, which is doubted, is forgotten
    assert_over(waiting, 'started again')


def test_a_hold_ends_a_target_on_its_way(run: VirtualRun) -> None:
    send_target(run)
    run.run(0.5)
    assert state(run) is TaskState.MOVING
    run.graph.call('controller/hold', data=True)
    run.run(0.6)
    assert state(run) is TaskState.IDLE
    assert logged(run, 'interrupted', 'the goal is over')
    run.graph.call('controller/hold', data=False)
    assert_nothing_moves(run)


def test_a_hold_pauses_a_task_on_its_way(run: VirtualRun) -> None:
    assert run.graph.call('planner/start').success
    run.run(1.0)
    run.graph.call('controller/hold', data=True)
    run.run(3.0)
    assert state(run) is TaskState.WAITING
    run.graph.call('controller/hold', data=False)
    run.run(0.5)
    assert state(run) is TaskState.MOVING


@pytest.mark.parametrize(('seconds', 'goes_on'), [(1.0, True), (3.0, False)])
def test_a_stop_of_the_robot_ends_a_task_that_waits_longer_than_resume_within(
    run: VirtualRun, seconds: float, goes_on: bool
) -> None:
    assert run.graph.call('planner/start').success
    run.run(1.0)
    run.nodes['sim']._session.stop('protective stop: for the test')
    run.run(seconds)
    run.graph.call('sim/reset')
    assert run.run_until(lambda: run.commanding, 2.0)
    run.run(0.5)
    assert (state(run) is TaskState.MOVING) is goes_on
    assert logged(run, 'the task is over', 'resume_within') is not goes_on


# --- progress and standstill ----------------------------------------------------------------------


def test_progress_goes_from_nothing_to_one(run: VirtualRun) -> None:
    run.graph.kept['planner/progress'] = []
    run.graph.listen('planner/progress', 'test', lambda message: None)
    run.run(0.3)
    assert run.graph.call('planner/start').success
    assert run.run_until(lambda: state(run) is TaskState.FINISHED, 20.0)
    run.run(0.1)
    fractions = np.array([message.data for _, message in run.graph.kept['planner/progress']])
    assert fractions[0] == pytest.approx(0.0, abs=0.01)
    assert (np.diff(fractions) >= 0.0).all()
    assert fractions[-1] == 1.0


def test_a_motion_that_gets_nowhere_is_reported_and_then_given_up() -> None:
    """A target just beyond the stretched arm, which the bound on its reach lets pass."""
    with virtual_run(sim=SIM, controller=LOOP, planner=LOOP) as made:
        made.run(0.5)
        x, R = RobotModel.named('lwr4_paper').tip(position(made))
        far = 1.31 / np.linalg.norm(x) * x
        made.graph.publish('target_pose', to_pose(0, '', far, R))
        assert made.run_until(lambda: logged(made, 'no progress for 5 s'), 30.0)
        assert state(made) is not TaskState.STUCK
        assert made.run_until(lambda: state(made) is TaskState.STUCK, 60.0)
        assert logged(made, 'no progress for 30 s', 'm from the next point')
        made.run(1.0)  # to rest
        assert_nothing_moves(made)
