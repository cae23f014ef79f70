"""The tasks by name. A new task is one small class and one line in this table."""

from redres_ros.parameter import Table
from redres_ros.tasks.tasks import (
    Axis,
    Configuration,
    Elbow,
    Joint,
    Orientation,
    Pose,
    Position,
    Task,
)

TASKS: Table[Task] = Table(
    'task',
    Task,
    position=Position,
    orientation=Orientation,
    pose=Pose,
    axis=Axis,
    elbow=Elbow,
    joint=Joint,
    configuration=Configuration,
)
make_task = TASKS.make

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
