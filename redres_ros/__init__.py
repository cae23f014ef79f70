"""Discrete-time redundancy resolution for arms behind a position interface (Flacco and De Luca,
2015).
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from redres_ros.command import Command
    from redres_ros.controller import Controller
    from redres_ros.errors import RedresError
    from redres_ros.files.plugins import load_plugin
    from redres_ros.laws import LAWS, Law, make_law
    from redres_ros.limits import LIMITS, Limit, make_limits
    from redres_ros.parameter import param
    from redres_ros.planning.planner import Planner
    from redres_ros.planning.waypoints import WaypointTask, load_task
    from redres_ros.preferences import (
        PREFERENCES,
        Compliance,
        ElbowHeight,
        JointCentering,
        JointLimitAvoidance,
        Manipulability,
        Posture,
        Preference,
        make_preference,
    )
    from redres_ros.resolution import resolve
    from redres_ros.robot_model import RobotModel, RobotState
    from redres_ros.simulation.batch import Result, batch
    from redres_ros.simulation.case import Case
    from redres_ros.simulation.closed_loop import run
    from redres_ros.simulation.comparison import Comparison, compare, plot
    from redres_ros.simulation.effort import Effort
    from redres_ros.simulation.recording import Recording
    from redres_ros.tasks import TASKS, Task, make_task

# Where each name lives. They are imported when first asked for: `redres --help` needs neither numpy
# nor pinocchio.
_HOMES = {
    'Command': 'command',
    'Controller': 'controller',
    'RedresError': 'errors',
    'LAWS': 'laws',
    'Law': 'laws',
    'make_law': 'laws',
    'Planner': 'planning.planner',
    'resolve': 'resolution',
    'RobotModel': 'robot_model',
    'RobotState': 'robot_model',
    'TASKS': 'tasks',
    'Task': 'tasks',
    'make_task': 'tasks',
    'LIMITS': 'limits',
    'Limit': 'limits',
    'make_limits': 'limits',
    'param': 'parameter',
    'load_plugin': 'files.plugins',
    'PREFERENCES': 'preferences',
    'Compliance': 'preferences',
    'ElbowHeight': 'preferences',
    'JointCentering': 'preferences',
    'JointLimitAvoidance': 'preferences',
    'Manipulability': 'preferences',
    'Posture': 'preferences',
    'Preference': 'preferences',
    'make_preference': 'preferences',
    'WaypointTask': 'planning.waypoints',
    'load_task': 'planning.waypoints',
    'Case': 'simulation.case',
    'Result': 'simulation.batch',
    'batch': 'simulation.batch',
    'run': 'simulation.closed_loop',
    'Effort': 'simulation.effort',
    'Recording': 'simulation.recording',
    'Comparison': 'simulation.comparison',
    'compare': 'simulation.comparison',
    'plot': 'simulation.comparison',
}

__all__ = [
    'LAWS',
    'LIMITS',
    'PREFERENCES',
    'TASKS',
    'Case',
    'Command',
    'Comparison',
    'Compliance',
    'Controller',
    'Effort',
    'ElbowHeight',
    'JointCentering',
    'JointLimitAvoidance',
    'Law',
    'Limit',
    'Manipulability',
    'Planner',
    'Posture',
    'Preference',
    'Recording',
    'RedresError',
    'Result',
    'RobotModel',
    'RobotState',
    'Task',
    'WaypointTask',
    'batch',
    'compare',
    'load_plugin',
    'load_task',
    'make_law',
    'make_limits',
    'make_preference',
    'make_task',
    'param',
    'plot',
    'resolve',
    'run',
]


def __getattr__(name: str) -> Any:
    if name not in _HOMES:
        raise AttributeError(f'module {__name__!r} has no attribute {name!r}')
    return getattr(import_module(f'{__name__}.{_HOMES[name]}'), name)


def __dir__() -> list[str]:
    return sorted(__all__)
