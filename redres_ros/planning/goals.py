"""Goals of the arm: a task, poses from others, or the start of a task."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from redres_ros.errors import RangeError, RedresError
from redres_ros.loop.cycle_counter import NANOSECONDS, CycleCounter
from redres_ros.parameter import Checked, param
from redres_ros.planning.joint_path import JointPath, path_to
from redres_ros.planning.planner import Planner, TargetFollower, source_of, top_speed
from redres_ros.planning.waypoints import WaypointTask
from redres_ros.preview import Preview
from redres_ros.robot_model import RobotModel
from redres_ros.types import JointPositions, Points, Position, Rotation, Seconds, TaskVelocity

_FARTHEST = 60.0  # [s] that the end of a target_path may be ahead
_ROUNDING = 1e-9  # of its speed

_Source = Planner | TargetFollower | None
_Redirect = Callable[[_Source, Position, Rotation, TaskVelocity, Seconds], TargetFollower]


class GoalError(RedresError):
    """A goal that cannot be taken at present."""


@dataclass(frozen=True)
class Goal:
    """A goal: a joint motion, then a path of the tip; either may be None."""

    make_path: Callable[[JointPositions], JointPath | None] | None = None  # None if q is at its end
    # for a tip at rest at x and R
    make_planner: Callable[[Position, Rotation], Planner | TargetFollower] | None = None
    # leads a tip that moves already at x and R with dx, at a time of the task, without a stop
    redirect: _Redirect | None = None
    goes_on: bool = False  # after a hold or a stop; if not, the first interruption ends it
    patience: Seconds | None = 2.0  # to begin or to go on; None: for ever


@dataclass(frozen=True)
class GoalSettings(Checked):
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
        'largest speed towards a target_pose and between the poses of a target_path, and the '
        'largest that feedback may add to a task [m/s]',
        1e-3,
        10.0,
    )


class Goals:
    """Makes the goals of one arm, and refuses those that it cannot reach."""

    def __init__(
        self, model: RobotModel, task: WaypointTask, settings: GoalSettings, task_space: str
    ) -> None:
        self._model = model
        self._task = task
        self._settings = settings
        self._turns = task_space == 'pose'

    def task(self) -> Goal:
        """The joints to the start of the task, then the task."""
        settings = self._settings
        return Goal(
            self.path_home,
            lambda x, R: source_of(self._task, x, R, settings.target_speed),
            goes_on=True,
            patience=None if settings.autostart else settings.resume_within,
        )

    def home(self) -> Goal:
        """The joints to the start of the task."""
        return Goal(self.path_home, patience=self._settings.resume_within)

    def path_home(self, q: JointPositions) -> JointPath | None:
        """The path of the joints to the start of the task; None at the start."""
        return path_to(self._model, q, self._task.start)

    def target(self, x: Position, R: Rotation) -> Goal:
        """The tip to a pose. Raises RangeError for a pose out of reach."""
        _check_reach(self._model, x[None])
        R_end = R if self._turns else None
        return self._to_poses(lambda follower: follower.set_target(x, R_end))

    def path(self, path: Preview, cycles: CycleCounter) -> Goal:
        """The tip along a path whose times count from the newest state. Raises RangeError for poses
        out of reach or too far apart, and for a path of another time.
        """
        begin = cycles.newest
        if not 0.0 < path.times[-1] <= _FARTHEST:
            why = "s after the robot's newest state, and not before it"
            raise RangeError('the end of the path', float(path.times[-1]), 0.0, _FARTHEST, why)
        _check_reach(self._model, path.positions)
        fastest = top_speed(path)
        if fastest > self._settings.target_speed * (1.0 + _ROUNDING):
            why = 'target_speed, m/s from a pose to the next; a turn of 1 rad counts 0.1 m'
            raise RangeError('speed of the path', fastest, 0.0, self._settings.target_speed, why)
        return self._to_poses(
            lambda follower: follower.set_path(path.after((cycles.newest - begin) / NANOSECONDS))
        )

    def _to_poses(self, lead: Callable[[TargetFollower], None]) -> Goal:
        """A goal of the follower that leads the tip already, or of a new one."""

        def redirect(
            source: _Source, x: Position, R: Rotation, dx: TaskVelocity, t: Seconds
        ) -> TargetFollower:
            if not isinstance(source, TargetFollower):
                start = R if self._turns else None
                speed = self._settings.target_speed
                source = TargetFollower(self._task, x, start, dx, t, speed=speed)
            lead(source)
            return source

        return Goal(
            make_planner=lambda x, R: redirect(None, x, R, np.zeros(6), 0.0),
            redirect=redirect,
            patience=self._settings.resume_within,
        )


def _check_reach(model: RobotModel, points: Points) -> None:
    """Raise RangeError for points beyond all links in one line, linear joints at their longest."""
    length = model.reach
    kinematics = model.kinematics
    for index in kinematics.leading:
        if kinematics.joints[index].is_prismatic:
            length += float(max(abs(model.q_min[index]), abs(model.q_max[index])))
    first = kinematics.joints[kinematics.leading[0]]
    distance = float(np.linalg.norm(points - first.before[:3, 3], axis=1).max())
    if not distance <= length:
        raise RangeError('distance from the first joint', distance, 0.0, length, 'm')
