"""A task from its first state to its last point, through holds, stops and new robots."""

from collections.abc import Callable
from dataclasses import replace
from enum import Enum
from typing import NamedTuple

import numpy as np

from redres_ros.kernels.rotation_error import rotation_error
from redres_ros.loop.cycle_counter import NANOSECONDS, CycleCounter
from redres_ros.planning.planner import Planner, Reference
from redres_ros.planning.task_clock import TaskClock
from redres_ros.planning.waypoints import WaypointTask

_SHORTEST = 0.5  # [s] that a way takes at least
_ASTRAY = 0.05  # [m] from where it stopped, beyond which an interrupted task begins anew


class TaskState(Enum):
    """What a task run does."""

    IDLE = 'idle'
    WAITING = 'waiting'  # for a robot that takes commands and a controller that follows
    MOVING = 'moving'
    FINISHED = 'finished'


class Step(NamedTuple):
    """What is asked for at a state.

    Attributes:
        stamp: Of the state [ns].
        dx: Task velocity, (3,) [m/s], or (6,) with the angular part below [rad/s].
        reference: Where it comes from; None while the run waits for a standstill to end.
    """

    stamp: int
    dx: np.ndarray
    reference: Reference | None


def way_to(
    task: WaypointTask,
    x: np.ndarray,
    R: np.ndarray,
    x_end: np.ndarray,
    R_end: np.ndarray,
    speed: float,
) -> WaypointTask:
    """A straight way from rest to rest.

    Args:
        task: Has the gains and tolerances.
        x: Where it begins, (3,) [m].
        R: Orientation there, (3, 3).
        x_end: Where it ends, (3,) [m].
        R_end: Orientation there, (3, 3).
        speed: At most, of the tip [m/s], and of the turn ten times as many [rad/s].
    """
    distance = float(np.linalg.norm(x_end - x))
    angle = float(np.linalg.norm(rotation_error(R, R_end)))
    peak = 15.0 / 8.0  # of Eq. (36), over the mean
    return replace(
        task,
        waypoints=np.array((x, x_end)),
        orientations=np.array((R, R_end)),
        segment_time=max(peak * max(distance, angle / 10.0) / speed, _SHORTEST),
    )


class TaskExecutor:
    """Decides at every state what is asked for, and when the task's time goes on.

    The task begins when it is wanted and the controller follows. A stop or a hold interrupts it; it
    goes on from there when the controller follows again, or begins anew if the arm is elsewhere by
    then. A finished task is over with the first interruption: nothing moves again by itself. So is
    one under way with a robot that was started again.

    Args:
        T: The robot's cycle [s].
        make_planner: A new planner for a tip at (3,) [m] with orientation (3, 3).
        task_clock: The task's time.
        task_space: 'position' or 'pose': what is asked for, 3-D or 6-D.
        resume_within: A longer silence of the robot, or another clock, is a robot that was started
            again [s]; None: the task goes on all the same.
    """

    def __init__(
        self,
        T: float,
        make_planner: Callable[[np.ndarray, np.ndarray], Planner],
        task_clock: TaskClock,
        task_space: str = 'position',
        resume_within: float | None = None,
    ) -> None:
        self.state = TaskState.IDLE
        self.start_stamp = 0  # stamp of the state at which the task began [ns]
        self._make_planner = make_planner
        self._turns = task_space == 'pose'
        self._task_clock = task_clock
        self._resume_within = resume_within
        self._cycles = CycleCounter(round(NANOSECONDS * T))
        self._planner: Planner | None = None
        self._x_d = np.zeros(3)  # asked for last [m]
        self._asks = False
        self._step: Step | None = None

    def start(self) -> None:
        """Begin as soon as the controller follows; a run that is under way goes on."""
        if self.state in (TaskState.IDLE, TaskState.FINISHED):
            self.begin_anew()

    def begin_anew(self) -> None:
        """Begin from where the arm is, also in the middle of a run."""
        self._planner = None
        self._asks = True
        self.state = TaskState.WAITING

    def stop(self) -> None:
        """Ask for nothing any more."""
        self._planner = None
        self._asks = False
        self._step = None
        self.state = TaskState.IDLE

    def set_scaling(self, scaling: float) -> None:
        """Take in what share of the task velocity the controller carries out."""
        self._task_clock.set_scaling(scaling)

    @property
    def is_due(self) -> bool:
        """Whether the segment under way should be over: what is lost matters only then."""
        return self._planner is not None and self._planner.is_due(self._task_clock.t)

    def enter_state(
        self,
        stamp: int,
        x: np.ndarray,
        R: np.ndarray,
        now: float,
        unachieved: np.ndarray | None = None,
    ) -> Step | None:
        """What is asked for at a state, None for nothing; the same again at the same state.

        Args:
            stamp: Of the state [ns].
            x: Tip position, (3,) [m].
            R: Tip orientation, (3, 3).
            now: Arrival of the state by a monotonic clock [s].
            unachieved: The part of the last dx that a singularity blocks; None for nothing.

        Raises:
            ClockError: The stamp is not that of a new cycle.
        """
        is_new = not stamp or stamp != self._cycles.newest
        if is_new:
            before = self._cycles.newest
            cycles = self._cycles.enter(stamp, now)
            if cycles == 0:
                self._task_clock.interrupt()
                self._give_up_after((stamp - before) / NANOSECONDS)
            self._task_clock.advance(cycles)
        if is_new or self._step is None:
            self._step = self._respond(stamp, x, R, unachieved)
        return self._step

    def _respond(
        self, stamp: int, x: np.ndarray, R: np.ndarray, unachieved: np.ndarray | None
    ) -> Step | None:
        if not self._task_clock.follows:
            self._interrupt()
        if not self._asks:
            return None
        if not self._task_clock.follows:
            return Step(stamp, np.zeros(6 if self._turns else 3), None)
        planner = self._planner_for(stamp, x, R)
        turned = R if self._turns else None
        reference = planner.reference(
            x, self._task_clock.t, turned, unachieved=unachieved, rate=self._task_clock.rate
        )
        self._x_d = reference.x_d
        self.state = TaskState.FINISHED if reference.finished else TaskState.MOVING
        return Step(stamp, reference.dx, reference)

    def _give_up_after(self, silence: float) -> None:
        """Stop a task that was begun with another robot, or long ago: somebody may be near the arm.

        Args:
            silence: From the last stamp to this one [s]; negative for another clock.
        """
        if self._resume_within is None or 0.0 < silence <= self._resume_within:
            return
        begun = self._planner is not None
        if begun and self.state in (TaskState.WAITING, TaskState.MOVING):
            self.stop()

    def _interrupt(self) -> None:
        if self.state is TaskState.FINISHED:
            self._asks = False
        elif self.state is TaskState.MOVING:
            self.state = TaskState.WAITING

    def _planner_for(self, stamp: int, x: np.ndarray, R: np.ndarray) -> Planner:
        """The one at work, or a new one where the task begins or begins anew."""
        resumes = self._planner is not None and self.state is TaskState.WAITING
        if resumes and np.linalg.norm(x - self._x_d) > _ASTRAY:
            self._planner = None
        if self._planner is None:
            self._planner = self._make_planner(x, R)
            self._task_clock.begin()
            self.start_stamp = stamp
        elif resumes:
            self._task_clock.resume()
        return self._planner
