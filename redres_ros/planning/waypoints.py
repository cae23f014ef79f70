"""A task: points that the tip passes, and the arm's start; from config/tasks, YAML or a table."""

import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from redres_ros.errors import ArrayError, FileError, UnknownNameError, quoted, reason_of
from redres_ros.files.installation import share_path
from redres_ros.files.text import read_text, read_yaml
from redres_ros.geometry import from_quaternion, from_roll_pitch_yaw
from redres_ros.kernels.tick import rotation_error
from redres_ros.parameter import Checked, param
from redres_ros.preview import Preview
from redres_ros.robot_model import RobotModel
from redres_ros.robots import Arm
from redres_ros.robots.from_urdf import square_before_tip
from redres_ros.types import JointPositions, Points, Seconds, Times

_NODES = ('sim', 'controller', 'planner')  # of a demo
_SWITCHING = ('at_rest', 'within_tolerance')

_FARTHEST = 100.0  # [m]; no arm is that long, and the squares of larger numbers may overflow
_MOST_DEGREES = 36000.0
_METRES = ' m'  # ends the position of a linear joint
_QUATERNION = ('qx', 'qy', 'qz', 'qw')  # columns of a table
_CONFLICTS = ({'quaternions', 'rpy'}, {'times', 'segment_time'}, {'times', 'switching'})
_STEPS = 200  # of the search for a start
_STEP = 0.1  # [m], [rad] of the tip, at most


class _TaskEvent(NamedTuple):
    """A change of a node's parameters while a demo runs a task, so long after the task began."""

    at: Seconds
    node: str
    parameters: Mapping[str, Any]


@dataclass(frozen=True)
class WaypointTask(Checked):
    """Waypoints x_0 ... x_N of the tip, and their timing.

    The switching 'at_rest' goes on once a segment's time is over and the error is below tolerance;
    'within_tolerance' as soon as the error is, which cuts each segment short and makes a step in
    the task velocity. With `times`, of which segment_time is then the mean step, the tip passes all
    points without a rest. `nodes` has parameters of the nodes in a demo, by the node: what the tip
    touches, how it yields; `events` change these in motion. Raises ArrayError for what is no path.
    """

    robot: str
    start: JointPositions  # q(0), in [m] of a linear joint
    waypoints: Points  # in the base frame, x_0 being f(q(0))
    orientations: np.ndarray | None = None  # (N + 1, 3, 3) at the points; None leaves them free
    segment_time: float = param(3.0, 'T_AB, duration of a segment [s]', 1e-3, 3600.0)
    feedback_gain: float = param(10.0, 'k_P of Eq. (37) [1/s]', 0.0, 1e3)
    tolerance: float = param(
        0.001, 'epsilon, error at which a point counts as reached [m]', 1e-9, 1.0
    )
    orientation_tolerance: float = param(
        0.01, 'error at which an orientation counts as reached [rad]', 1e-9, 3.0
    )
    switching: str = param('at_rest', 'when the next segment begins', choices=_SWITCHING)
    nodes: Mapping[str, Mapping[str, Any]] = field(default_factory=dict)
    events: tuple[_TaskEvent, ...] = ()
    times: Times | None = None  # (N + 1,) of the points, rising

    def __post_init__(self) -> None:
        super().__post_init__()
        try:
            points = _numbers(self.waypoints, (3,), _FARTHEST, 2)
        except (TypeError, ValueError, OverflowError):
            got = quoted(self.waypoints)
            raise ArrayError(f'waypoints of a task are {got}; expected {_POINTS}') from None
        times = np.arange(len(points)) if self.times is None else self.times
        path = Preview(times, points, self.orientations)
        turns = path.rotations.reshape(-1, 3, 3)
        is_orthonormal = np.abs(turns @ turns.transpose(0, 2, 1) - np.eye(3)) < 1e-3
        if not (is_orthonormal.all() and (np.linalg.det(turns) > 0.0).all()):
            raise ArrayError(f'orientations of a task are {quoted(turns)}; expected rotations')
        object.__setattr__(self, 'waypoints', points)
        if self.orientations is not None:
            object.__setattr__(self, 'orientations', turns)
        if self.times is not None:
            object.__setattr__(self, 'times', path.times)
            mean = float(path.times[-1] - path.times[0]) / self.segments
            object.__setattr__(self, 'segment_time', mean)

    @property
    def segments(self) -> int:
        return len(self.waypoints) - 1

    def path_deviation(self, x: Points, segment: np.ndarray) -> np.ndarray:
        """Distances of positions from the straight lines of their segments, (N,) [m], by the number
        of each one's segment, (N,). Segment 0 leads to x_0 from anywhere: its distances are 0.
        """
        ends = np.maximum(segment.astype(int), 1)
        start = self.waypoints[ends - 1]
        line = self.waypoints[ends] - start
        since = x - start
        length = np.einsum('ni,ni->n', line, line)  # squared
        fraction = np.einsum('ni,ni->n', since, line) / np.where(length > 0.0, length, 1.0)
        distance = np.linalg.norm(since - fraction[:, None] * line, axis=1)
        return np.where(segment > 0, distance, 0.0)


