"""Discrete-time redundancy resolution for arms behind a position interface (Flacco and De Luca,
2015).
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from redres_ros.controller import Command, Controller
    from redres_ros.errors import RedresError
    from redres_ros.laws import LAWS, Law, make_law
    from redres_ros.limits import LIMITS, make_limits
    from redres_ros.planner import Planner
    from redres_ros.preferences import (
        PREFERENCES,
        ElbowHeight,
        JointCentering,
        Manipulability,
        Posture,
        Preference,
        make_preference,
    )
    from redres_ros.resolution import resolve
    from redres_ros.robot_model import RobotModel, RobotState
    from redres_ros.tasks import TASKS, Task, make_task
    from redres_ros.waypoints import WaypointTask, load_task

# Where each name lives. They are imported when first asked for: `redres --help` needs neither numpy
# nor pinocchio.
_HOMES = {
    'Command': 'controller',
    'Controller': 'controller',
    'RedresError': 'errors',
    'LAWS': 'laws',
    'Law': 'laws',
    'make_law': 'laws',
    'Planner': 'planner',
    'resolve': 'resolution',
    'RobotModel': 'robot_model',
    'RobotState': 'robot_model',
    'TASKS': 'tasks',
    'Task': 'tasks',
    'make_task': 'tasks',
    'LIMITS': 'limits',
    'make_limits': 'limits',
    'PREFERENCES': 'preferences',
    'ElbowHeight': 'preferences',
    'JointCentering': 'preferences',
    'Manipulability': 'preferences',
    'Posture': 'preferences',
    'Preference': 'preferences',
    'make_preference': 'preferences',
    'WaypointTask': 'waypoints',
    'load_task': 'waypoints',
}

__all__ = [
    'LAWS',
    'LIMITS',
    'PREFERENCES',
    'TASKS',
    'Command',
    'Controller',
    'ElbowHeight',
    'JointCentering',
    'Law',
    'Manipulability',
    'Planner',
    'Posture',
    'Preference',
    'RedresError',
    'RobotModel',
    'RobotState',
    'Task',
    'WaypointTask',
    'load_task',
    'make_law',
    'make_limits',
    'make_preference',
    'make_task',
    'resolve',
]


def __getattr__(name: str) -> Any:
    if name not in _HOMES:
        raise AttributeError(f'module {__name__!r} has no attribute {name!r}')
    return getattr(import_module(f'{__name__}.{_HOMES[name]}'), name)
