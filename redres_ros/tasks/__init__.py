"""The tasks by name. A new task is one small class and one line in this table."""

from redres_ros.parameter import make
from redres_ros.tasks.joints import Elbow, Joint
from redres_ros.tasks.task import Task
from redres_ros.tasks.tip import Axis, Orientation, Pose, Position

TASKS: dict[str, type[Task]] = {
    'position': Position,
    'orientation': Orientation,
    'pose': Pose,
    'axis': Axis,
    'elbow': Elbow,
    'joint': Joint,
}


def make_task(name: str, **gains: object) -> Task:
    """The task of that name with the given gains and target, as gain=5.0.

    Raises UnknownNameError, RangeError, ArrayError.
    """
    return make('task', TASKS, name, gains)


__all__ = [
    'TASKS',
    'Axis',
    'Elbow',
    'Joint',
    'Orientation',
    'Pose',
    'Position',
    'Task',
    'make_task',
]
