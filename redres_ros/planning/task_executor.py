"""A goal from its first state to its end, through holds, stops and new robots."""

from collections.abc import Callable
from dataclasses import dataclass
from enum import Enum
from typing import NamedTuple

import numpy as np

from redres_ros.loop.cycle_counter import NANOSECONDS, CycleCounter
from redres_ros.planning.goals import Goal
from redres_ros.planning.joint_path import JointPath
from redres_ros.planning.planner import LEVER, Reference, ReferenceSource, TargetFollower
from redres_ros.planning.progress import ProgressMonitor
from redres_ros.planning.task_clock import TaskClock
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
_HELD = 0.5  # [s] for which a controller that could move holds, until that counts as asked for
_HOLDING = 'holding'  # modes of the controller
_MOVING = 'moving'


class TaskState(Enum):
    """The state of a task."""

    IDLE = 'idle'
    WAITING = 'waiting'  # for a robot that takes commands and a controller that follows
    HOMING = 'homing'  # in joint space
    MOVING = 'moving'
    FINISHED = 'finished'
    STUCK = 'stuck'  # given up


UNDER_WAY = (TaskState.WAITING, TaskState.HOMING, TaskState.MOVING)


class Step(NamedTuple):
    """The velocity for a state: of the task (dx), or of the joints (dq).

    Attributes:
        reference: Where dx comes from; None while nothing of the tip's path is asked for.
    """

    stamp: Nanoseconds
    dx: TaskVelocity | None = None
    dq: JointVelocities | None = None
    reference: Reference | None = None


class _ArmState(NamedTuple):
    stamp: Nanoseconds
    q: JointPositions
    x: Position
    R: Rotation
    unachieved: TaskVelocity | None


@dataclass
class _Pursuit:
    """A goal in execution.

    Attributes:
        goal: What is asked for.
        path: Path of the joints, which comes first; None before it is known, or if there is none.
        source: What leads the tip afterwards; None before it begins.
        has_begun: Whether anything of it was asked for.
        at_home: Whether the tip's path may begin.
        x_d: Position that was asked for last.
        waited: Time spent waiting for the controller, without a break [s].
        held: Part of it in the controller's present mode [s].
    """

    goal: Goal
    path: JointPath | None = None
    source: ReferenceSource | None = None
    has_begun: bool = False
    at_home: bool = False
    x_d: Position | None = None
    waited: Seconds = 0.0
    held: Seconds = 0.0


