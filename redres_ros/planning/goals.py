"""Goals of the arm: a task, a target pose, or the start of a task."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from redres_ros.errors import RedresError
from redres_ros.geometry import PEAK_SPEED
from redres_ros.kernels.tick import rotation_error
from redres_ros.loop.cycle_counter import NANOSECONDS, is_of_this_moment
from redres_ros.parameter import check_parameters, param
from redres_ros.planning.joint_path import JointPath, path_to
from redres_ros.planning.planner import LEVER, Planner, ReferenceSource, TargetFollower
from redres_ros.planning.waypoints import WaypointTask
from redres_ros.robot_model import RobotModel
from redres_ros.types import JointPositions, Nanoseconds, Position, Rotation, Seconds, TaskVelocity

_SHORTEST = 0.5  # [s] that a motion takes at least
_TARGET_ACCELERATION = 1.0  # [m/s^2] towards a target_pose that replaces another
_TARGET_TIMEOUT = 1.0  # [s] largest age of a target_pose
_HOME_SPEED = 0.25  # fraction of the arm's limits on the way to the start of the task
_HOME_TOLERANCE = 0.02  # [rad] of a joint from there within which the task begins at once


class GoalError(RedresError):
    """A goal that cannot be taken at present."""


class Target(NamedTuple):
    """A pose of the tip (R None: a position), and how a tip in motion is led there: from x, R with
    a task velocity, at a time of the task.
    """

    x: Position
    R: Rotation | None
    make_follower: Callable[[Position, Rotation, TaskVelocity, Seconds], TargetFollower]

    def is_that_of(self, other: 'Target') -> bool:
        """Whether both are the same pose."""
        if self.R is not None and other.R is not None and not np.array_equal(self.R, other.R):
            return False
        return np.array_equal(self.x, other.x)


@dataclass(frozen=True)
class Goal:
    """A goal: a joint motion, then a path of the tip.

    Attributes:
        make_path: A joint-space motion from q; gives None if the arm is there already. None: no
            such motion.
        make_planner: What leads a tip at x and R; None: no path of the tip.
        duration: How long that path takes [s].
        goes_on: Whether it goes on after a hold or a stop; if not, it ends with the first
            interruption.
        target: What a tip that moves already is led to, without a stop; None: it begins from rest.
        patience: How long it waits, to begin or to go on [s]; None: for ever.
    """

    make_path: Callable[[JointPositions], JointPath | None] | None = None
    make_planner: Callable[[Position, Rotation], ReferenceSource] | None = None
    duration: Seconds = 0.0
    goes_on: bool = False
    target: Target | None = None
    patience: Seconds | None = 2.0


@dataclass(frozen=True)
class GoalSettings:
    """How goals are made, and for how long they wait."""

    autostart: bool = param(
        False, 'begin as soon as the robot takes commands instead of waiting for planner/start'
    )
    resume_within: float = param(
        2.0,
        'how long a goal waits for the robot and the controller, to begin or to go on; after a '
        'longer time, as of a driver that was started again, it is over. With autostart the task '
        'waits for ever [s]',
        0.0,
        1e6,
    )
    target_speed: float = param(
        0.2,
        'largest speed towards a target_pose, and the largest that feedback may add to a task '
        '[m/s]',
        1e-3,
        10.0,
    )

    def __post_init__(self) -> None:
        check_parameters(self)


class Goals:
    """Makes the goals of one arm, and refuses those that it cannot reach.

    Raises:
        ArrayError: The task is that of an arm with another number of joints.
    """

    def __init__(
        self, model: RobotModel, task: WaypointTask, settings: GoalSettings, task_space: str
    ) -> None:
        task.check_joints(model.n)
        self._model = model
        self._task = task
        self._settings = settings
        self._turns = task_space == 'pose'

    def task(self) -> Goal:
        """The joints to the start of the task, then the task."""
        settings = self._settings
        return Goal(
            self.path_home,
            lambda x, R: Planner(self._task, x, R, feedback_limit=settings.target_speed),
            self._task.segments * self._task.segment_time,
            goes_on=True,
            patience=None if settings.autostart else settings.resume_within,
        )

    def home(self) -> Goal:
        """The joints to the start of the task."""
        return Goal(self.path_home, patience=self._settings.resume_within)

    def path_home(self, q: JointPositions) -> JointPath | None:
        """The path of the joints to the start of the task; None at the start."""
        return path_to(self._model, q, self._task.start, _HOME_SPEED, _HOME_TOLERANCE)

    def target(self, x_end: Position, R_end: Rotation, q: JointPositions) -> Goal:
        """The tip in a straight line to a pose, with the joints at q now. Raises RangeError for a
        pose out of reach, or so far away that it would take hours.
        """
        speed = self._settings.target_speed
        self._model.check_reach(x_end)

        def make_planner(x: Position, R: Rotation) -> Planner:
            path = straight_segment(self._task, x, R, x_end, R_end, speed, turns=self._turns)
            return Planner(path, x, R, feedback_limit=speed)

        def make_follower(x: Position, R: Rotation, dx: TaskVelocity, t: Seconds) -> TargetFollower:
            start = R if self._turns else None
            follower = TargetFollower(
                self._task, x, start, dx, t, speed=speed, acceleration=_TARGET_ACCELERATION
            )
            follower.set_target(target.x, target.R)
            return follower

        make_planner(*self._model.tip(q))
        target = Target(x_end, R_end if self._turns else None, make_follower)
        return Goal(make_planner=make_planner, target=target, patience=self._settings.resume_within)

    def check_age(self, stamp: Nanoseconds, now: Nanoseconds, time_of_day: Nanoseconds) -> None:
        """Refuse a goal of long ago; one stamped by this computer's clock counts by its arrival.

        Args:
            stamp: Stamp of the goal; 0 means now.
            now: Time by the robot's clock.
            time_of_day: Time by this computer's clock.

        Raises:
            GoalError: The stamp is further than a second from now, by either clock.
        """
        age = (now - stamp) / NANOSECONDS
        timeout = _TARGET_TIMEOUT
        if stamp and abs(age) > timeout and not is_of_this_moment(stamp, time_of_day, timeout):
            side = 'behind' if age > 0.0 else 'ahead of'
            raise GoalError(
                f"stamped {abs(age):.4g} s {side} the robot's clock; allowed: {timeout:g} "
                '(a zero stamp means now)'
            )


def straight_segment(
    task: WaypointTask,
    x: Position,
    R: Rotation,
    x_end: Position,
    R_end: Rotation,
    speed: float,
    *,
    turns: bool = True,
) -> WaypointTask:
    """A straight segment from rest at x, R to rest, with the gains and tolerances of a task.

    Args:
        task: See above.
        x: Where it begins.
        R: Orientation there.
        x_end: Where it ends.
        R_end: Orientation there.
        speed: Largest speed of the tip [m/s], and of the turn ten times as many [rad/s].
        turns: Whether the orientation is part of the task.
    """
    distance = float(np.linalg.norm(x_end - x))
    angle = float(np.linalg.norm(rotation_error(R, R_end))) if turns else 0.0
    return replace(
        task,
        waypoints=np.array((x, x_end)),
        orientations=np.array((R, R_end)) if turns else None,
        segment_time=max(PEAK_SPEED * max(distance, LEVER * angle) / speed, _SHORTEST),
    )
