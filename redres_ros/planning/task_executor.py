"""A goal from its first state to its end, through holds, stops and new robots: a state machine."""

from dataclasses import dataclass
from enum import Enum
from typing import NamedTuple

import numpy as np

from redres_ros.loop.cycle_counter import NANOSECONDS, CycleCounter
from redres_ros.loop.modes import Mode
from redres_ros.loop.safety import ProgressMonitor
from redres_ros.planning.goals import Goal
from redres_ros.planning.joint_path import JointPath, JointReference
from redres_ros.planning.planner import Planner, Reference, TargetFollower
from redres_ros.planning.task_clock import TaskClock
from redres_ros.planning.unachieved import UnachievedVelocity
from redres_ros.preview import Preview
from redres_ros.types import (
    JointPositions,
    JointVelocities,
    Nanoseconds,
    Position,
    Rotation,
    Seconds,
    TaskVelocity,
)

_AWAY = 0.05  # [m] from where it stopped, beyond which an interrupted task begins again
_ELEMENT = 0.07  # [m] of those of a rotation matrix, so that 1 rad counts as 0.1 m
_SET_BACK = 1.0  # [s] by which a robot's clock may be set back in motion


class TaskState(Enum):
    IDLE = 'idle'
    WAITING = 'waiting'  # for a robot that takes commands and a controller that follows
    HOMING = 'homing'  # in joint space
    MOVING = 'moving'
    FINISHED = 'finished'
    STUCK = 'stuck'  # given up


UNDER_WAY = (TaskState.WAITING, TaskState.HOMING, TaskState.MOVING)


class Step(NamedTuple):
    """The velocity for a state: of the task (dx), with the reference it comes from, or of the
    joints (dq). Zero and without a reference while a goal waits.
    """

    dx: TaskVelocity | None = None
    dq: JointVelocities | None = None
    reference: Reference | None = None


class _ArmState(NamedTuple):
    q: JointPositions
    x: Position
    R: Rotation
    unachieved: TaskVelocity | None


@dataclass
class _Execution:
    """A goal in execution; only TaskExecutor changes it."""

    goal: Goal
    source: JointPath | Planner | TargetFollower | None = None  # None before anything is asked for
    has_begun: bool = False  # anything of it was asked for
    x_d: Position | None = None  # that was asked for last; None before the tip's path begins
    waited: Seconds = 0.0  # for the controller, without a break


