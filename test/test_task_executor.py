"""A task's progress by what the controller executes: beginning, holds, stops, new robots."""

from dataclasses import replace

import numpy as np
import pytest

from redres_ros import Preview, RobotModel, load_task
from redres_ros.errors import RedresError
from redres_ros.geometry import rotation_matrix
from redres_ros.loop.cycle_counter import ClockError
from redres_ros.loop.safety import ProgressMonitor
from redres_ros.planning.goals import Goal, Goals, GoalSettings
from redres_ros.planning.joint_path import JointPath
from redres_ros.planning.planner import Planner
from redres_ros.planning.task_executor import Step, TaskExecutor, TaskState
from redres_ros.planning.unachieved import UnachievedVelocity

T = 0.002  # [s]
NS = 2_000_000  # [ns]
TASK = load_task('rectangle')
HOME = TASK.waypoints[0]
MODEL = RobotModel.named('lwr4_paper')
GOALS = Goals(MODEL, TASK, GoalSettings(), 'position')
THE_TASK = Goal(make_planner=lambda x, R: Planner(TASK, x), goes_on=True, patience=None)


class Arm:
    """An arm that goes where it is asked to go, by the fraction that is executed."""

    def __init__(self, lockstep: bool = False) -> None:
        self.x = HOME
        self.q = TASK.start
        self.cycle = 500
        self.set_by = 0  # cycles by which the robot's clock was set
        self.run = TaskExecutor(T, lockstep=lockstep)

    def enter(self) -> Step | None:
        stamp = (self.cycle + self.set_by) * NS
        return self.run.enter_state(stamp, self.q, self.x, np.eye(3), self.cycle * T)

    def tick(self, scaling: float | None) -> Step | None:
        """One state later; the controller reports what it executes, or None: it is silent."""
        if scaling is not None:
            self.run.clock.set_scaling(scaling)
        self.cycle += 1
        step = self.enter()
        if step and step.reference:
            self.x = self.x + T * (scaling or 0.0) * step.reference.dx
        return step

    def go(self, cycles: int, scaling: float | None = 1.0) -> Step | None:
        return [self.tick(scaling) for _ in range(cycles)][-1]


def under_way(goal: Goal = THE_TASK) -> Arm:
    """An arm one second into its task."""
    arm = Arm()
    arm.run.begin(goal)
    arm.go(500)
    assert arm.run.state is TaskState.MOVING
    return arm


def waits(step: Step | None) -> bool:
    """Whether the controller is asked for zero velocity."""
    return step is not None and step.dx is not None and not (step.dx.any() or step.reference)


def test_the_task_begins_when_the_controller_follows_and_not_before() -> None:
    arm = Arm()
    arm.run.begin(THE_TASK)
    for _ in range(1000):
        assert waits(arm.tick(0.0))
        assert arm.run.state is TaskState.WAITING
    step = arm.tick(1.0)
    assert arm.run.start_stamp == arm.cycle * NS
    assert np.linalg.norm(step.reference.dx) < 1e-3


def test_in_lock_step_it_begins_with_the_first_state_also_with_one_that_came_before() -> None:
    arm = Arm(lockstep=True)
    assert arm.tick(None) is None
    arm.run.begin(THE_TASK)
    assert arm.enter().reference.segment == 1


def test_it_runs_to_its_end_and_does_not_begin_again() -> None:
    arm = Arm()
    arm.run.begin(THE_TASK)
    arm.go(5000)
    assert arm.run.state is TaskState.FINISHED
    assert np.linalg.norm(arm.x - TASK.waypoints[-1]) < TASK.tolerance
    arm.go(200, None)  # a controller that falls silent
    arm.x = HOME
    assert arm.go(500) is None
    assert arm.run.state is TaskState.FINISHED
    arm.cycle += 50_000  # and a robot that starts again
    assert arm.go(500) is None


def test_a_point_that_an_upright_arm_cannot_come_down_to_does_not_keep_the_task() -> None:
    arm = Arm()
    arm.q = np.zeros(7)
    arm.run = TaskExecutor(T, unachieved=UnachievedVelocity(MODEL, 'position', T, 0.05))
    arm.run.begin(THE_TASK)
    for _ in range(1600):
        step = arm.tick(1.0)
        if step and step.reference:
            arm.x = step.reference.x_d + np.array((0.0, 0.0, 0.02))
    assert step.reference.segment == 2


def test_stop_asks_for_nothing_and_begin_begins_again() -> None:
    arm = under_way()
    arm.run.stop()
    assert arm.tick(1.0) is None
    assert arm.run.state is TaskState.IDLE
    arm.run.begin(THE_TASK)
    assert arm.tick(1.0).reference.segment == 0  # from where the arm is
    assert arm.run.start_stamp == arm.cycle * NS


def test_a_state_out_of_order_changes_nothing() -> None:
    arm = under_way()
    start = arm.run.start_stamp
    arm.cycle -= 1
    with pytest.raises(ClockError):
        arm.enter()
    arm.cycle += 1
    assert np.linalg.norm(arm.tick(1.0).reference.error) < 1e-3
    assert arm.run.start_stamp == start


