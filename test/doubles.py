"""In the place of arms and laws: what several test files try the core with."""

from dataclasses import dataclass

import numpy as np

from redres_ros import Law, RobotModel, RobotState
from redres_ros.parameter import param


class LateArm:
    """An ideal arm that takes up each reference a tick late."""

    stop_reason = ''

    def __init__(self, q: np.ndarray) -> None:
        self.q = q
        self._next = q

    def step(self, q_ref: np.ndarray) -> None:
        self.q = self._next
        self._next = q_ref


class FloatingArm:
    """In the place of a model: an arm of constant inertia without tasks, gravity and coupling, so
    that all its motion is self-motion.
    """

    n = 7
    _tip = 0
    q_min = np.full(n, -2.9)
    q_max = np.full(n, 2.9)

    def __init__(self, M: np.ndarray | None = None) -> None:
        self._M = np.eye(self.n) if M is None else M

    def _inertia(self, q: np.ndarray) -> np.ndarray:
        return self._M

    def _jacobian(self, q: np.ndarray, frame: int) -> np.ndarray:
        return np.zeros((6, self.n))

    def _bias_torque(self, q: np.ndarray, dq: np.ndarray) -> np.ndarray:
        return np.zeros(len(q))


@dataclass(frozen=True)
class SpringLaw(Law):
    """A spring draws the joints to zero within the null space, Eq. (19). The package knows nothing
    of this law.
    """

    k_s: float = param(4.0, 'stiffness per unit of inertia [1/s^2]', 0.0, 1e3)

    def bias(self, state: RobotState, T: float) -> np.ndarray:
        return self.forgetting_factor(T) * state.dq_prev - T * self.k_s * state.q


def random_motion(n: int, count: int, seed: int = 0) -> list[tuple[np.ndarray, np.ndarray]]:
    """Pairs of q and dq, both (n,), all around and fast."""
    random = np.random.default_rng(seed)
    q = random.uniform(-np.pi, np.pi, (count, n))
    return list(zip(q, random.normal(0.0, 2.0, (count, n)), strict=True))


def dependent_levels(model: RobotModel, seed: int) -> tuple[list, np.ndarray, np.ndarray]:
    """Position, the same position with another velocity, and orientation: J and dx of each; and
    b (n,) and M (n, n) of the same random state.
    """
    random = np.random.default_rng(seed)
    q = random.uniform(np.maximum(model.q_min, -3.0), np.minimum(model.q_max, 3.0))
    state = model.state(q, np.zeros(model.n))
    rows = (state.J[:3], state.J[:3], 0.5 * model.reach * state.J[3:])
    levels = [(J, random.normal(0.0, 0.2, 3)) for J in rows]
    return levels, random.normal(0.0, 0.3, model.n), state.M