class TaskExecutor:
    """Decides at every state of the robot the velocity, and when the time of the goal advances.

    | state | while the controller follows | while it does not |
    |---|---|---|
    | WAITING | begins or resumes: HOMING or MOVING | zero velocity; given up at some time: IDLE |
    | HOMING | joints to the start of the path; there: MOVING, or FINISHED without one | WAITING |
    | MOVING | tip along the path; at its end: FINISHED | WAITING |
    | FINISHED | the last point is held | the goal is dropped |
    | IDLE, STUCK | nothing | nothing |

    HOMING and MOVING without progress end in STUCK. A goal begins when the controller follows.
    Before that it ends with a stop of the robot, and when its patience is over: nothing is executed
    that was asked for long ago. A task that is interrupted by a hold goes on when the hold ends;
    after any other interruption it goes on within its patience. It begins again if the arm is
    elsewhere by then. Every goal ends with a robot that was started again.

    `unachieved` gives the part of a task velocity that a singularity blocks at a state. It matters
    only once a segment's time is over.
    """

    def __init__(
        self,
        T: Seconds,
        task_space: str = 'position',
        lockstep: bool = False,
        unachieved: UnachievedVelocity | None = None,
    ) -> None:
        self.state = TaskState.IDLE
        self.start_stamp: Nanoseconds = 0  # of the state at which the tip's path began
        self.mode = ''  # of the controller; empty: unknown
        self.stop_reason = ''  # of the robot; empty: it has not stopped
        self.clock = TaskClock(T, lockstep)
        self.monitor = ProgressMonitor()
        self._T = T
        self._turns = task_space == 'pose'
        self._unachieved = unachieved
        self.cycles = CycleCounter(round(NANOSECONDS * T))
        self._execution: _Execution | None = None
        self._ending = ''  # why the goal was over before its end
        self._step: Step | None = None
        self._arm: _ArmState | None = None  # at the newest state
        self._seconds = 0.0  # from the last state to the newest

    def begin(self, goal: Goal) -> None:
        """Begin as soon as the controller follows, from where the arm is; in place of another goal.

        A joint path under way goes on: it leads to the same place. A tip in motion goes on to
        another target without a stop.
        """
        if self._redirect(goal):
            return
        path = None
        if self._execution and self.state is TaskState.HOMING and goal.make_path:
            path = self._execution.source
        self.stop()
        self._execution = _Execution(goal, path, has_begun=path is not None)
        self.state = TaskState.WAITING if path is None else TaskState.HOMING

    def stop(self) -> None:
        self._execution = None
        self._step = None
        self._ending = ''
        self.monitor.begin()
        self.state = TaskState.IDLE

    def preview(self, seconds: Seconds) -> Preview | None:
        """The path of the tip in the next seconds; None if there is none."""
        source = self._tip_source
        if source is None:
            return None
        return source.preview(self.clock.t, seconds, self.clock.speed.fraction)

    def set_stop_reason(self, reason: str) -> None:
        """Record why the robot has stopped; empty: it has not."""
        self.stop_reason = reason
        execution = self._execution
        if execution is None or not reason or self.state not in UNDER_WAY:
            return
        goal = execution.goal
        if not goal.goes_on or (not execution.has_begun and goal.patience is not None):
            self._end(f'the robot has stopped: {reason}')

    def enter_state(
        self, stamp: Nanoseconds, q: JointPositions, x: Position, R: Rotation, now: Seconds
    ) -> Step | None:
        """What is asked for at a state that arrives now, by a monotonic clock; None for nothing. At
        the same state it is the same. Raises ClockError for a stamp that is not of a new cycle.
        """
        source = self._execution and self._execution.source
        asked = self._step and self._step.dx
        unachieved = None
        if self._unachieved and source and asked is not None and not source.time_left(self.clock.t):
            unachieved = self._unachieved(q, asked, self.monitor.idle)
        is_new = not stamp or stamp != self.cycles.newest
        self._seconds = 0.0
        if is_new:
            before = self.cycles.newest
            cycles = self.cycles.enter(stamp, now)
            self._seconds = cycles * self._T
            if cycles != 1 and before:
                self._end_after((stamp - before) / NANOSECONDS)
            self.clock.advance(cycles)
        if is_new or self._step is None:
            self._arm = _ArmState(q, x, R, unachieved)
            self._step = self._next_step(self._arm)
        return self._step

    @property
    def progress(self) -> float:
        """The fraction of the tip's path that is over, 0 to 1."""
        if self.state is TaskState.FINISHED:
            return 1.0
        return self._tip_source.progress(self.clock.t) if self._tip_source else 0.0

    @property
    def _live_mode(self) -> str:
        """Of a controller that is there: the last mode of one that was killed stays latched."""
        speaks = self.mode not in ('', Mode.INACTIVE.value)  # in all other modes
        return 'silent' if speaks and not self.clock.is_receiving else self.mode

    @property
    def _tip_source(self) -> Planner | TargetFollower | None:
        """What leads the tip, if that is under way."""
        source = self._execution.source if self._execution else None
        return source if isinstance(source, Planner | TargetFollower) else None

    @property
    def remark(self) -> str:
        """Why the goal makes no progress, or ended early; empty while all is well."""
        return self._ending or self.monitor.remark

    @property
    def running(self) -> Goal | None:
        """The goal that leads the tip along its path, or has begun and waits to go on."""
        execution = self._execution
        if execution is None:
            return None
        is_paused = execution.has_begun and self.state is TaskState.WAITING
        return execution.goal if is_paused or self.state is TaskState.MOVING else None

    def _next_step(self, arm: _ArmState) -> Step | None:
        execution = self._execution
        if execution is None:
            return None
        is_under_way = self.state in (TaskState.HOMING, TaskState.MOVING)
        # At a limit the controller follows at no speed.
        is_at_limit = is_under_way and self._live_mode == Mode.MOVING.value
        if self.clock.follows or is_at_limit:
            if self.state is TaskState.WAITING:
                return self._set_off(execution, arm)
            return self._follow(execution, arm)
        if self.state is TaskState.FINISHED:
            self._execution = None
            return None
        if is_under_way:
            self.state = TaskState.WAITING
            execution.waited = 0.0
        return self._wait(execution, arm)

    def _set_off(self, execution: _Execution, arm: _ArmState) -> Step | None:
        """WAITING: resume the tip's path, or begin from where the arm is."""
        x_d = execution.x_d
        if x_d is not None and np.linalg.norm(arm.x - x_d) <= _AWAY:
            self.clock.resume()
            return self._follow(execution, arm)
        make_path = execution.goal.make_path
        execution.has_begun = True
        execution.x_d = None
        execution.source = make_path(arm.q) if make_path else None
        if execution.source is None:
            return self._begin_tip_path(execution, arm)
        self.clock.begin()
        self.monitor.begin()
        return self._follow(execution, arm)

    def _begin_tip_path(self, execution: _Execution, arm: _ArmState) -> Step | None:
        """To MOVING, or to FINISHED without such a path."""
        make_planner = execution.goal.make_planner
        if make_planner is None:
            self._execution = None
            self.state = TaskState.FINISHED
            return None
        execution.source = make_planner(arm.x, arm.R)
        self.clock.begin()
        self.monitor.begin()
        self.start_stamp = self.cycles.newest
        return self._follow(execution, arm)

    def _follow(self, execution: _Execution, arm: _ArmState) -> Step | None:
        """HOMING, MOVING, FINISHED: along the path of the joints or of the tip."""
        source = execution.source
        assert source is not None
        t = self.clock.t
        rate = self.clock.speed.fraction
        reference: JointReference | Reference
        if isinstance(source, JointPath):
            reference = source.reference(arm.q, t, rate)
            if reference.finished:
                return self._begin_tip_path(execution, arm)
            self.state = TaskState.HOMING
            step = Step(dq=reference.dq)
        else:
            R = arm.R if self._turns else None
            reference = source.reference(arm.x, t, R, unachieved=arm.unachieved, rate=rate)
            execution.x_d = reference.x_d
            self.state = TaskState.FINISHED if reference.finished else TaskState.MOVING
            step = Step(reference.dx, None, reference)
        place = (reference.segment, source.time_left(t), *reference.distance)
        is_finished = self.state is TaskState.FINISHED
        if not is_finished and self.monitor.enter(self._seconds, *place):
            self._end(self.monitor.remark, TaskState.STUCK)
            return None
        return step

    def _wait(self, execution: _Execution, arm: _ArmState) -> Step | None:
        """WAITING: zero velocity, at which the controller reports whether it would follow."""
        execution.waited += self._seconds
        if over := self._why_over(execution):
            self._end(over)
            return None
        if isinstance(execution.source, JointPath):
            return Step(dq=np.zeros(len(arm.q)))
        return Step(dx=np.zeros(6 if self._turns else 3))

    def _why_over(self, execution: _Execution) -> str:
        """Why a waiting goal is to be given up; empty if it is not."""
        goal = execution.goal
        if execution.has_begun and not goal.goes_on:
            return 'the motion was interrupted'
        mode = self._live_mode
        pauses = execution.has_begun and mode in ('', Mode.HOLDING.value) and not self.stop_reason
        if pauses:
            execution.waited = 0.0
        if goal.patience is None or execution.waited <= goal.patience:
            return ''
        silence = f'has not followed for {goal.patience:g} s (resume_within)'
        return f'the controller is {mode or "not there"}, and {silence}'

    def _redirect(self, goal: Goal) -> bool:
        """MOVING, FINISHED: lead the tip to the target of a goal; whether that could be done."""
        execution = self._execution
        arm = self._arm
        dx = self._step and self._step.dx
        if goal.redirect is None or execution is None or arm is None or dx is None:
            return False
        source = execution.source
        leads = self.state in (TaskState.MOVING, TaskState.FINISHED)
        if not leads or source is None or isinstance(source, JointPath):
            return False
        follower = execution.source = goal.redirect(source, arm.x, arm.R, dx, self.clock.t)
        execution.goal = goal
        is_reached = follower.is_reached(arm.x, arm.R if self._turns else None)
        self.state = TaskState.FINISHED if is_reached else TaskState.MOVING
        t = self.clock.t
        tip = np.append(arm.x, _ELEMENT * arm.R) if self._turns else arm.x
        self.monitor.redirect(t, follower.time_left(t), tip, is_reached=is_reached)
        return True

    def _end_after(self, silence: Seconds) -> None:
        """End a goal of another robot, or of long ago: a person may be near the arm. The silence
        is from the last stamp to this one, negative for another clock, or one that was set back.
        """
        patience = self._execution.goal.patience if self._execution else None
        if patience is None or -_SET_BACK < silence <= patience or self.state not in UNDER_WAY:
            return
        silent = f'silent for more than {patience:g} s (resume_within)'
        self._end(f'the robot was started again, or {silent}')

    def _end(self, reason: str, state: TaskState = TaskState.IDLE) -> None:
        """WAITING, HOMING, MOVING to IDLE or STUCK."""
        is_task = self._execution is not None and self._execution.goal.goes_on
        self.stop()
        what = 'the task is over; planner/start begins it again' if is_task else 'the goal is over'
        self._ending = f'{reason}: {what}'
        self.state = state