class TaskExecutor:
    """Decides at every state the velocity, and when the time of the goal advances.

    A goal begins when the controller follows. Before that it ends with a stop of the robot, with a
    hold that was asked for, and when its patience is over: nothing is executed that was asked for
    long ago. A task that is interrupted by a hold goes on when the hold ends; after any other
    interruption it goes on within its patience. It begins again if the arm is elsewhere by then. A
    finished goal is over with the first interruption, and every goal with a robot that was started
    again.

    Attributes:
        start_stamp: Stamp of the state at which the tip's path began.
    """

    def __init__(
        self,
        T: Seconds,
        task_clock: TaskClock,
        monitor: ProgressMonitor,
        task_space: str = 'position',
    ) -> None:
        self.state = TaskState.IDLE
        self.start_stamp: Nanoseconds = 0
        self._T = T
        self._turns = task_space == 'pose'
        self._task_clock = task_clock
        self._monitor = monitor
        self._cycles = CycleCounter(round(NANOSECONDS * T))
        self._mode = ''  # of the controller; empty: unknown
        self._stopped = ''  # why the robot has stopped
        self._ending = ''  # why the goal was over before its end
        self._pursuit: _Pursuit | None = None
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
        before = self._pursuit
        goes_on = self.state is TaskState.HOMING and goal.make_path is not None
        self.stop()
        self._pursuit = _Pursuit(goal)
        self.state = TaskState.WAITING
        if before is not None and goes_on:
            self._pursuit.path = before.path
            self._pursuit.has_begun = True
            self.state = TaskState.HOMING

    def _redirect(self, goal: Goal) -> bool:
        """Lead a tip in motion to the target of a goal; whether that could be done."""
        pursuit = self._pursuit
        target = goal.target
        arm = self._arm
        if target is None or pursuit is None or arm is None:
            return False
        before = pursuit.goal.target
        is_moving = self.state is TaskState.MOVING
        if is_moving and before is not None and target.is_that_of(before):
            return True
        source = pursuit.source
        if isinstance(source, TargetFollower) and (is_moving or self.state is TaskState.FINISHED):
            source.set_target(target.x, target.R)
        elif is_moving and self._step is not None and self._step.dx is not None:
            pursuit.source = target.make_follower(arm.x, arm.R, self._step.dx, self._task_clock.t)
        else:
            return False
        pursuit.goal = goal
        pursuit.path = None
        self.state = TaskState.MOVING
        self._monitor.begin()
        return True

    def stop(self) -> None:
        """Drop the goal."""
        self._pursuit = None
        self._step = None
        self._ending = ''
        self._monitor.begin()
        self.state = TaskState.IDLE

    def set_scaling(self, scaling: float) -> None:
        """Record the task scaling of the controller."""
        self._task_clock.set_scaling(scaling)

    def set_mode(self, mode: str) -> None:
        """Record the mode of the controller."""
        if self._pursuit is not None and mode != self._mode:
            self._pursuit.held = 0.0
        self._mode = mode

    def set_active_limits(self, limits: str) -> None:
        """Record which joints are at which limits; empty for none."""
        self._monitor.set_active_limits(limits)

    def set_stop_reason(self, reason: str) -> None:
        """Record why the robot has stopped; empty: it has not."""
        self._stopped = reason
        pursuit = self._pursuit
        if pursuit is None or not reason or self.state not in UNDER_WAY:
            return
        waits = not pursuit.has_begun and pursuit.goal.patience is not None
        if waits or not pursuit.goal.goes_on:
            self._end(f'the robot has stopped: {reason}')

    @property
    def is_due(self) -> bool:
        """Whether the current segment should be over: unachieved velocity matters only then."""
        source = None if self._pursuit is None else self._pursuit.source
        return source is not None and source.time_left(self._task_clock.t) <= 0.0

    @property
    def progress(self) -> float:
        """The fraction of the goal's duration that is over, 0 to 1."""
        pursuit = self._pursuit
        if self.state is TaskState.FINISHED or pursuit is None:
            return float(self.state is TaskState.FINISHED)
        t = self._task_clock.t
        whole = pursuit.goal.duration
        done = 0.0
        if pursuit.source is not None:
            whole = pursuit.source.duration
            done = pursuit.source.elapsed(t)
        if pursuit.path is not None:
            duration = pursuit.path.duration
            whole += duration
            done += duration if pursuit.at_home else min(t, duration)
        return done / whole if whole > 0.0 else 0.0

    @property
    def remark(self) -> str:
        """Why the goal makes no progress, or ended early; empty while all is well."""
        return self._ending or self._monitor.remark

    @property
    def is_paused(self) -> bool:
        """Whether a goal that has begun waits for the controller to follow again."""
        has_begun = self._pursuit is not None and self._pursuit.has_begun
        return has_begun and self.state is TaskState.WAITING

    def enter_state(
        self,
        stamp: Nanoseconds,
        q: JointPositions,
        x: Position,
        R: Rotation,
        now: Seconds,
        unachieved: TaskVelocity | None = None,
    ) -> Step | None:
        """What is asked for at a state, None for nothing; the same again at the same state.

        Args:
            stamp: Stamp of the state.
            q: Joint positions.
            x: Tip position.
            R: Tip orientation.
            now: Arrival of the state by a monotonic clock.
            unachieved: The part of the last dx that a singularity blocks; None for nothing.

        Raises:
            ClockError: The stamp is not that of a new cycle.
        """
        is_new = not stamp or stamp != self._cycles.newest
        self._seconds = 0.0
        if is_new:
            before = self._cycles.newest
            cycles = self._cycles.enter(stamp, now)
            self._seconds = cycles * self._T
            if cycles == 0:
                self._task_clock.interrupt()
            if cycles != 1 and before:
                self._end_after((stamp - before) / NANOSECONDS)
            self._task_clock.advance(cycles)
        if is_new or self._step is None:
            self._arm = _ArmState(stamp, q, x, R, unachieved)
            self._step = self._next_step(self._arm)
        return self._step

    def _next_step(self, arm: _ArmState) -> Step | None:
        pursuit = self._pursuit
        if pursuit is None:
            return None
        if self._is_interrupted:
            return self._wait(pursuit, arm)
        is_away = pursuit.x_d is not None and np.linalg.norm(arm.x - pursuit.x_d) > _AWAY
        if self.state is TaskState.WAITING and is_away:
            pursuit.source = None
            pursuit.at_home = False
        if not pursuit.at_home:
            step = self._go_home(pursuit, arm)
            if not pursuit.at_home:
                return step
        make_planner = pursuit.goal.make_planner
        if make_planner is not None:
            return self._follow_path(pursuit, make_planner, arm)
        self._pursuit = None
        self.state = TaskState.FINISHED
        return None

    @property
    def _is_interrupted(self) -> bool:
        """Whether the controller does not follow; at a limit it follows, but at no speed."""
        may_be_at_limit = self.state in (TaskState.HOMING, TaskState.MOVING)
        is_at_limit = may_be_at_limit and self._mode == _MOVING and self._task_clock.is_receiving
        return not (self._task_clock.follows or is_at_limit)

    def _wait(self, pursuit: _Pursuit, arm: _ArmState) -> Step | None:
        """Zero velocity: the controller reports whether it would follow."""
        if self.state is TaskState.FINISHED:
            self._pursuit = None
            return None
        if self.state is not TaskState.WAITING:
            self.state = TaskState.WAITING
            pursuit.waited = 0.0
            pursuit.held = 0.0
        pursuit.waited += self._seconds
        pursuit.held += self._seconds
        over = self._why_over(pursuit)
        if over:
            self._end(over)
            return None
        if pursuit.path is not None and not pursuit.at_home:
            return Step(arm.stamp, dq=np.zeros(len(arm.q)))
        return Step(arm.stamp, dx=np.zeros(6 if self._turns else 3))

    def _why_over(self, pursuit: _Pursuit) -> str:
        """Why a waiting goal is to be given up; empty if it is not."""
        goal = pursuit.goal
        if pursuit.has_begun and not goal.goes_on:
            return 'the motion was interrupted'
        is_held = self._mode == _HOLDING and pursuit.held > _HELD
        if is_held and not pursuit.has_begun:
            return 'the controller holds (controller/hold)'
        pauses = pursuit.has_begun and self._mode in ('', _HOLDING) and not self._stopped
        if pauses or goal.patience is None or pursuit.waited <= goal.patience:
            return ''
        return f'the controller has not followed for {goal.patience:g} s (resume_within)'

    def _go_home(self, pursuit: _Pursuit, arm: _ArmState) -> Step | None:
        """The joint velocity towards the start of the tip's path."""
        make_path = pursuit.goal.make_path
        if self.state is TaskState.WAITING:
            pursuit.path = make_path(arm.q) if make_path else None
            self._task_clock.begin()
            self._monitor.begin()
        pursuit.has_begun = True
        path = pursuit.path
        t = self._task_clock.t
        reference = path.reference(arm.q, t, self._task_clock.rate) if path else None
        if path is None or reference is None or reference.finished:
            pursuit.at_home = True
            return None
        self.state = TaskState.HOMING
        left = max(path.duration - t, 0.0)
        error = float(np.abs(reference.error).max())
        self._watch(0, left, error, f'a joint is {error:.3g} rad from', 'the start of the task')
        return Step(arm.stamp, dq=reference.dq) if self._pursuit else None

    def _follow_path(
        self,
        pursuit: _Pursuit,
        make_planner: Callable[[Position, Rotation], ReferenceSource],
        arm: _ArmState,
    ) -> Step | None:
        """The task velocity along the tip's path."""
        if pursuit.source is None:
            pursuit.source = make_planner(arm.x, arm.R)
            self._task_clock.begin()
            self._monitor.begin()
            self.start_stamp = arm.stamp
        elif self.state is TaskState.WAITING:
            self._task_clock.resume()
        t = self._task_clock.t
        reference = pursuit.source.reference(
            arm.x,
            t,
            arm.R if self._turns else None,
            unachieved=arm.unachieved,
            rate=self._task_clock.rate,
        )
        pursuit.x_d = reference.x_d
        step = Step(arm.stamp, reference.dx, None, reference)
        if reference.finished:
            self.state = TaskState.FINISHED
            return step
        self.state = TaskState.MOVING
        error = float(np.linalg.norm(reference.error))
        distance = f'the tip is {error:.3g} m from'
        if reference.orientation_error is not None:
            angle = float(np.linalg.norm(reference.orientation_error))
            distance = f'the tip is turned by {angle:.3g} rad, and {error:.3g} m from'
            error = max(error, LEVER * angle)
        left = pursuit.source.time_left(t)
        self._watch(reference.segment, left, error, distance, 'the next point')
        return step if self._pursuit else None

    def _watch(self, segment: int, left: Seconds, error: float, distance: str, end: str) -> None:
        """Give up a goal without progress; arguments as of ProgressMonitor.enter()."""
        if left > 0.0:
            distance = f'{left:.3g} s before'
        self._monitor.enter(self._seconds, segment, left, error, f'{distance} {end}')
        if self._monitor.is_hopeless:
            self._end(self._monitor.reason(self._monitor.give_up_after))
            self.state = TaskState.STUCK

    def _end_after(self, silence: Seconds) -> None:
        """End a goal of another robot, or of long ago: a person may be near the arm. The silence
        is from the last stamp to this one, negative for another clock.
        """
        patience = self._pursuit.goal.patience if self._pursuit else None
        if patience is None or 0.0 < silence <= patience or self.state not in UNDER_WAY:
            return
        self._end(
            f'the robot was started again, or silent for more than {patience:g} s (resume_within)'
        )

    def _end(self, reason: str) -> None:
        """Give the goal up."""
        is_task = self._pursuit is not None and self._pursuit.goal.goes_on
        self.stop()
        what = 'the task is over; planner/start begins it again' if is_task else 'the goal is over'
        self._ending = f'{reason}: {what}'
