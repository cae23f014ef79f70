"""A task's progress by what the controller carries out: beginning, holds, stops, new robots."""

import numpy as np
import pytest

from redres_ros import load_task
from redres_ros.geometry import rotation_matrix
from redres_ros.loop.cycle_counter import ClockError
from redres_ros.planning.goals import Goal, straight_segment
from redres_ros.planning.joint_path import JointPath
from redres_ros.planning.planner import Planner
from redres_ros.planning.progress import ProgressMonitor
from redres_ros.planning.task_clock import TaskClock
from redres_ros.planning.task_executor import Step, TaskExecutor, TaskState

T = 0.002  # [s]
NS = 2_000_000  # [ns]
TASK = load_task('rectangle')
HOME = TASK.waypoints[0]
THE_TASK = Goal(make_planner=lambda x, R: Planner(TASK, x), goes_on=True, patience=None)


class Arm:
    """A tip that goes where it is asked to go, by the share that is carried out."""

    def __init__(self, at_once: bool = False) -> None:
        self.x = HOME
        self.cycle = 500
        self.scaling: float | None = 0.0  # None: the controller is silent
        self.q = TASK.start
        self.run = TaskExecutor(T, TaskClock(T, at_once), ProgressMonitor())

    def start(self) -> None:
        self.run.begin(THE_TASK)

    def tick(self, scaling: float | None, cycles: int = 1) -> Step | None:
        """One state later; the controller says what it carries out."""
        if scaling is not None:
            self.run.set_scaling(scaling)
        self.cycle += cycles
        step = self.run.enter_state(self.cycle * NS, self.q, self.x, np.eye(3), self.cycle * T)
        if step and step.reference:
            self.x = self.x + T * (scaling or 0.0) * step.reference.dx
        return step

    def go(self, cycles: int, scaling: float | None = 1.0) -> Step | None:
        step = None
        for _ in range(cycles):
            step = self.tick(scaling)
        return step


def under_way() -> Arm:
    """An arm one second into its task."""
    arm = Arm()
    arm.start()
    arm.go(500)
    assert arm.run.state is TaskState.MOVING
    return arm


def error(step: Step | None) -> float:
    assert step is not None and step.reference is not None
    return float(np.linalg.norm(step.reference.error))


def test_the_task_begins_when_the_controller_follows_and_not_before() -> None:
    arm = Arm()
    arm.start()
    for _ in range(1000):
        step = arm.tick(0.0)
        assert step is not None and step.reference is None
        assert arm.run.state is TaskState.WAITING
    step = arm.tick(1.0)
    assert arm.run.start_stamp == arm.cycle * NS
    assert step is not None and step.reference is not None
    assert np.linalg.norm(step.reference.dx) < 1e-3


def test_in_lock_step_it_begins_with_the_first_state() -> None:
    arm = Arm(at_once=True)
    arm.start()
    step = arm.tick(None)
    assert step is not None and step.reference is not None


def test_it_runs_to_its_end_and_does_not_begin_again() -> None:
    arm = Arm()
    arm.start()
    arm.go(5000)
    assert arm.run.state is TaskState.FINISHED
    assert np.linalg.norm(arm.x - TASK.waypoints[-1]) < TASK.tolerance
    arm.go(200, None)  # a controller that falls silent
    arm.x = HOME
    assert arm.go(500) is None
    assert arm.run.state is TaskState.FINISHED
    arm.cycle += 50_000  # and a robot that starts again
    assert arm.go(500) is None


@pytest.mark.parametrize('silent', [True, False])
def test_a_hold_or_a_dead_controller_stops_the_clock_and_the_task_goes_on_where_it_was(
    silent: bool,
) -> None:
    arm = under_way()
    step = arm.go(1000, None if silent else 0.0)
    assert step is not None and step.reference is None
    assert arm.run.state is TaskState.WAITING
    begun = arm.run.start_stamp
    step = arm.go(300)
    assert arm.run.start_stamp == begun
    assert error(step) < 0.02
    arm.go(4000)
    assert arm.run.state is TaskState.FINISHED


