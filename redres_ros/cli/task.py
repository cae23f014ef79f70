"""The arm and the task of the options."""

import argparse
import sys
from dataclasses import replace
from typing import TYPE_CHECKING, NamedTuple

from redres_ros.cli.parser import OptionError

if TYPE_CHECKING:
    from redres_ros.planning.waypoints import WaypointTask
    from redres_ros.robot_model import RobotModel
    from redres_ros.robots import Arm

_NEAR = 0.01  # [m] that the tip at the start may be away from the first point
_SEARCHED = 'a triangle searched for'


class WantedMotion(NamedTuple):
    """The task, and the arm.

    Args:
        name: The task as the command line or the table of arms names it; empty: a square.
        task: The same, read.
        model: The arm.
    """

    name: str
    task: 'WaypointTask'
    model: 'RobotModel'

    @property
    def task_space(self) -> str:
        """The task space: 'position', or 'pose' if points have orientations."""
        return 'position' if self.task.orientations is None else 'pose'

    @property
    def is_searched(self) -> bool:
        """Whether it is a path that was searched for, as one on which laws differ."""
        return self.name == _SEARCHED

    @property
    def title(self) -> str:
        """Task and arm in words."""
        from redres_ros.robots import ARMS

        arm = self.model.arm
        task = self.name or 'a square before the tip'
        dynamics = f'{arm.dynamics} dynamics'
        if self.task.robot not in ARMS and arm.dynamics == 'identified':
            dynamics = 'dynamics of the URDF'
        return f'{task}, {self.task.robot}, {dynamics}'


def find_motion(options: argparse.Namespace, default: str = 'rectangle') -> WantedMotion:
    """The task and the arm.

    Args:
        options: With the task, the robot, its tip and its dynamics.
        default: The task if neither a task nor a robot is named.

    Raises:
        UnknownNameError: No such task, robot, frame or dynamics.
        FileError: A file that cannot be used.
        OptionError: A task and a robot that do not go together.
    """
    from redres_ros.planning.waypoints import load_task, task_for
    from redres_ros.robot_model import RobotModel

    if options.robot and not options.task:
        arm = _find_arm(options, options.robot)
        name = arm.task
        task = task_for(arm, options.robot)
    else:
        name = options.task or default
        task = load_task(name)
        arm = _find_arm(options, options.robot or task.robot)
    model = RobotModel(arm)
    if options.robot:
        task = replace(task, robot=options.robot)
    if options.robot or options.tip:
        _check_start(task, model)
    return WantedMotion(name, task, model)


def find_contrast(options: argparse.Namespace) -> WantedMotion:
    """The task and the arm; an arm without a task of its own gets a path on which laws differ.

    A planner node does not: such a path is none to begin with on a robot.

    Args:
        options: See find_motion().

    Raises:
        As of find_motion().
    """
    from redres_ros.simulation.random_tasks import contrasting_task

    motion = find_motion(options)
    if motion.name:
        return motion
    print('searching for a path on which laws differ', file=sys.stderr)
    task = contrasting_task(motion.model, motion.task.robot)
    return motion if task is None else motion._replace(name=_SEARCHED, task=task)


def _find_arm(options: argparse.Namespace, robot: str) -> 'Arm':
    """An arm with the tip, the elbow and the dynamics of the options. Raises RedresError."""
    from redres_ros.robots import choose_arm

    arm = choose_arm(robot, options.tip or '', options.elbow or '')
    return replace(arm, dynamics=options.dynamics)


def _check_start(task: 'WaypointTask', model: 'RobotModel') -> None:
    """Refuse a task that was written for another arm, tip or base."""
    import numpy as np

    if len(task.start) != model.n:
        raise OptionError(
            f'the task starts with {len(task.start)} joints, and {task.robot} has {model.n}; '
            'name a task of that robot with --task'
        )
    x, _ = model.tip(task.start)
    away = float(np.linalg.norm(x - task.waypoints[0]))
    if not away < _NEAR:
        raise OptionError(
            f'the tip of {task.robot} is {1e3 * away:.0f} mm away from the first point when the '
            f'task starts, at {np.round(x, 4).tolist()}; allowed: {1e3 * _NEAR:.0f} mm; '
            'name a task of that robot with --task'
        )
