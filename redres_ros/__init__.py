"""Discrete-time redundancy resolution behind a position interface (Flacco, De Luca, 2015)."""

from importlib import import_module
from typing import TYPE_CHECKING, Any

# Public names by the module that they live in, which is imported when one is first asked for:
# `redres --help` needs neither numpy nor pinocchio.
_PUBLIC = {
    'command': 'Command',
    'controller': 'Controller',
    'errors': 'RedresError',
    'files.plugins': 'load_plugin',
    'laws': 'LAWS Law make_law',
    'limits': 'LIMITS Limit make_limits',
    'parameter': 'param',
    'planning.planner': 'Planner',
    'planning.waypoints': 'WaypointTask load_task',
    'preferences': 'PREFERENCES Preference make_preference Compliance ElbowHeight JointCentering '
    'JointLimitAvoidance Manipulability Posture',
    'resolution': 'resolve',
    'preview': 'Preview',
    'robot_model': 'RobotModel RobotState',
    'simulation.batch': 'Case Result batch',
    'simulation.closed_loop': 'run',
    'simulation.recording': 'Effort Recording',
    'tasks': 'TASKS Task make_task',
}
_HOMES = {name: home for home, names in _PUBLIC.items() for name in names.split()}
__all__ = list(_HOMES)

if TYPE_CHECKING:  # for editors and type checkers, which do not run this file
    from redres_ros.command import Command as Command
    from redres_ros.controller import Controller as Controller
    from redres_ros.errors import RedresError as RedresError
    from redres_ros.files.plugins import load_plugin as load_plugin
    from redres_ros.laws import LAWS as LAWS
    from redres_ros.laws import Law as Law
    from redres_ros.laws import make_law as make_law
    from redres_ros.limits import LIMITS as LIMITS
    from redres_ros.limits import Limit as Limit
    from redres_ros.limits import make_limits as make_limits
    from redres_ros.parameter import param as param
    from redres_ros.planning.planner import Planner as Planner
    from redres_ros.planning.waypoints import WaypointTask as WaypointTask
    from redres_ros.planning.waypoints import load_task as load_task
    from redres_ros.preferences import PREFERENCES as PREFERENCES
    from redres_ros.preferences import Compliance as Compliance
    from redres_ros.preferences import ElbowHeight as ElbowHeight
    from redres_ros.preferences import JointCentering as JointCentering
    from redres_ros.preferences import JointLimitAvoidance as JointLimitAvoidance
    from redres_ros.preferences import Manipulability as Manipulability
    from redres_ros.preferences import Posture as Posture
    from redres_ros.preferences import Preference as Preference
    from redres_ros.preferences import make_preference as make_preference
    from redres_ros.preview import Preview as Preview
    from redres_ros.resolution import resolve as resolve
    from redres_ros.robot_model import RobotModel as RobotModel
    from redres_ros.robot_model import RobotState as RobotState
    from redres_ros.simulation.batch import Case as Case
    from redres_ros.simulation.batch import Result as Result
    from redres_ros.simulation.batch import batch as batch
    from redres_ros.simulation.closed_loop import run as run
    from redres_ros.simulation.recording import Effort as Effort
    from redres_ros.simulation.recording import Recording as Recording
    from redres_ros.tasks import TASKS as TASKS
    from redres_ros.tasks import Task as Task
    from redres_ros.tasks import make_task as make_task


def __getattr__(name: str) -> Any:
    if name not in _HOMES:
        raise AttributeError(f'module {__name__!r} has no attribute {name!r}')
    return getattr(import_module(f'{__name__}.{_HOMES[name]}'), name)


def __dir__() -> list[str]:
    return sorted(__all__)