def test_an_arm_that_is_elsewhere_after_a_stop_begins_anew() -> None:
    arm = under_way()
    arm.go(200, 0.0)
    begun = arm.run.start_stamp
    arm.x = arm.x + 0.1
    step = arm.tick(1.0)
    assert arm.run.start_stamp > begun
    assert step is not None and step.reference is not None and step.reference.segment == 0


def test_a_share_of_nothing_for_a_moment_is_no_interruption() -> None:
    arm = under_way()
    arm.go(20, 0.0)
    assert arm.run.state is TaskState.MOVING


def test_a_state_out_of_order_changes_nothing() -> None:
    arm = under_way()
    begun = arm.run.start_stamp
    with pytest.raises(ClockError):
        arm.run.enter_state((arm.cycle - 1) * NS, arm.q, arm.x, np.eye(3), arm.cycle * T)
    assert error(arm.tick(1.0)) < 1e-3
    assert arm.run.start_stamp == begun


def test_the_same_state_again_gets_the_same_step() -> None:
    arm = under_way()
    step = arm.tick(1.0)
    again = arm.run.enter_state(arm.cycle * NS, arm.q, arm.x, np.eye(3), arm.cycle * T)
    assert again is step


def test_a_robot_that_waits_for_the_first_step_gets_it_when_the_task_is_started() -> None:
    arm = Arm(at_once=True)
    assert arm.tick(None) is None
    arm.start()
    step = arm.run.enter_state(arm.cycle * NS, arm.q, arm.x, np.eye(3), arm.cycle * T)
    assert step is not None and step.reference is not None


@pytest.mark.parametrize('cycles', [50_000, -600])
def test_a_robot_that_starts_again_from_elsewhere_has_the_task_begun_anew(cycles: int) -> None:
    arm = under_way()
    begun = arm.run.start_stamp
    arm.cycle += cycles
    arm.x = HOME + 0.1
    if cycles < 0:  # here without a silence before, so that the first state alone proves nothing
        with pytest.raises(ClockError, match='a second state like it'):
            arm.tick(None)
    step = arm.tick(None)
    assert step is not None and step.reference is None
    step = arm.tick(1.0)
    assert arm.run.start_stamp != begun
    assert step is not None and step.reference is not None and step.reference.segment == 0


def test_stop_asks_for_nothing_and_start_begins_again() -> None:
    arm = under_way()
    arm.run.stop()
    assert arm.tick(1.0) is None
    assert arm.run.state is TaskState.IDLE
    arm.start()
    step = arm.tick(1.0)
    assert step is not None and step.reference is not None
    assert arm.run.start_stamp == arm.cycle * NS


# --- goals ----------------------------------------------------------------------------------------


def test_a_turn_takes_time_only_where_the_task_has_an_orientation() -> None:
    R = rotation_matrix(np.array((0.0, 0.0, 3.0)))
    x = HOME + np.array((0.0, 0.1, 0.0))
    bent = straight_segment(TASK, HOME, np.eye(3), x, R, 0.2, turns=True)
    straight = straight_segment(TASK, HOME, np.eye(3), x, R, 0.2, turns=False)
    assert straight.segment_time == pytest.approx(15.0 / 8.0 * 0.1 / 0.2)
    assert bent.segment_time == pytest.approx(15.0 / 8.0 * 0.3 / 0.2)


def homing(*, then: bool = True) -> Goal:
    """Joints go from where they are to the start of the task; then the task, or nothing."""
    V = np.full(7, 1.0)
    return Goal(
        lambda q: None if np.abs(q - TASK.start).max() < 0.01 else JointPath(q, TASK.start, V, V),
        THE_TASK.make_planner if then else None,
        goes_on=then,
    )


