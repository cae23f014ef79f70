"""A task: points that the tip passes from rest to rest, and the arm's start; read from config/tasks
or a YAML file.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from redres_ros.errors import ArrayError, FileError, UnknownNameError, quoted
from redres_ros.files.installation import share_path
from redres_ros.parameter import check_parameters, param
from redres_ros.robots import Arm
from redres_ros.robots.from_urdf import square_before_tip
from redres_ros.rotation import from_quaternion, from_roll_pitch_yaw

NODES = ('sim', 'controller', 'planner')  # of a demo
_SWITCHING = ('at_rest', 'within_tolerance')

_FARTHEST = 100.0  # [m]; no arm is that long, and the squares of larger numbers may overflow
_MOST_DEGREES = 36000.0
_METRES = ' m'  # ends the position of a linear joint


class TaskEvent(NamedTuple):
    """A change of a node's parameters while a demo runs a task.

    Attributes:
        at: After the task began [s].
        node: Its name.
        parameters: Their values by name.
    """

    at: float
    node: str
    parameters: Mapping[str, Any]


@dataclass(frozen=True)
class WaypointTask:
    """Waypoints x_0 ... x_N of the tip, and their timing.

    The switching 'at_rest' goes on once a segment's time is over and the error is below tolerance;
    'within_tolerance' as soon as the error is, which cuts each segment short and makes a step in
    the task velocity.

    Args:
        robot: The arm's name.
        start: Joint positions q(0), (n,) [rad], or [m] of a linear joint.
        waypoints: Points in the base frame, x_0 being f(q(0)), (N + 1, 3) [m].
        orientations: Orientations of the tip at the points, (N + 1, 3, 3); None leaves them free.
        segment_time: T_AB, of each segment [s].
        feedback_gain: k_P of Eq. (37) [1/s].
        tolerance: Error at which a point counts as reached [m].
        orientation_tolerance: The same for its orientation [rad].
        switching: When the next segment begins.
        nodes: Parameters of the nodes in a demo, by the node: what the tip touches, how it yields.
        events: Changes of these during the motion.
    """

    robot: str
    start: np.ndarray
    waypoints: np.ndarray
    orientations: np.ndarray | None = None
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
    events: tuple[TaskEvent, ...] = ()

    def __post_init__(self) -> None:
        check_parameters(self)

    @property
    def segments(self) -> int:
        """Number of segments, one less than the waypoints."""
        return len(self.waypoints) - 1

    def check_joints(self, n: int) -> None:
        """Refuse a task of an arm with another number of joints than n. Raises ArrayError."""
        if len(self.start) != n:
            raise ArrayError(
                f'start of a task of {self.robot} has {len(self.start)} joints; expected {n}'
            )

    def path_deviation(self, x: np.ndarray, segment: np.ndarray) -> np.ndarray:
        """Distances of positions from the straight lines of their segments, (N,) [m].

        Args:
            x: (N, 3) [m].
            segment: (N,) number of each one's segment. Segment 0 leads to x_0 from anywhere, so it
                has no line: its distances are 0.
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
    """The task of that name in config/tasks, or of that YAML file. Raises FileError,
    UnknownNameError, RangeError.
    """
    path = Path(name_or_path)
    if path.suffix not in ('.yaml', '.yml'):
        folder = share_path('config/tasks')
        known = {file.stem: file for file in folder.glob('*.yaml')}
        if name_or_path not in known:
            raise UnknownNameError('task', name_or_path, [*known, 'a path ending in .yaml'])
        path = known[name_or_path]
    from redres_ros.files.yaml import read_yaml  # PyYAML is for files alone

    return _to_task(read_yaml(path), path)


def task_for(arm: Arm, name: str) -> WaypointTask:
    """The default task of an arm: its own, or a small square in front of its tip.

    Args:
        arm: An arm from the table, or from a URDF.
        name: The arm's name or path, for the task.

    Raises:
        FileError: The arm has no start, or can go round no square from there.
    """
    if arm.task:
        return load_task(arm.task)
    start = np.array(arm.start)
    square = None
    if arm.start and arm.acceleration_limit:
        square = square_before_tip(arm.kinematics(), start, np.array(arm.acceleration_limit))
    if square is None:
        raise FileError(
            f'{name} has no task of its own, and no square that it could go round; name a task'
        )
    return WaypointTask(name, start, square.waypoints, segment_time=square.segment_time)


def _to_task(content: Any, path: Path) -> WaypointTask:
    required = ('robot', 'start', 'waypoints')
    numbers = ('segment_time', 'feedback_gain', 'tolerance', 'orientation_tolerance')
    optional = (*_FORMS, *numbers, 'switching', 'nodes', 'events')
    if not isinstance(content, dict) or not all(key in content for key in required):
        raise FileError(
            f'{path} is not a task; expected the keys {", ".join(required)} '
            f'and, optionally, {", ".join(optional)}'
        )
    for key in content:
        if key not in required + optional:
            raise UnknownNameError(f'key in {path}', str(key), required + optional)
    given: dict[str, Any] = {
        key: _number(content[key], key, path) for key in numbers if key in content
    }
    if 'switching' in content:
        given['switching'] = content['switching']
    waypoints = _numbers(content['waypoints'], 'waypoints', 2, _FARTHEST, path)
    if waypoints.shape[1] != 3 or len(waypoints) < 2:
        raise FileError(
            f'{path}: waypoints has shape {waypoints.shape}; '
            'expected at least two points of three coordinates'
        )
    given['orientations'] = _orientations(content, len(waypoints), path)
    given['nodes'] = _nodes(content.get('nodes', {}), path)
    given['events'] = _events(content.get('events', []), path)
    start = _start(content['start'], path)
    return WaypointTask(_name(content['robot'], 'robot', path), start, waypoints, **given)


