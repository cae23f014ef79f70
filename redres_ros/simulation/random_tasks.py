"""Random tasks of one arm, by kind. The same arm, kind and seed give the same task."""

from collections.abc import Callable

import numpy as np

from redres_ros.errors import UnknownNameError
from redres_ros.planning.waypoints import WaypointTask
from redres_ros.robot_model import RobotModel

_RANGE = 0.8  # of each joint's range, around its middle, in which starts lie
_FARTHEST = 2.0 * np.pi  # [rad] from zero of such a start, for joints that turn without end
_STEP = 0.6  # [rad] by which each joint is away, at most, from one point of a task to the next

_POINTS = 4  # of a short task, beside the start
_SEGMENT = 1.5  # [s], of a short task

_LONG_POINTS = 10  # of a long task, one way
_LONG_SEGMENT = 3.0  # [s]: a minute there and back

_SINGULAR = 0.03  # smallest singular value over the reach, of a posture that is nearly singular
_DESCENTS = 4  # postures from which the most singular start is sought
_STEPS = 60  # of a descent
_STEP_LENGTH = 0.05  # [rad]
_AWAY = 0.8  # [rad] from one posture to where the descent to the next one begins


def random_task(model: RobotModel, robot: str, seed: int) -> WaypointTask:
    """A start within the joints' ranges, and points that the arm reaches from there.

    Args:
        model: The arm.
        robot: Its name, for the task.
        seed: The same one gives the same task.
    """
    start, points = _random_walk(model, _POINTS, seed)
    return WaypointTask(robot, start, points, segment_time=_SEGMENT)


def long_task(model: RobotModel, robot: str, seed: int) -> WaypointTask:
    """A minute of motion: many points, and back through all of them to the first.

    Args:
        model: The arm.
        robot: Its name, for the task.
        seed: The same one gives the same task.
    """
    start, points = _random_walk(model, _LONG_POINTS, seed)
    there_and_back = np.concatenate((points, points[-2::-1]))
    return WaypointTask(robot, start, there_and_back, segment_time=_LONG_SEGMENT)


def near_singular_task(model: RobotModel, robot: str, seed: int) -> WaypointTask:
    """Points that the arm reaches in nearly singular postures, and back to the first.

    At rest an arm passes any singularity: it is between such points that it moves fast near one.
    The postures are found by descending along the gradient of the Jacobian's smallest singular
    value, from random ones within the joints' ranges.

    Args:
        model: The arm.
        robot: Its name, for the task.
        seed: The same one gives the same task.
    """
    random = np.random.default_rng(seed)
    start = min(
        (_descended(model, _random_posture(model, random)) for _ in range(_DESCENTS)),
        key=lambda q: _least_singular_value(model, q)[0],
    )
    postures = [start]
    for _ in range(_POINTS - 1):
        direction = random.normal(size=model.n)
        beside = postures[-1] + _AWAY / np.linalg.norm(direction) * direction
        postures.append(_descended(model, _inside(model, beside)))
    points = np.array([model.tip(q)[0] for q in (*postures, start)])
    return WaypointTask(robot, start, points, segment_time=_SEGMENT)


RANDOM_TASKS: dict[str, Callable[[RobotModel, str, int], WaypointTask]] = {
    'random': random_task,
    'near_singular': near_singular_task,
    'long': long_task,
}


def make_random_task(kind: str, model: RobotModel, robot: str, seed: int) -> WaypointTask:
    """A random task of a kind.

    Args:
        kind: A name in RANDOM_TASKS.
        model: The arm.
        robot: Its name, for the task.
        seed: The same one gives the same task.

    Raises:
        UnknownNameError: There is no such kind.
    """
    if kind not in RANDOM_TASKS:
        raise UnknownNameError('kind of task', kind, RANDOM_TASKS)
    return RANDOM_TASKS[kind](model, robot, seed)


def _inner_range(model: RobotModel) -> tuple[np.ndarray, np.ndarray]:
    """Middle of the joints' ranges and half of the part in which starts lie, (n,) each [rad]."""
    lower = np.maximum(model.q_min, -_FARTHEST)
    upper = np.minimum(model.q_max, _FARTHEST)
    return (lower + upper) / 2.0, _RANGE * (upper - lower) / 2.0


def _inside(model: RobotModel, q: np.ndarray) -> np.ndarray:
    """The posture within the range of starts that is nearest to q, (n,) [rad]."""
    middle, half = _inner_range(model)
    return np.clip(q, middle - half, middle + half)


def _random_posture(model: RobotModel, random: np.random.Generator) -> np.ndarray:
    middle, half = _inner_range(model)
    return middle + half * random.uniform(-1.0, 1.0, model.n)


def _random_walk(model: RobotModel, steps: int, seed: int) -> tuple[np.ndarray, np.ndarray]:
    """A random walk in joint space: its start (n,) [rad], and the points (steps + 1, 3) [m] where
    the tip is, the first at the start.
    """
    random = np.random.default_rng(seed)
    start = _random_posture(model, random)
    q = start
    points = [model.tip(q)[0]]
    for _ in range(steps):
        q = q + random.uniform(-_STEP, _STEP, model.n)
        points.append(model.tip(_inside(model, q))[0])
    return start, np.array(points)


def _descended(model: RobotModel, q: np.ndarray) -> np.ndarray:
    """A nearly singular posture near q, (n,) [rad]: the first on the descent, or its last."""
    for _ in range(_STEPS):
        sigma, gradient = _least_singular_value(model, q)
        if sigma < _SINGULAR * model.reach:
            break
        step = _STEP_LENGTH / np.linalg.norm(gradient)
        q = _inside(model, q - step * gradient)
    return q


def _least_singular_value(model: RobotModel, q: np.ndarray) -> tuple[float, np.ndarray]:
    """sigma_min of the position's Jacobian, and its gradient u' dJ/dq_i v, (n,)."""
    state = model.state(q, np.zeros(model.n))
    U, sigma, Vt = np.linalg.svd(state.J[:3], full_matrices=False)
    dJ = state.jacobian_derivatives('')[:, :3]  # (n, 3, n)
    gradient = np.einsum('a,iaj,j->i', U[:, -1], dJ, Vt[-1])
    return float(sigma[-1]), gradient