def following(q: np.ndarray) -> Arm:
    """An arm at q (n,) [rad] whose controller follows."""
    arm = Arm()
    arm.q = q
    arm.go(2)
    return arm


def go_home(arm: Arm, seconds: float = 20.0) -> None:
    """Joints follow their commands, until the arm is at home."""
    for _ in range(round(seconds / T)):
        step = arm.tick(1.0)
        if step is None or step.dq is None:
            return
        arm.q = arm.q + T * step.dq
    raise AssertionError('not at home')


def test_joints_that_are_elsewhere_go_to_the_start_before_the_task_begins() -> None:
    arm = following(TASK.start + 0.5)
    arm.run.begin(homing())
    step = arm.go(10)
    assert arm.run.state is TaskState.HOMING
    assert step is not None and step.dx is None and step.dq is not None
    assert arm.run.start_stamp == 0
    go_home(arm)
    assert arm.run.state is TaskState.MOVING
    assert np.abs(arm.q - TASK.start).max() < 0.01


def test_a_motion_home_alone_ends_there_and_asks_for_nothing_more() -> None:
    arm = following(TASK.start + 0.5)
    arm.run.begin(homing(then=False))
    go_home(arm)
    assert arm.run.state is TaskState.FINISHED
    assert arm.run.progress == 1.0
    assert arm.tick(1.0) is None


def test_a_task_started_on_the_way_home_goes_on_with_that_way() -> None:
    arm = following(TASK.start + 0.5)
    arm.run.begin(homing(then=False))
    for _ in range(500):
        step = arm.tick(1.0)
        assert step is not None and step.dq is not None
        arm.q = arm.q + T * step.dq
    before = step.dq
    arm.run.begin(homing())
    step = arm.tick(1.0)
    assert step is not None and step.dq is not None
    assert np.abs(step.dq - before).max() < 2.0 * T  # twice what A = 1 rad/s^2 allows in a cycle
    go_home(arm)
    assert arm.run.state is TaskState.MOVING


def test_a_hold_on_the_way_home_has_it_begun_anew_from_where_the_joints_are() -> None:
    arm = following(TASK.start + 0.5)
    arm.run.begin(homing())
    arm.go(500)
    step = arm.go(200, 0.0)
    assert arm.run.state is TaskState.WAITING
    assert step is not None and step.dq is not None and not step.dq.any()
    arm.q = TASK.start + 0.3
    step = arm.tick(1.0)
    assert step is not None and step.dq is not None
    assert np.abs(step.dq).max() < 0.01
    go_home(arm)
    assert arm.run.state is TaskState.MOVING


def test_an_arm_at_a_limit_is_not_interrupted_but_stuck() -> None:
    arm = under_way()
    arm.run.set_mode('moving')
    arm.run.set_active_limits('lwr_a1_joint: position')
    arm.go(round(6.0 / T), 0.0)
    assert arm.run.state is TaskState.MOVING
    assert 'no progress for 5 s: lwr_a1_joint: position' in arm.run.remark
    arm.go(round(25.0 / T), 0.0)
    assert arm.run.state is TaskState.STUCK
    assert arm.tick(1.0) is None
    arm.start()
    arm.tick(1.0)
    assert arm.run.state is TaskState.MOVING
    assert arm.run.remark == ''


def test_a_controller_that_is_gone_is_an_interruption_whatever_it_said_last() -> None:
    arm = under_way()
    arm.run.set_mode('moving')
    arm.go(200, None)
    assert arm.run.state is TaskState.WAITING


def test_a_tip_that_is_pushed_off_its_path_in_motion_goes_back_to_it() -> None:
    arm = under_way()
    begun = arm.run.start_stamp
    arm.x = arm.x + 0.1
    step = arm.tick(1.0)
    assert arm.run.start_stamp == begun
    assert step is not None and step.reference is not None and step.reference.segment == 1
