"""Random tasks of one arm, by kind. The same arm, kind and seed give the same task."""

from collections.abc import Callable, Sequence

import numpy as np

from redres_ros.errors import UnknownNameError
from redres_ros.planning.waypoints import WaypointTask
from redres_ros.robot_model import RobotModel
from redres_ros.types import JointPositions, Points, Seconds

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


def make_random_task(kind: str, model: RobotModel, robot: str, seed: int) -> WaypointTask:
    """A random task of a kind in RANDOM_TASKS for an arm and its name. Raises UnknownNameError."""
    if kind not in RANDOM_TASKS:
        raise UnknownNameError('kind of task', kind, RANDOM_TASKS)
    start, points, segment_time = RANDOM_TASKS[kind](model, np.random.default_rng(seed))
    return WaypointTask(robot, start, points, segment_time=segment_time)


# --- kinds ----------------------------------------------------------------------------------------

_Path = tuple[JointPositions, Points, Seconds]  # start, points, time of a segment


def _random_path(model: RobotModel, random: np.random.Generator) -> _Path:
    """A start within the joints' ranges, and points that the arm reaches from there."""
    start, points = _random_walk(model, _POINTS, random)
    return start, points, _SEGMENT


def _long_path(model: RobotModel, random: np.random.Generator) -> _Path:
    """A minute of motion: many points, and back through all of them to the first."""
    start, points = _random_walk(model, _LONG_POINTS, random)
    return start, np.concatenate((points, points[-2::-1])), _LONG_SEGMENT


def _near_singular_path(model: RobotModel, random: np.random.Generator) -> _Path:
    """Points that the arm reaches in nearly singular postures, and back to the first.

    At rest an arm passes any singularity: it is between such points that it moves fast near one.
    The postures are found by descending along the gradient of the Jacobian's smallest singular
    value, from random ones within the joints' ranges.
    """
    start = min(
        (_descended(model, _random_posture(model, random)) for _ in range(_DESCENTS)),
        key=lambda q: _least_singular_value(model, q)[0],
    )
    postures = [start]
    for _ in range(_POINTS - 1):
        direction = random.normal(size=model.n)
        beside = postures[-1] + _AWAY / np.linalg.norm(direction) * direction
        postures.append(_descended(model, _inside(model, beside)))
    return start, _positions(model, [*postures, start]), _SEGMENT


RANDOM_TASKS: dict[str, Callable[[RobotModel, np.random.Generator], _Path]] = {
    'random': _random_path,
    'near_singular': _near_singular_path,
    'long': _long_path,
}


def _random_walk(
    model: RobotModel, steps: int, random: np.random.Generator
) -> tuple[JointPositions, Points]:
    """A random walk in joint space: its start, and where the tip is, the first at the start."""
    start = _random_posture(model, random)
    q = start
    postures = [start]
    for _ in range(steps):
        q = q + random.uniform(-_STEP, _STEP, model.n)
        postures.append(_inside(model, q))
    return start, _positions(model, postures)


def _positions(model: RobotModel, postures: Sequence[JointPositions]) -> Points:
    """Where the tip is."""
    return np.array([model.tip(q)[0] for q in postures])


def _inner_range(model: RobotModel) -> tuple[JointPositions, JointPositions]:
    """Middle of the joints' ranges, and half of the part in which starts lie."""
    lower = np.maximum(model.q_min, -_FARTHEST)
    upper = np.minimum(model.q_max, _FARTHEST)
    return (lower + upper) / 2.0, _RANGE * (upper - lower) / 2.0


def _inside(model: RobotModel, q: JointPositions) -> JointPositions:
    """The posture within the range of starts that is nearest to q."""
    middle, half = _inner_range(model)
    return np.clip(q, middle - half, middle + half)


def _random_posture(model: RobotModel, random: np.random.Generator) -> JointPositions:
    middle, half = _inner_range(model)
    return middle + half * random.uniform(-1.0, 1.0, model.n)


def _descended(model: RobotModel, q: JointPositions) -> JointPositions:
    """A nearly singular posture near q: the first on the descent, or its last."""
    for _ in range(_STEPS):
        sigma, gradient = _least_singular_value(model, q)
        if sigma < _SINGULAR * model.reach:
            break
        step = _STEP_LENGTH / np.linalg.norm(gradient)
        q = _inside(model, q - step * gradient)
    return q


def _least_singular_value(model: RobotModel, q: JointPositions) -> tuple[float, np.ndarray]:
    """sigma_min of the position's Jacobian, and its gradient u' dJ/dq_i v, (n,)."""
    state = model.state(q, np.zeros(model.n))
    U, sigma, Vt = np.linalg.svd(state.J[:3], full_matrices=False)
    dJ = state.jacobian_derivatives('')[:, :3]  # (n, 3, n)
    gradient = np.einsum('a,iaj,j->i', U[:, -1], dJ, Vt[-1])
    return float(sigma[-1]), gradient
