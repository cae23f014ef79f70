"""Goals of the arm: a task, a target pose, or the start of a task."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from redres_ros.errors import RangeError, RedresError
from redres_ros.geometry import PEAK_SPEED
from redres_ros.kernels.tick import rotation_error
from redres_ros.loop.cycle_counter import CycleCounter
from redres_ros.parameter import check_parameters, param
from redres_ros.planning.joint_path import JointPath, path_to
from redres_ros.planning.planner import Planner, TargetFollower, pose_distance
from redres_ros.planning.waypoints import WaypointTask
from redres_ros.robot_model import RobotModel
from redres_ros.types import JointPositions, Nanoseconds, Position, Rotation, Seconds, TaskVelocity

_SHORTEST = 0.5  # [s] that a motion takes at least
_TARGET_TIMEOUT = 1.0  # [s] largest age of a target_pose

_Redirect = Callable[
    [Planner | TargetFollower, Position, Rotation, TaskVelocity, Seconds], TargetFollower
]


class GoalError(RedresError):
    """A goal that cannot be taken at present."""


@dataclass(frozen=True)
class Goal:
    """A goal: a joint motion, then a path of the tip; either may be None."""

    make_path: Callable[[JointPositions], JointPath | None] | None = None  # None if q is at its end
    make_planner: Callable[[Position, Rotation], Planner] | None = None  # for a tip at x and R
    # leads a tip that moves already at x and R with dx, at a time of the task, without a stop
    redirect: _Redirect | None = None
    goes_on: bool = False  # after a hold or a stop; if not, the first interruption ends it
    patience: Seconds | None = 2.0  # to begin or to go on; None: for ever


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
    """Makes the goals of one arm, and refuses those that it cannot reach. Raises ArrayError for the
    task of an arm with another number of joints.
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
            goes_on=True,
            patience=None if settings.autostart else settings.resume_within,
        )

    def home(self) -> Goal:
        """The joints to the start of the task."""
        return Goal(self.path_home, patience=self._settings.resume_within)

    def path_home(self, q: JointPositions) -> JointPath | None:
        """The path of the joints to the start of the task; None at the start."""
        return path_to(self._model, q, self._task.start)

    def target(self, x: Position, R: Rotation, q: JointPositions) -> Goal:
        """The tip in a straight line to a pose, with the joints at q now. Raises RangeError for a
        pose out of reach, or so far away that it would take hours.
        """
        _check_reach(self._model, x)
        R_end = R if self._turns else None
        self._straight_line(x, R_end, *self._model.tip(q))
        return Goal(
            make_planner=partial(self._straight_line, x, R_end),
            redirect=partial(self._redirected, x, R_end),
            patience=self._settings.resume_within,
        )

    def _straight_line(
        self, x_end: Position, R_end: Rotation | None, x: Position, R: Rotation
    ) -> Planner:
        """A segment from rest at x, R."""
        speed = self._settings.target_speed
        turn = None if R_end is None else rotation_error(R, R_end)
        path = replace(
            self._task,
            waypoints=np.array((x, x_end)),
            orientations=None if R_end is None else np.array((R, R_end)),
            segment_time=max(PEAK_SPEED * pose_distance(x_end - x, turn) / speed, _SHORTEST),
        )
        return Planner(path, x, R, feedback_limit=speed)

    def _redirected(
        self,
        x_end: Position,
        R_end: Rotation | None,
        source: Planner | TargetFollower,
        x: Position,
        R: Rotation,
        dx: TaskVelocity,
        t: Seconds,
    ) -> TargetFollower:
        """The follower that leads the tip already, or a new one, with another target."""
        if not isinstance(source, TargetFollower):
            start = R if self._turns else None
            speed = self._settings.target_speed
            source = TargetFollower(self._task, x, start, dx, t, speed=speed)
        source.set_target(x_end, R_end)
        return source


def _check_reach(model: RobotModel, x: Position) -> None:
    """Refuse a point that is farther from the first joint than all links in one line, with linear
    joints at their longest. Raises RangeError.
    """
    length = model.reach
    kinematics = model.kinematics
    for index in kinematics.leading:
        if kinematics.joints[index].is_prismatic:
            length += float(max(abs(model.q_min[index]), abs(model.q_max[index])))
    first = kinematics.joints[kinematics.leading[0]]
    distance = float(np.linalg.norm(x - first.before[:3, 3]))
    if not distance <= length:
        raise RangeError('distance from the first joint', distance, 0.0, length, 'm')


def check_age(stamp: Nanoseconds, cycles: CycleCounter, time_of_day: Nanoseconds) -> None:
    """Refuse a goal of long ago; a zero stamp means now.

    One stamped by this computer's clock, which shows the time of day, counts by its arrival. Raises
    GoalError if the stamp is more than a second from the robot's clock, and from this computer's.
    """
    _, problem = cycles.judge(stamp, time_of_day, _TARGET_TIMEOUT)
    if problem:
        raise GoalError(f'{problem} (a zero stamp means now)')