def load_task(name_or_path: str) -> WaypointTask:
    """The task of that name in config/tasks, or of that YAML file or table; the start of a table
    without joints is empty. Raises FileError, UnknownNameError, RangeError, ArrayError.
    """
    path = Path(name_or_path)
    if path.suffix == '.csv':
        return _to_task(_read_table(path), path)
    if path.suffix not in ('.yaml', '.yml'):
        folder = share_path('config/tasks')
        known = {file.stem: file for file in folder.glob('*.yaml')}
        if name_or_path not in known:
            raise UnknownNameError('task', name_or_path, [*known, 'a path ending in .yaml or .csv'])
        path = known[name_or_path]
    return _to_task(read_yaml(path), path)


def task_for(arm: Arm, robot: str, name: str = '') -> WaypointTask:
    """The task of that name or file; without one the arm's own, or a small square in front of its
    tip. An empty start becomes one at the first point, or as near as the arm gets.

    Raises as load_task(), ArrayError for a start of other joints, and FileError without a square.
    """
    if name or arm.task:
        task = load_task(name or arm.task)
        start = task.start if len(task.start) else _at_first_point(task, RobotModel(arm))
        n = arm.kinematics().n
        if len(start) != n:
            raise ArrayError(f'start of a task of {robot} has {len(start)} joints; expected {n}')
        return replace(task, robot=robot, start=start)
    start = np.array(arm.start)
    square = None
    if arm.start and arm.acceleration_limit:
        square = square_before_tip(arm.kinematics(), start, np.array(arm.acceleration_limit))
    if square is None:
        raise FileError(
            f'{robot} has no task of its own, and no square that it could go round; name a task'
        )
    points, segment_time = square
    return WaypointTask(robot, start, points, segment_time=segment_time)


def _at_first_point(task: WaypointTask, model: RobotModel) -> JointPositions:
    """By damped least squares, from the arm's own start."""
    q = np.array(model.arm.start)
    for _ in range(_STEPS):
        x, R = model.tip(q)
        error = task.waypoints[0] - x
        if task.orientations is not None:
            error = np.append(error, rotation_error(R, task.orientations[0]))
        J = model.jacobian(q, model.arm.tip_frame)[: len(error)]
        error /= max(float(np.linalg.norm(error)) / _STEP, 1.0)
        dq = J.T @ np.linalg.solve(J @ J.T + 1e-4 * np.eye(len(J)), error)
        q = np.clip(q + dq, *model.inner_range)
    return q


def _read_table(path: Path) -> dict[str, Any]:
    """The content of a task by the columns that `redres simulate --out` writes, or t, x, y, z and,
    of a pose, qx, qy, qz, qw. Raises FileError.
    """
    lines = read_text(path).strip('\ufeff \r\n').splitlines() or ['nothing']
    try:
        table = np.genfromtxt(lines, delimiter=',', names=True, ndmin=1)
    except ValueError as error:
        raise FileError(f'{path} is no table: {reason_of(error)}') from None
    names = table.dtype.names or ()
    position = ('x_d', 'y_d', 'z_d') if 'x_d' in names else ('x', 'y', 'z')
    wanted = ('t', *position, *(_QUATERNION if 'qx' in names else ()))
    if missing := [name for name in wanted if name not in names]:
        raise FileError(f'{path} has no column {", ".join(missing)}; got: {quoted(lines[0])}')
    values = np.transpose([table[name] for name in wanted])
    t = values[:, 0]
    is_good = np.isfinite(values).all(axis=1) & (np.diff(t, prepend=-np.inf) > 0.0)
    if not is_good.all():
        raise FileError(f'{path}: row {is_good.argmin() + 1} lacks a number, or a t above the last')
    start = [np.degrees(table[name][0]) for name in names if re.fullmatch(r'q\d+', name)]
    content = {'start': start, 'times': t - t[:1], 'waypoints': values[:, 1:4]}
    turns = {'quaternions': values[:, 4:]} if 'qx' in names else {}
    return {'robot': 'lwr4_paper', **content, **turns}


