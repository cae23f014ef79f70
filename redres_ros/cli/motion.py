"""The motion that the options describe: the task, the arm, and what the controller is to do."""

import argparse
from collections.abc import Sequence
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np

from redres_ros.cli.options import NONE, OptionError, read_settings
from redres_ros.controller import SAMPLING_TIME, Controller
from redres_ros.errors import UnknownNameError
from redres_ros.laws import LAWS, Law
from redres_ros.parameter import Gain, Parameter, check_value
from redres_ros.planning.waypoints import WaypointTask, load_task, task_for
from redres_ros.preferences import PREFERENCES
from redres_ros.robot_model import RobotModel
from redres_ros.robots import ARMS, choose_arm
from redres_ros.robots.arm import ACCELERATIONS
from redres_ros.robots.joint_limits import with_accelerations
from redres_ros.simulation.batch import Case, make_controller
from redres_ros.tasks import TASKS

# Fields of a case that are parameters of the nodes by the same name.
_SAME = ('law', 'dynamics', 'limit_scale', 'torque_scale', 'scaling')
_LISTS = ('limits', 'preferences', 'secondary_tasks')
_ACCELERATION = 'acceleration_limit'  # of the arm, which --set takes as the nodes do
_NEAR = 0.01  # [m] that the tip at the start may be away from the first point


class _NamedMotion(NamedTuple):
    """A task with its arm, and a case: all that the controller takes, by names and gains."""

    name: str  # of the task, as the command line or the table of arms has it; empty: a square
    task: WaypointTask
    model: RobotModel
    case: Case
    acceleration_limit: str | tuple[float, ...]  # as given; empty: the arm's own

    def law(self, name: str = '') -> Law:
        """The law of that name, or of the case, with the gains of the case."""
        return LAWS.resolve(name or self.case.law, self.case.gains)

    @property
    def title(self) -> str:
        """Task, arm, period and limits in words."""
        space = 'position' if self.task.orientations is None else 'pose'
        dynamics = f'{self.model.arm.dynamics} dynamics'
        if self.task.robot not in ARMS and self.model.arm.dynamics == 'identified':
            dynamics = 'dynamics of the URDF'
        how = f'T = {1e3 * self.case.T:g} ms, limits: {", ".join(self.case.limits) or NONE}'
        name = self.name or 'a square before the tip'
        return f'{name}, {space} task, {self.task.robot}, {dynamics}, {how}'

    def controller(self, switch_time: float = 0.0) -> Controller:
        """The controller of the case. Raises RedresError for a value that is not allowed."""
        pose = self.task.orientations is not None
        return make_controller(self.case, self.model, pose=pose, switch_time=switch_time)


def find_motions(options: argparse.Namespace, laws: Sequence[str]) -> list[_NamedMotion]:
    """The motion under each of some laws; the paper's without a task and a robot.

    A law is NAME, NAME@DAMPING or NAME@GAIN=VALUE. Raises RedresError for an unknown name, a file
    that cannot be used, a task and a robot that do not go together, or a gain that is not in use.
    """
    name = options.task or ('' if options.robot else 'rectangle')
    robot = options.robot or load_task(name).robot
    settings = read_settings(options.set or ())
    given = _converted(settings.pop(_ACCELERATION, ()), ())
    if not isinstance(given, str | tuple):
        raise OptionError(f'--set {_ACCELERATION}={given}; expected a list, such as [5], or a file')
    if isinstance(given, tuple):
        check_value(_ACCELERATION, given, Parameter('', *ACCELERATIONS))
    arm = with_accelerations(choose_arm(robot, options.tip, options.elbow), given)
    arm = replace(arm, dynamics=options.dynamics)
    model = RobotModel(arm)
    task = task_for(arm, robot, name)
    if options.robot or options.tip or task.times is not None:
        _check_start(task, model)
    case = _find_case(options, laws, settings)
    cases = [_with_law(case, text) for text in laws]
    return [_NamedMotion(name or arm.task, task, model, each, given) for each in cases]


def _with_law(case: Case, text: str) -> Case:
    """The case under a law, with its own gain in place of the case's."""
    name, at, own = text.partition('@')
    if not at:
        return replace(case, law=name)
    gain, _, value = own.rpartition('=')
    expected = 'a name, NAME@DAMPING or NAME@GAIN=VALUE, such as minimum_acceleration@horizon=2'
    number = _number_in('--law', text, value if gain else own, expected)
    gains = {**case.gains, gain or 'damping': number}
    law = LAWS.resolve(name, gains)
    known = [each.key for each in LAWS.gains(name)]
    if gain and gain not in known:
        raise UnknownNameError(f'gain of {name}', gain, known)
    if not gain and not law.has_memory:
        raise OptionError(f'--law {text}; {name} has no velocity history, and so no damping')
    return replace(case, law=name, gains=gains)


