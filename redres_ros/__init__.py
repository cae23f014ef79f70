"""Discrete-time redundancy resolution for arms behind a position interface (Flacco and De Luca, 2015)."""

from redres_ros.controller import Command, Controller
from redres_ros.errors import RedresError
from redres_ros.laws import LAWS, Law, make_law
from redres_ros.planner import Planner
from redres_ros.resolution import resolve
from redres_ros.robot_model import RobotModel, RobotState
from redres_ros.tasks import Task, load_task

__all__ = ['LAWS', 'Command', 'Controller', 'Law', 'Planner', 'RedresError', 'RobotModel', 'RobotState', 'Task',
           'load_task', 'make_law', 'resolve']