def _nodes(value: Any, path: Path) -> dict[str, dict[str, Any]]:
    """Parameters by node. What they are, the nodes judge themselves."""
    mappings = list(value.values()) if isinstance(value, dict) else [value]
    if not all(isinstance(mapping, dict) for mapping in mappings):
        raise _unexpected('nodes', value, 'parameters below the names of nodes', path)
    return {_node(name, path): _parameters(own) for name, own in value.items()}


def _events(value: Any, path: Path) -> tuple[TaskEvent, ...]:
    if not isinstance(value, list):
        raise _unexpected('events', value, 'a list', path)
    return tuple(_event(event, path) for event in value)


def _event(value: Any, path: Path) -> TaskEvent:
    if not (isinstance(value, dict) and {'at', 'node'} < value.keys()):
        raise _unexpected('an event', value, 'at [s], node, and parameters', path)
    own = {key: value[key] for key in value if key not in ('at', 'node')}
    at = _number(value['at'], 'at', path)
    return TaskEvent(at, _node(value['node'], path), _parameters(own))


def _node(name: Any, path: Path) -> str:
    if name not in NODES:
        raise FileError(f'{path}: {quoted(name)} is not a node; allowed: {", ".join(NODES)}')
    return str(name)


def _parameters(given: Mapping[Any, Any]) -> dict[str, Any]:
    """Values by name, arrays as tuples."""
    return {
        str(name): tuple(value) if isinstance(value, list) else value
        for name, value in given.items()
    }


def _start(value: Any, path: Path) -> np.ndarray:
    """Joint positions (n,), angles given in degrees, and those of linear joints as '0.3 m'."""
    members = list(value) if isinstance(value, list) else []
    is_linear = np.array([str(member).endswith(_METRES) for member in members], dtype=bool)
    for place in np.flatnonzero(is_linear):
        members[place] = str(members[place]).removesuffix(_METRES)
    numbers = _numbers(members or value, 'start', 1, _MOST_DEGREES, path)
    return np.where(is_linear, numbers, np.radians(numbers))


def _orientations(content: dict[str, Any], count: int, path: Path) -> np.ndarray | None:
    """Rotations (count, 3, 3); one in the file stands for all points. None if it has none."""
    if 'quaternions' in content and 'rpy' in content:
        raise FileError(f'{path} has quaternions and rpy; expected one of them')
    key = next((key for key in _FORMS if key in content), None)
    if key is None:
        return None
    size, largest, convert = _FORMS[key]
    rows = _numbers(content[key], key, 2, largest, path)
    if rows.shape not in ((1, size), (count, size)):
        raise FileError(
            f'{path}: {key} has shape {rows.shape}; expected one row of {size} numbers, '
            f'or one for each of the {count} points'
        )
    if key == 'quaternions' and (np.linalg.norm(rows, axis=1) < 1e-6).any():
        raise FileError(f'{path}: quaternions holds a zero; expected x, y, z, w')
    turns = np.array([convert(row) for row in rows])
    return np.broadcast_to(turns, (count, 3, 3)).copy()


def _from_degrees(rpy: np.ndarray) -> np.ndarray:
    return from_roll_pitch_yaw(np.radians(rpy))


# Forms of an orientation in a file: size, largest number, and what makes a rotation (3, 3) of it
_FORMS: dict[str, tuple[int, float, Callable[[np.ndarray], np.ndarray]]] = {
    'quaternions': (4, 1e3, from_quaternion),
    'rpy': (3, _MOST_DEGREES, _from_degrees),  # [deg]
}


def _name(value: Any, key: str, path: Path) -> str:
    if not isinstance(value, str):
        raise _unexpected(key, value, 'a name', path)
    return value


def _number(value: Any, key: str, path: Path) -> float:
    try:  # YAML 1.1 takes 1e-3, which has no dot, for a text
        if not isinstance(value, bool):
            return float(value)
    except (TypeError, ValueError, OverflowError):
        pass
    raise _unexpected(key, value, 'a number', path)


def _numbers(value: Any, key: str, dimensions: int, largest: float, path: Path) -> np.ndarray:
    try:
        array = np.array(value, dtype=np.float64)
    except (TypeError, ValueError, OverflowError):
        array = np.empty(())
    if array.ndim != dimensions or not (np.abs(array) <= largest).all():
        shape = 'a list' if dimensions == 1 else 'rows'
        expected = f'{shape} of finite numbers, none beyond {largest:g}'
        raise _unexpected(key, value, expected, path)
    return array


def _unexpected(key: str, value: Any, expected: str, path: Path) -> FileError:
    return FileError(f'{path}: {key} is {quoted(value)}; expected {expected}')