def _find_case(options: argparse.Namespace, laws: Sequence[str], settings: dict[str, Any]) -> Case:
    """The case of some laws, before one of them is chosen."""
    check_value('period', options.period, SAMPLING_TIME)
    limits: tuple[str, ...] = ()
    if options.limits != NONE:
        limits = tuple(name.strip() for name in options.limits.split(','))
    preferences = [text.partition('=') for text in options.prefer or ()]
    case = Case(
        options.robot or 'lwr4_paper',
        T=options.period,
        limits=limits,
        limit_scale=options.limit_scale,
        torque_scale=options.torque_scale,
        scaling=options.scaling,
        preferences=tuple(name for name, _, _ in preferences),
        secondary_tasks=tuple(options.secondary or ()),
        gains=settings,
        tip_frame=options.tip,
        elbow_frame=options.elbow,
        dynamics=options.dynamics,
    )
    _check_scales(case)
    names = [name.partition('@')[0] for name in laws]
    if all(name in LAWS and not LAWS[name].has_memory for name in names):
        is_damped = options.damping is not None
        given = {'prefer': preferences, 'damping': is_damped, 'set damping': 'damping' in settings}
        for option in filter(given.get, given):
            known = 'laws with velocity history'
            raise OptionError(f'--{option} acts on {known}; in use: {", ".join(names)}')
    gains = _checked_gains(case, laws)
    for name, equals, text in preferences:
        if equals:
            expected = 'NAME=GAIN, such as joint_centering=4'
            gain = _number_in('--prefer', f'{name}={text}', text, expected)
            gains[f'{name.partition("@")[0]}.gain'] = gain
    if options.damping is not None:
        gains['damping'] = options.damping
    return replace(case, gains=gains)


def node_parameters(motion: _NamedMotion) -> dict[str, Any]:
    """The nodes' parameters. Raises OptionError for a target open by default, which no node has."""
    case = motion.case
    for gain in (*PREFERENCES.gains(), *TASKS.gains()):
        if gain.key in case.gains and gain.default == ():
            raise OptionError(f'--set {gain.key} is not for nodes, which take the start for it')
    lists = {name: getattr(case, name) or (NONE,) for name in _LISTS}  # ROS: none is no value
    parameters: dict[str, Any] = {
        **case.gains,
        **{name: getattr(case, name) for name in _SAME},
        **lists,
        'damping': motion.law(case.law).damping,
        'rate': 1.0 / case.T,
        'robot': motion.task.robot,
        'task': motion.name,
        'task_space': 'position' if motion.task.orientations is None else 'pose',
    }
    if motion.acceleration_limit:
        parameters[_ACCELERATION] = motion.acceleration_limit
    if case.tip_frame:
        parameters['tip_frame'] = case.tip_frame
    return parameters


def _checked_gains(case: Case, laws: Sequence[str]) -> dict[str, Any]:
    """The gains of a case as their owners take them; one whose owner is not in use is refused."""
    if not case.gains:
        return {}
    from redres_ros.limits import LIMITS  # compiled: loaded only if needed

    owners: dict[str, list[Gain]] = {}
    used: set[str] = set()
    for table, entries in (
        (LAWS, laws),
        (PREFERENCES, case.preferences),
        (TASKS, case.secondary_tasks),
        (LIMITS, case.limits),
    ):
        used.update(f'{table.kind} {entry.partition("@")[0]}' for entry in entries)
        for gain in table.gains():
            owners.setdefault(gain.key, []).append(gain)
    gains = {}
    for key, value in case.gains.items():
        if key not in owners:
            raise UnknownNameError('gain', key, (*owners, _ACCELERATION))
        if used.isdisjoint(f'{gain.kind} {gain.owner}' for gain in owners[key]):
            owner = f'{owners[key][0].kind} {owners[key][0].owner}'
            raise OptionError(f'--set {key} acts on the {owner}; in use: {", ".join(sorted(used))}')
        gains[key] = _converted(value, owners[key][0].default)
    return gains


def _number_in(option: str, text: str, number: str, expected: str) -> float:
    """The number in an option's text. Raises OptionError."""
    try:
        return float(number)
    except ValueError:
        raise OptionError(f'{option} {text}; expected {expected}') from None


def _converted(value: Any, default: Any) -> Any:
    """A value in the type of a gain's default; what is of another type is left to its check."""
    if isinstance(default, tuple) and isinstance(value, list):
        return tuple(_converted(member, 0.0) for member in value)
    is_whole = isinstance(value, int) and not isinstance(value, bool)
    return float(value) if is_whole and isinstance(default, float) else value


def _check_scales(case: Case) -> None:
    """Refuse a scale of limits that are not in use."""
    scaled_by = set()
    if case.limits:
        from redres_ros.limits import LIMITS

        for name in case.limits:
            if name not in LIMITS:
                raise UnknownNameError('limit', name, [*LIMITS, NONE])
            scaled_by.add(LIMITS[name].scaled_by)
    used = ', '.join(case.limits) or NONE
    for name, of in (('limit_scale', 'limits'), ('torque_scale', 'the limit torque')):
        scale = getattr(case, name)
        if scale != 1.0 and name not in scaled_by:
            option = name.replace('_', '-')
            raise OptionError(f'--{option} {scale:g} acts on {of}; in use: {used}, see --limits')
    if case.scaling == 'components' and not case.limits:
        raise OptionError(f'--scaling components acts on limits; in use: {NONE}')


def _check_start(task: WaypointTask, model: RobotModel) -> None:
    """Refuse a task that was written for another arm, tip or base."""
    x, _ = model.tip(task.start)
    away = float(np.linalg.norm(x - task.waypoints[0]))
    if not away < _NEAR:
        raise OptionError(
            f'the tip of {task.robot} is {1e3 * away:.0f} mm away from the first point when the '
            f'task starts, at {np.round(x, 4).tolist()}; allowed: {1e3 * _NEAR:.0f} mm; '
            'name a task of that robot with --task'
        )
