"""What the planner takes for a goal, and what ends one: the real nodes, in virtual time."""

import time
from collections.abc import Iterator
from copy import deepcopy
from pathlib import Path
from typing import Any

import numpy as np
import pytest

pytest.importorskip('rclpy', reason='needs ROS 2: pip install .[test]')

from graph_helpers import write_task
from nightly import NIGHTLY
from reference_judge import judge_graph
from std_msgs.msg import String
from virtual_graph import VirtualRun, virtual_run
from wire_faults import changed

from redres_ros import Preview, RobotModel
from redres_ros.geometry import rotation_matrix
from redres_ros.nodes.conversions import to_nanoseconds, to_path, to_pose, to_time
from redres_ros.planning.task_executor import TaskState
from redres_ros.robots.joint_limits import JointLimits

pytestmark = pytest.mark.slow

SIDEWAYS = np.array((0.0, -0.1, 0.05))  # [m]
SECOND = 1_000_000_000  # [ns]
STILL = 1e-6  # [rad] by which an arm at rest moves: rounding
MODEL = RobotModel.named('lwr4_paper')


@pytest.fixture
def run() -> Iterator[VirtualRun]:
    """A robot in command mode whose planner waits for a goal."""
    with virtual_run() as made:
        made.graph.kept['/diagnostics'] = []
        made.run(0.5)
        assert made.commanding
        yield made


def position(run: VirtualRun) -> np.ndarray:
    """Of the robot's joints, (n,) [rad]."""
    return run.nodes['sim']._robot.plant.q.copy()


def state(run: VirtualRun) -> TaskState:
    return run.nodes['planner']._run.state


def send_target(run: VirtualRun, *, stamp: int = 0, offset: np.ndarray = SIDEWAYS) -> None:
    """Publish a target at an offset (3,) [m] from the tip."""
    x, R = MODEL.tip(position(run))
    run.graph.publish('target_pose', to_pose(stamp, '', x + offset, R))


def stop_robot(run: VirtualRun) -> None:
    run.nodes['sim']._session.stop('protective stop: for the test')
    run.run(0.1)


def logged(run: VirtualRun, *words: str) -> bool:
    """Whether a line of the planner's log has all of these words."""
    lines = [line for node, line in run.graph.log if node == 'planner']
    return any(all(word in line for word in words) for line in lines)


def diagnosed(run: VirtualRun, *words: str) -> bool:
    """Whether the planner's newest status has all of these words."""
    run.run(1.1)
    return all(word in run.health('planner').message for word in words)


def assert_nothing_moves(run: VirtualRun) -> None:
    q = position(run)
    run.run(1.0)
    assert np.abs(position(run) - q).max() < STILL


