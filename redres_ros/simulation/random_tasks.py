"""Random tasks of one arm, by kind. The same arm, kind and seed give the same task."""

from collections.abc import Callable

import numpy as np

from redres_ros.planning.waypoints import WaypointTask
from redres_ros.robot_model import RobotModel
from redres_ros.types import JointPositions, Seconds

_RANGE = 0.8  # of each joint's range, around its middle, in which starts lie
_FARTHEST = 2.0 * np.pi  # [rad] from zero of such a start, for joints that turn without end
_STEP = 0.6  # [rad] by which each joint is away, at most, from one point of a task to the next

_POINTS = 4  # of a short task, beside the start
_LONG_POINTS = 10  # of a long task, one way

_SINGULAR = 0.03  # smallest singular value over the reach, of a posture that is nearly singular
_DESCENTS = 4  # postures from which the most singular start is sought
_STEPS = 60  # of a descent
_STEP_LENGTH = 0.05  # [rad]
_AWAY = 0.8  # [rad] from one posture to where the descent to the next one begins

_Postures = list[JointPositions]


def make_random_task(kind: str, model: RobotModel, robot: str, seed: int) -> WaypointTask:
    """A task of a kind in RANDOM_TASKS for an arm and its name: the tip in random postures."""
    make, segment_time = RANDOM_TASKS[kind]
    postures = make(model, np.random.default_rng(seed))
    points = np.array([model.tip(q)[0] for q in postures])
    return WaypointTask(robot, postures[0], points, segment_time=segment_time)


def _random_walk(model: RobotModel, random: np.random.Generator, steps: int = _POINTS) -> _Postures:
    """A random walk in joint space, within the joints' ranges."""
    q = _random_posture(model, random)
    postures = [q]
    for _ in range(steps):
        q = q + random.uniform(-_STEP, _STEP, model.n)
        postures.append(_inside(model, q))
    return postures


def _there_and_back(model: RobotModel, random: np.random.Generator) -> _Postures:
    """Many postures, and back through all of them to the first."""
    postures = _random_walk(model, random, _LONG_POINTS)
    return [*postures, *postures[-2::-1]]


def _nearly_singular(model: RobotModel, random: np.random.Generator) -> _Postures:
    """Nearly singular postures, and back to the first.

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
    return [*postures, start]


# The postures of each kind, and the time of a segment.
RANDOM_TASKS: dict[str, tuple[Callable[[RobotModel, np.random.Generator], _Postures], Seconds]] = {
    'random': (_random_walk, 1.5),
    'near_singular': (_nearly_singular, 1.5),
    'long': (_there_and_back, 3.0),  # a minute
}


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
