"""The tasks by name. A new task is one small class and one line in this table."""

from redres_ros.files.installed import installed
from redres_ros.files.plugins import register
from redres_ros.parameter import make
from redres_ros.tasks.task import Task
from redres_ros.tasks.tasks import (
    Axis,
    Configuration,
    Elbow,
    Joint,
    Orientation,
    Pose,
    Position,
)

TASKS: dict[str, type[Task]] = {
    'position': Position,
    'orientation': Orientation,
    'pose': Pose,
    'axis': Axis,
    'elbow': Elbow,
    'joint': Joint,
    'configuration': Configuration,
}
TASKS.update(installed('tasks'))
register(Task, TASKS)


def make_task(name: str, **gains: object) -> Task:
    """The task of that name with the given gains and target.

    Args:
        name: In the table TASKS.
        **gains: Gains and target that differ from their defaults, as gain=5.0.

    Raises:
        UnknownNameError: No task has that name.
        RangeError: A gain is outside its range.
        ArrayError: The target does not suit the task.
    """
    return make('task', TASKS, name, gains)


__all__ = [
    'TASKS',
    'Axis',
    'Configuration',
    'Elbow',
    'Joint',
    'Orientation',
    'Pose',
    'Position',
    'Task',
    'make_task',
]
