"""What the options of a motion ask for: the arm, its task, a law with its gains, a controller."""

import argparse
from collections.abc import Iterator, Mapping
from dataclasses import MISSING, dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from redres_ros.cli.options import OptionError
from redres_ros.errors import RangeError

if TYPE_CHECKING:
    from redres_ros.controller import Controller
    from redres_ros.laws import Law
    from redres_ros.robot_model import RobotModel
    from redres_ros.waypoints import WaypointTask

_URDF = ('.urdf', '.xacro')  # endings by which a file is told from a name
_NEAR = 0.01  # [m] that the tip at the start may be away from the first point
_SHARED = ('damping', 'scale')  # gains that have options of their own


@dataclass(frozen=True)
class Gain:
    """A parameter of a law, preference, task or limit, as an option.

    Args:
        owner: The name in its table.
        name: The field's name.
        default: The field's default, whose type is that of the option.
        description: The field's own, with its unit.
    """

    owner: str
    name: str
    default: Any
    description: str

    @property
    def key(self) -> str:
        """The option's name, which is that of the ROS parameter too."""
        return f'{self.owner}.{self.name}'

    def read(self, text: str) -> Any:
        """A value from its text. Raises argparse's own error."""
        kind = type(self.default)
        try:
            if kind is tuple:
                return tuple(float(member) for member in text.split(','))
            if kind is bool:
                return {'true': True, 'false': False}[text]
            return kind(text)
        except (ValueError, KeyError):
            expected = {tuple: 'numbers, as 1,2,3', bool: 'true or false', str: 'a text'}
            raise argparse.ArgumentTypeError(
                f'got {text!r}; expected {expected.get(kind, "a number")}'
            ) from None


def all_gains() -> Iterator[Gain]:
    """Every gain that is declared in the tables, in their order."""
    from redres_ros.parameter import parameters

    for table in _tables():
        for owner, cls in table.items():
            for field, parameter in parameters(cls).items():
                if field.name not in _SHARED and field.default is not MISSING:
                    yield Gain(owner, field.name, field.default, parameter.description)


def _tables() -> tuple[Mapping[str, type], ...]:
    from redres_ros.laws import LAWS

    return (LAWS,)


def gains_of(options: argparse.Namespace, owner: str) -> dict[str, Any]:
    """The gains that the command line gives to one law, preference, task or limit."""
    given = {gain: getattr(options, gain.key) for gain in all_gains() if gain.owner == owner}
    return {gain.name: value for gain, value in given.items() if value is not None}


def check_gains(options: argparse.Namespace, in_use: set[str]) -> None:
    """Refuse a gain of something that is not in use, which would do nothing."""
    for gain in all_gains():
        if getattr(options, gain.key) is not None and gain.owner not in in_use:
            used = ', '.join(sorted(in_use))
            raise OptionError(f'--{gain.key} acts on {gain.owner}; in use: {used}')


def find_law(
    options: argparse.Namespace, name: str, T: float, damping: float | None = None
) -> 'Law':
    """The law of that name.

    Args:
        options: With its gains.
        name: In the table of laws.
        T: Sampling time [s].
        damping: Of this law alone [1/s]; None: that of the options.

    Raises:
        UnknownNameError: No such law.
        RangeError: A gain out of its range.
    """
    from redres_ros.laws import make_law

    gains = gains_of(options, name)
    if damping is None:
        damping = _damping(options, T)
    if damping is not None:
        gains['damping'] = damping
    return make_law(name, **gains)


def make_controller(
    options: argparse.Namespace,
    model: 'RobotModel',
    law: 'Law',
    T: float,
    *,
    switch_time: float = 0.0,
) -> 'Controller':
    """A controller as the options ask for it.

    Args:
        options: With what is added to the law.
        model: The arm.
        law: The law in force.
        T: Sampling time [s].
        switch_time: Over which the start is blended [s].

    Raises:
        RedresError: A value that is not allowed.
    """
    from redres_ros.controller import Controller

    return Controller(model, law, T, switch_time=switch_time)


def _damping(options: argparse.Namespace, T: float) -> float | None:
    """k_d [1/s] from either way of giving it; None where neither is given."""
    factor = options.forgetting_factor
    if factor is None:
        return options.damping
    if not T > 0.0:
        raise RangeError('period', T, 1e-5, 1.0, 's')
    if not 0.0 <= factor <= 1.0:
        raise RangeError('forgetting factor', factor, 0.0, 1.0)
    return (1.0 - factor) / T


def node_parameters(options: argparse.Namespace) -> dict[str, Any]:
    """What the nodes have to be told beside the law, its damping, the robot and its dynamics."""
    told: dict[str, Any] = {'tip_frame': options.tip} if options.tip else {}
    for gain in all_gains():
        value = getattr(options, gain.key)
        if value is not None:
            told[gain.key] = value
    return told


def task_name(options: argparse.Namespace, default: str = 'rectangle') -> str:
    """The task that is named, or the robot's own where only a robot is; else the default."""
    from redres_ros.robots import ARMS

    own = ARMS[options.robot].task if options.robot in ARMS else ''
    return options.task or own or default


def find_task(options: argparse.Namespace, name: str) -> tuple['WaypointTask', 'RobotModel']:
    """The task of that name, and the arm that is to carry it out.

    Args:
        options: With the robot, its tip and its dynamics.
        name: As of task_name().

    Raises:
        UnknownNameError: No such task, robot, frame or dynamics.
        FileError: A file that cannot be used.
        OptionError: A task and a robot that do not go together.
    """
    from redres_ros.waypoints import load_task

    task = load_task(name)
    if options.robot:
        task = replace(task, robot=options.robot)
    model = _find_model(options, task.robot)
    if options.robot or options.tip:
        _check_start(task, model)
    return task, model


def _find_model(options: argparse.Namespace, robot: str) -> 'RobotModel':
    from redres_ros.robot_model import RobotModel
    from redres_ros.robots import Arm, find_arm

    path = Path(robot)
    if path.suffix not in _URDF:
        return RobotModel(find_arm(robot, dynamics=options.dynamics, tip_frame=options.tip))
    arm = Arm(path, options.tip or _last_link(path), dynamics=options.dynamics)
    return RobotModel(arm)


def _last_link(path: Path) -> str:
    """The link at the end of an arm without branches."""
    from redres_ros.robots.urdf import Urdf

    urdf = Urdf.read(path)
    parents = {joint.parent for joint in urdf.joints}
    ends = [link for link in urdf.links if link not in parents]
    if len(ends) != 1:
        raise OptionError(f'{path} ends in {", ".join(ends)}; say which with --tip FRAME')
    return ends[0]


def _check_start(task: 'WaypointTask', model: 'RobotModel') -> None:
    """Refuse a task that was written for another arm, tip or base."""
    import numpy as np

    if len(task.start) != model.n:
        raise OptionError(
            f'the task starts with {len(task.start)} joints, and {task.robot} has {model.n}; '
            'name a task of that robot with --task'
        )
    away = float(np.linalg.norm(model.tip(task.start)[0] - task.waypoints[0]))
    if not away < _NEAR:
        raise OptionError(
            f'the tip of {task.robot} is {1e3 * away:.0f} mm away from the first point when the '
            f'task starts; allowed: {1e3 * _NEAR:.0f} mm; name a task of that robot with --task'
        )
