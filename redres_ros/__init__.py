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
    from redres_ros.simulation.batch import Case, Result, batch
    from redres_ros.simulation.closed_loop import run
    from redres_ros.simulation.comparison import Comparison, compare, plot
    from redres_ros.simulation.recording import Effort, Recording
    from redres_ros.tasks import TASKS, Task, make_task

# Public names by the module that they live in, which is imported when one is first asked for:
# `redres --help` needs neither numpy nor pinocchio.
_PUBLIC = {
    'command': 'Command',
    'controller': 'Controller',
    'errors': 'RedresError',
    'laws': 'LAWS Law make_law',
    'planning.planner': 'Planner',
    'resolution': 'resolve',
    'robot_model': 'RobotModel RobotState',
    'tasks': 'TASKS Task make_task',
    'limits': 'LIMITS Limit make_limits',
    'parameter': 'param',
    'files.plugins': 'load_plugin',
    'preferences': 'PREFERENCES Preference make_preference Compliance ElbowHeight JointCentering '
    'JointLimitAvoidance Manipulability Posture',
    'planning.waypoints': 'WaypointTask load_task',
    'simulation.batch': 'Case Result batch',
    'simulation.closed_loop': 'run',
    'simulation.recording': 'Effort Recording',
    'simulation.comparison': 'Comparison compare plot',
}
_HOMES = {name: home for home, names in _PUBLIC.items() for name in names.split()}

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