def _to_task(content: Any, path: Path) -> WaypointTask:
    if not isinstance(content, dict) or not all(key in content for key in _REQUIRED):
        keys = f'{", ".join(_REQUIRED)} and, optionally, {", ".join(_OPTIONAL)}'
        raise FileError(f'{path} is not a task; expected the keys {keys}')
    for pair in _CONFLICTS:
        if content.keys() >= pair:
            raise FileError(f'{path} has {" and ".join(sorted(pair))}; expected one of them')
    given: dict[str, Any] = {}
    for key, value in content.items():
        if key not in _READERS:
            raise UnknownNameError(f'key in {path}', str(key), _READERS)
        read, expected = _READERS[key]
        try:
            given[key] = read(value)
        except (TypeError, ValueError, OverflowError):
            raise FileError(f'{path}: {key} is {quoted(value)}; expected {expected}') from None
    turns = given.pop('quaternions', given.pop('rpy', None))
    if turns is None:
        return WaypointTask(**given)
    count = len(given['waypoints'])
    if len(turns) not in (1, count):
        expected = f'one row, or one for each of the {count} points'
        raise FileError(f'{path}: {len(turns)} orientations; expected {expected}')
    return WaypointTask(**given, orientations=np.broadcast_to(turns, (count, 3, 3)).copy())


# Each returns what a value means, or raises TypeError, ValueError or OverflowError.


def _name(value: Any) -> str:
    if not isinstance(value, str):
        raise TypeError
    return value


def _number(value: Any) -> float:
    if isinstance(value, bool):
        raise TypeError
    return float(value)  # YAML 1.1 takes 1e-3, which has no dot, for a text


def _numbers(value: Any, row: tuple[int, ...], largest: float, count: int = 0) -> np.ndarray:
    """Numbers, or rows of a shape, and at least so many."""
    array = np.array(value, dtype=np.float64)
    is_short = array.ndim == 0 or array.shape[1:] != row or len(array) < count
    if is_short or not (np.abs(array) <= largest).all():
        raise ValueError
    return array


def _start(value: Any) -> JointPositions:
    """Angles are given in degrees, positions of linear joints as '0.3 m'."""
    if not isinstance(value, list):
        raise TypeError
    members = list(map(str, value))
    is_linear = [member.endswith(_METRES) for member in members]
    numbers = _numbers([member.removesuffix(_METRES) for member in members], (), _MOST_DEGREES)
    return np.where(is_linear, numbers, np.radians(numbers))


def _quaternions(value: Any) -> np.ndarray:
    rows = _numbers(value, (4,), 1e3)
    if (np.linalg.norm(rows, axis=1) < 1e-6).any():
        raise ValueError
    return np.array([from_quaternion(row) for row in rows])


def _angles(value: Any) -> np.ndarray:
    """Roll, pitch and yaw in degrees."""
    rows = np.radians(_numbers(value, (3,), _MOST_DEGREES))
    return np.array([from_roll_pitch_yaw(row) for row in rows])


def _parameters(node: Any, given: Any) -> dict[str, Any]:
    """Values by name, arrays as tuples. What they are, the node judges itself."""
    if node not in _NODES:
        raise ValueError
    own = {str(name): value for name, value in dict(given).items()}
    return own | {name: tuple(value) for name, value in own.items() if isinstance(value, list)}


def _nodes(value: Any) -> dict[str, dict[str, Any]]:
    return {name: _parameters(name, own) for name, own in dict(value).items()}


def _events(value: Any) -> tuple[_TaskEvent, ...]:
    events = []
    for given in map(dict, value):
        at = _number(given.pop('at', None))
        node = given.pop('node', None)
        events.append(_TaskEvent(at, node, _parameters(node, given)))
    return tuple(events)


_REQUIRED = ('robot', 'start', 'waypoints')
_OF_NODES = f'parameters of a node among {", ".join(_NODES)}'
_POINTS = f'at least two points, rows of 3 finite numbers, none beyond {_FARTHEST:g}'
_DEGREES = f'finite numbers, none beyond {_MOST_DEGREES:g}'
_READERS: dict[str, tuple[Callable[[Any], Any], str]] = {  # and what is expected, in words
    'robot': (_name, 'a name'),
    'start': (_start, f'a list of {_DEGREES}'),
    'waypoints': (lambda value: _numbers(value, (3,), _FARTHEST, 2), _POINTS),
    'quaternions': (_quaternions, 'rows x, y, z, w of finite numbers, not all of them zero'),
    'rpy': (_angles, f'rows of 3 {_DEGREES}'),
    'segment_time': (_number, 'a number'),
    'times': (lambda value: _numbers(value, (), 1e6), 'a list of finite numbers'),
    'feedback_gain': (_number, 'a number'),
    'tolerance': (_number, 'a number'),
    'orientation_tolerance': (_number, 'a number'),
    'switching': (_name, 'a name'),
    'nodes': (_nodes, f'{_OF_NODES}, below its name'),
    'events': (_events, f'a list of events with at [s], node, and {_OF_NODES}'),
}
_OPTIONAL = tuple(key for key in _READERS if key not in _REQUIRED)