def test_the_same_state_again_gets_the_same_step() -> None:
    arm = under_way()
    step = arm.tick(1.0)
    assert arm.enter() is step


def test_with_a_robot_that_starts_again_from_elsewhere_the_task_begins_anew() -> None:
    arm = under_way()
    start = arm.run.start_stamp
    arm.cycle += 50_000
    arm.x = HOME + 0.1
    assert waits(arm.tick(None))
    assert arm.tick(1.0).reference.segment == 0
    assert arm.run.start_stamp != start


@pytest.mark.parametrize(('cycles', 'goes_on'), [(-600, False), (-100, True)])
def test_only_a_clock_that_is_set_by_no_more_than_a_second_ends_no_goal(cycles, goes_on):
    arm = under_way(replace(THE_TASK, patience=2.0))
    arm.set_by = cycles
    with pytest.raises(ClockError, match='a second state like it'):
        arm.tick(1.0)
    arm.tick(1.0)
    assert (arm.run.state is TaskState.MOVING) is goes_on


@pytest.mark.parametrize('scaling', [None, 0.0])
def test_a_hold_or_a_silent_controller_stops_the_clock_and_the_task_goes_on_where_it_was(scaling):
    arm = under_way()
    arm.run.mode = 'moving' if scaling is None else 'holding'
    start = arm.run.start_stamp
    assert waits(arm.go(1000, scaling))
    assert arm.run.state is TaskState.WAITING
    arm.tick(1.0)
    assert arm.run.clock.speed.fraction == 0.0  # from rest
    assert np.linalg.norm(arm.go(300).reference.error) < 0.02
    assert arm.run.start_stamp == start
    arm.go(4000)
    assert arm.run.state is TaskState.FINISHED


def test_a_task_does_not_wait_for_a_controller_that_was_killed_while_it_held() -> None:
    arm = under_way(replace(THE_TASK, patience=2.0))
    arm.run.mode = 'holding'
    for scaling, state in ((0.0, TaskState.WAITING), (None, TaskState.IDLE)):
        arm.go(1500, scaling)
        assert arm.run.state is state
    assert 'the controller is silent' in arm.run.remark


def test_an_arm_that_is_elsewhere_after_a_stop_begins_anew() -> None:
    arm = under_way()
    arm.go(200, 0.0)
    start = arm.run.start_stamp
    arm.x = arm.x + 0.1
    assert arm.tick(1.0).reference.segment == 0
    assert arm.run.start_stamp > start


def test_a_tip_that_is_pushed_off_its_path_in_motion_goes_back_to_it() -> None:
    arm = under_way()
    start = arm.run.start_stamp
    arm.x = arm.x + 0.1
    assert arm.tick(1.0).reference.segment == 1
    assert arm.run.start_stamp == start


def test_an_arm_at_a_limit_is_not_interrupted_but_stuck() -> None:
    arm = under_way()
    arm.run.mode = 'moving'
    arm.run.monitor.active_limits = lambda: 'lwr_a1_joint: position'
    arm.go(round(6.0 / T), 0.0)
    assert arm.run.state is TaskState.MOVING
    assert 'no progress for 5 s: lwr_a1_joint: position' in arm.run.remark
    arm.go(round(25.0 / T), 0.0)
    assert arm.run.state is TaskState.STUCK
    assert 'no progress for 30 s' in arm.run.remark
    assert arm.tick(1.0) is None
    arm.run.begin(THE_TASK)
    arm.tick(1.0)
    assert arm.run.state is TaskState.MOVING
    assert arm.run.remark == ''


def test_a_turn_takes_time_only_where_the_task_has_an_orientation() -> None:
    R = rotation_matrix(np.array((0.0, 0.0, 3.0)))
    x = HOME + np.array((0.0, 0.1, 0.0))
    for task_space, size in (('pose', 0.3), ('position', 0.1)):
        goals = Goals(MODEL, TASK, GoalSettings(target_speed=0.2), task_space)
        make_planner = goals.target(x, R).make_planner
        planner = make_planner(HOME, np.eye(3))
        assert planner.time_left(0.0) == pytest.approx(15.0 / 8.0 * size / 0.2)


def test_a_target_that_is_reached_and_repeated_in_a_stream_stays_finished() -> None:
    arm = Arm()
    states = []
    for _ in range(100):
        arm.run.begin(GOALS.target(HOME + np.array((0.0, 0.02, 0.0)), np.eye(3)))
        states.append(arm.run.state)
        arm.go(8)
    assert set(states[states.index(TaskState.FINISHED) :]) == {TaskState.FINISHED}


def test_a_stream_of_targets_to_an_arm_at_a_limit_is_reported_as_without_progress() -> None:
    arm = Arm()
    arm.run.mode = 'moving'
    for cycles, executed, remark in ((1, 1.0, ''), (400, 0.0, 'for 5 s: lwr'), (50, 1.0, '')):
        for k in range(cycles):
            y = 0.15 + 0.02 * np.sin(0.1 * k)
            arm.run.begin(GOALS.target(HOME + np.array((0.0, y, 0.0)), np.eye(3)))
            arm.run.monitor.active_limits = lambda: 'lwr_a1_joint: position'
            arm.go(8, executed)
        assert remark in arm.run.remark
    assert arm.run.remark == ''