@pytest.mark.parametrize(('age', 'side'), [(1.5, 'behind'), (-1.5, 'ahead of')])
def test_a_target_of_another_time_is_refused_with_its_age(
    run: VirtualRun, age: float, side: str
) -> None:
    send_target(run, stamp=run.nodes['planner']._run.cycles.newest - round(age * SECOND))
    assert_nothing_moves(run)
    assert logged(run, 'target_pose refused', side, 'a zero stamp')
    assert diagnosed(run, 'target_pose refused', side)
    send_target(run, stamp=run.nodes['planner']._run.cycles.newest - SECOND // 2)
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


def test_goals_for_a_robot_that_has_stopped_are_refused_and_never_executed(run: VirtualRun) -> None:
    stop_robot(run)
    send_target(run)
    run.run(0.1)
    assert not run.graph.call('planner/start').success
    for source in ('target_pose', 'planner/start'):
        assert logged(run, f'{source} refused', 'protective stop: for the test', 'sim/reset')
    run.graph.call('sim/reset')
    assert run.run_until(lambda: run.commanding, 2.0)
    assert_nothing_moves(run)


def test_the_task_is_not_said_to_run_while_a_target_is_under_way(run: VirtualRun) -> None:
    send_target(run)
    run.run(0.5)
    response = run.graph.call('planner/start')
    assert not response.success
    assert 'on its way to a pose; planner/stop ends that' in response.message


def test_a_target_out_of_reach_is_refused_with_the_bound(run: VirtualRun) -> None:
    send_target(run, offset=np.array((0.0, 50.0, 0.0)))
    run.run(0.1)
    assert state(run) is TaskState.IDLE
    assert logged(run, 'target_pose refused', 'distance from the first joint', '1.3135')


def test_a_target_before_the_first_state_is_refused() -> None:
    with virtual_run() as made:
        made.graph.publish('target_pose', to_pose(0, '', np.array((0.3, 0.3, 0.3)), np.eye(3)))
        assert logged(made, 'target_pose refused', 'no joint_states')
        path = Preview((0.0, 1.0), np.full((2, 3), 0.3))
        made.graph.publish('target_path', to_path(10**18, '', path))
        assert logged(made, 'target_path refused', 'no joint_states')
        made.run(1.0)
        assert state(made) is TaskState.IDLE


def test_a_task_that_is_started_before_the_first_state_begins_with_it() -> None:
    with virtual_run() as made:
        assert made.graph.call('planner/start').success
        assert state(made) is not TaskState.MOVING
        assert made.run_until(lambda: state(made) is TaskState.MOVING, 2.0)


def test_nothing_begins_while_the_controller_is_inactive(run: VirtualRun) -> None:
    run.graph.publish('controller/mode', String(data='inactive'), latched=True)
    response = run.graph.call('planner/start')
    assert not response.success
    assert 'the controller is inactive' in response.message


@pytest.fixture
def waiting(run: VirtualRun) -> VirtualRun:
    """The planner has a target and knows nothing of a controller that would follow."""
    run.graph.publish('controller/mode', String(data='mirroring'))
    for topic in ('controller/mode', 'controller/task_scaling'):
        run.graph.faults[topic, 'planner'] = lambda message, time: []
    run.run(0.5)
    send_target(run)
    run.run(0.2)
    assert state(run) is TaskState.WAITING
    return run


def stop_and_reset(run: VirtualRun) -> None:
    stop_robot(run)
    run.graph.call('sim/reset')


def hold(run: VirtualRun) -> None:
    del run.graph.faults['controller/mode', 'planner']
    nothing = changed(lambda message: setattr(message, 'data', 0.0))
    run.graph.faults['controller/task_scaling', 'planner'] = nothing
    run.graph.publish('controller/mode', String(data='holding'), latched=True)
    run.run(2.1)


def start_again(run: VirtualRun) -> None:
    def of_another_clock(message: Any, time: float) -> list[tuple[float, Any]]:
        other = deepcopy(message)
        other.header.stamp = to_time(to_nanoseconds(other.header.stamp) + 100 * SECOND)
        return [(0.0, other)]

    run.graph.faults['joint_states', 'planner'] = of_another_clock
    run.run(3.0)  # until the first state of that clock, which is doubted, is forgotten


@pytest.mark.parametrize(
    ('event', 'reason'),
    [
        (lambda run: run.run(2.1), 'resume_within'),
        (stop_and_reset, 'the robot has stopped: protective stop'),
        (hold, 'the controller is holding'),
        (start_again, 'started again'),
    ],
)
def test_a_goal_that_waits_is_given_up_with_the_reason_and_not_executed_later(
    waiting: VirtualRun, event: Any, reason: str
) -> None:
    event(waiting)
    assert logged(waiting, 'the goal is over', reason)
    assert diagnosed(waiting, reason)
    waiting.graph.faults.clear()
    waiting.graph.call('sim/reset')
    waiting.run(0.5)
    assert state(waiting) is TaskState.IDLE
    assert_nothing_moves(waiting)


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


@pytest.mark.parametrize(('seconds', 'goes_on'), [(1.0, True), (3.0, False)])
def test_a_stop_of_the_robot_ends_a_task_that_waits_longer_than_resume_within(
    run: VirtualRun, seconds: float, goes_on: bool
) -> None:
    assert run.graph.call('planner/start').success
    run.run(1.0)
    stop_robot(run)
    run.run(seconds)
    run.graph.call('sim/reset')
    assert run.run_until(lambda: run.commanding, 2.0)
    run.run(0.5)
    assert (state(run) is TaskState.MOVING) is goes_on
    assert logged(run, 'the task is over', 'resume_within') is not goes_on


def test_a_point_out_of_reach_keeps_a_task_for_a_moment_and_not_for_ever(tmp_path: Path) -> None:
    x = MODEL.tip(np.array(MODEL.arm.start))[0]
    task = write_task(tmp_path / 'task.yaml', np.array([x, 3.0 * x, x]), 3.0)
    with virtual_run(planner={'task': task, 'autostart': True}) as made:
        made.run(10.0)
        assert state(made) is TaskState.FINISHED


FR3 = RobotModel.named('fr3')
STREAM = 1800.0 if NIGHTLY else 15.0  # [s] of virtual time


@pytest.fixture
def streamed() -> Iterator[VirtualRun]:
    """An FR3 in command mode whose task is a pose."""
    pose = {'task_space': 'pose'}
    with virtual_run(100.0, 'fr3', controller=pose, planner=pose) as made:
        made.run(0.5)
        yield made


def send_pose(run: VirtualRun, jump: np.ndarray, start: tuple[np.ndarray, np.ndarray]) -> None:
    """Publish a target at a jump (6,) from where the tip was at the start."""
    x, R = start
    run.graph.publish('target_pose', to_pose(0, '', x + jump[:3], rotation_matrix(jump[3:]) @ R))


def speed(run: VirtualRun, seconds: float) -> float:
    """Mean speed of the tip in the next seconds [m/s]."""
    before = FR3.tip(position(run))[0]
    run.run(seconds)
    return float(np.linalg.norm(FR3.tip(position(run))[0] - before)) / seconds


def test_random_jumps_at_20_to_60_hz_are_followed_within_all_limits(streamed: VirtualRun) -> None:
    judge = judge_graph(streamed.graph, JointLimits.of(FR3.arm), 100.0, 'extrapolate')
    rng = np.random.default_rng(24)
    start = FR3.tip(position(streamed))
    length = 0.0  # [m] of the tip's path
    end = streamed.now + STREAM
    while streamed.now < end:
        send_pose(streamed, rng.normal(scale=0.3, size=6), start)
        seconds = 1.0 / rng.uniform(20.0, 60.0)
        length += seconds * speed(streamed, seconds)
    judge.assert_followable()
    assert state(streamed) is TaskState.MOVING
    assert length > 0.01 * STREAM  # it moves, and does not begin anew with each of them


def test_a_target_in_the_middle_of_a_motion_makes_no_stop(streamed: VirtualRun) -> None:
    start = FR3.tip(position(streamed))
    send_pose(streamed, np.array((0.0, 0.3, 0.0, 0.0, 0.0, 0.0)), start)
    streamed.run(1.3)
    send_pose(streamed, np.array((0.05, 0.4, 0.0, 0.0, 0.0, 0.0)), start)
    assert min(speed(streamed, 0.05) for _ in range(10)) > 0.1


def test_overlapping_pieces_of_a_path_are_followed_each_pose_at_its_stamp(
    streamed: VirtualRun,
) -> None:
    judge = judge_graph(streamed.graph, JointLimits.of(FR3.arm), 100.0, 'extrapolate')
    x, R = FR3.tip(position(streamed))
    cycles = streamed.nodes['planner']._run.cycles
    begin = cycles.newest

    def after_start(t: np.ndarray) -> np.ndarray:
        """Positions of a tip that sets off gently, (N, 3)."""
        return x + np.outer(0.1 * np.sin(np.clip(t, 0.0, 3.0)) ** 2, (0.0, 1.0, 0.5))

    for _ in range(25):
        t = (cycles.newest - begin) / SECOND + np.arange(0.0, 1.0, 0.05)
        path = Preview(t - t[0], after_start(t), np.tile(R, (len(t), 1, 1)))
        streamed.graph.publish('target_path', to_path(cycles.newest, '', path))
        streamed.run(0.1)
        now = np.array(((cycles.newest - begin) / SECOND,))
        assert np.linalg.norm(FR3.tip(position(streamed))[0] - after_start(now)[0]) < 0.004
    judge.assert_followable()
    assert streamed.run_until(lambda: state(streamed) is TaskState.FINISHED, 2.0)


def test_a_path_that_cannot_be_followed_is_refused_in_one_line(streamed: VirtualRun) -> None:
    x, R = FR3.tip(position(streamed))
    line = x + np.outer(np.arange(3.0), (0.0, 0.3, 0.0))
    path = Preview((0.0, 1.0, 2.0), line, np.tile(R, (3, 1, 1)))  # 0.3 m/s
    stamp = streamed.nodes['planner']._run.cycles.newest
    streamed.graph.publish('target_path', to_path(stamp, '', path))
    streamed.run(0.1)
    assert state(streamed) is TaskState.IDLE
    assert logged(streamed, 'target_path refused', 'target_speed', '0.3')