def test_a_stream_of_targets_to_a_tip_that_a_singularity_keeps_is_reported_as_without_progress():
    arm = Arm()
    for _ in range(560):
        arm.run.begin(GOALS.target(HOME + np.array((0.0, 0.1, 0.0)), np.eye(3)))
        arm.go(8)
        arm.x = HOME  # what is executed is of other directions
    assert 'no progress for 5 s' in arm.run.remark


@pytest.mark.parametrize(
    ('times', 'size', 'words'),
    [
        ((-1.0, -0.5), 0.0, 'end of the path is -0.5; allowed: 0 to 60'),
        ((1.0, 70.0), 0.0, 'end of the path is 70.0; allowed: 0 to 60'),
        ((0.0, 59.0), 9.0, 'distance from the first joint'),
        ((0.0, 0.5), 0.11, 'speed of the path is 0.22; allowed: 0 to 0.2'),
    ],
)
def test_a_path_of_another_time_or_out_of_reach_or_too_fast_is_refused(times, size, words) -> None:
    path = Preview(times, np.stack((HOME, HOME + np.array((0.0, 0.0, size)))))
    with pytest.raises(RedresError, match=words):
        GOALS.path(path, Arm().run.cycles)


def homing(*, then: bool = True) -> Goal:
    """Joints go from where they are to the start of the task; then the task, or nothing."""
    V = np.full(7, 1.0)
    return Goal(
        lambda q: None if np.abs(q - TASK.start).max() < 0.01 else JointPath(q, TASK.start, V, V),
        THE_TASK.make_planner if then else None,
        goes_on=then,
    )


def on_the_way_home(*, then: bool = True) -> Arm:
    """An arm whose joints have begun to move to the start of the task."""
    arm = Arm()
    arm.q = TASK.start + 0.5
    arm.go(2)
    arm.run.begin(homing(then=then))
    for _ in range(500):
        arm.q = arm.q + T * arm.tick(1.0).dq
    assert arm.run.state is TaskState.HOMING
    return arm


def go_home(arm: Arm) -> None:
    """Joints follow their commands, until the arm is at home."""
    for _ in range(10_000):
        step = arm.tick(1.0)
        if step is None or step.dq is None:
            return
        arm.q = arm.q + T * step.dq
    raise AssertionError('not at home')


@pytest.mark.parametrize('then', [True, False])
def test_joints_go_to_the_start_and_then_the_task_begins_or_nothing(then: bool) -> None:
    arm = on_the_way_home(then=then)
    assert arm.run.start_stamp == 0
    go_home(arm)
    assert np.abs(arm.q - TASK.start).max() < 0.01
    assert arm.run.state is (TaskState.MOVING if then else TaskState.FINISHED)
    assert (arm.run.progress == 1.0) is not then
    assert (arm.tick(1.0) is None) is not then


def test_a_task_started_on_the_way_home_goes_on_with_that_way() -> None:
    arm = on_the_way_home(then=False)
    before = arm.tick(1.0).dq
    arm.q = arm.q + T * before
    arm.run.begin(homing())
    after = arm.tick(1.0).dq
    assert np.abs(after - before).max() < 2.0 * T  # twice what A = 1 rad/s^2 allows in a cycle
    arm.go(200, 0.0)
    assert arm.run.running  # it has begun, and waits to go on
    go_home(arm)
    assert arm.run.state is TaskState.MOVING


def test_after_a_hold_on_the_way_home_it_begins_anew_from_where_the_joints_are() -> None:
    arm = on_the_way_home()
    assert not arm.go(200, 0.0).dq.any()
    assert arm.run.state is TaskState.WAITING
    arm.q = TASK.start + 0.3
    assert np.abs(arm.tick(1.0).dq).max() < 0.01
    go_home(arm)
    assert arm.run.state is TaskState.MOVING


@pytest.mark.parametrize(
    ('left', 'error', 'is_stuck'),
    [
        ((10.0, -0.02), (0.1, 1.0), False),  # time of the segment goes on, slowly
        ((0.0, 0.0), (0.1, 0.9), False),  # an error that shrinks afterwards
        ((0.0, 0.0), (0.1, 0.9999), True),
        ((2.0, 0.0), (0.1, 0.9), True),  # an error says nothing before the time is over
    ],
)
def test_progress_is_time_and_then_a_smaller_error_or_the_next_segment(left, error, is_stuck):
    monitor = ProgressMonitor()
    for second in range(20):
        place = (left[0] + left[1] * second, error[0] * error[1] ** second)
        monitor.enter(1.0, 1, *place)
    assert bool(monitor.remark) is is_stuck
    monitor.enter(1.0, 2, *place)
    assert not monitor.remark
