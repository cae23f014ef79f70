"""W and b of the motion that is best along the path to come.

Not of the paper. The law of a tick is the first step of an optimal motion over a horizon: its cost
to go is quadratic in (q, v), so that it is one more weight and bias. Each tick linearises the path
at the nodes to which the last plan leads, and solves the rest by one recursion
(kernels/look_ahead.py). Relatives: Faroni, Beschi, Tosatti, Visioli, predictive inverse kinematics
(T-RO 2019); Al Khudir, Halvorsen, Lanari, De Luca, stable torque optimisation (RA-L 2019).
"""

from typing import NamedTuple

import numpy as np

from redres_ros.kernels.look_ahead import plan_motion, width
from redres_ros.preview import Ahead
from redres_ros.resolution import Weight
from redres_ros.robot_model import RobotState
from redres_ros.types import JointVelocities, Seconds

_NODES = {3: 7, 6: 12}  # of the plan, after the end of the first step, by rows of the task


class _MotionPlan(NamedTuple):
    """The motion that the last tick planned; the next one continues it."""

    nodes: np.ndarray  # (K, n) [rad]
    L: np.ndarray  # (K, n, n)
    Y: np.ndarray  # (K, n, w), as kernels/look_ahead.py has them
    trust: float
    merit: float
    horizon: Seconds


_NO_PLAN = _MotionPlan(np.empty((0, 0)), *2 * (np.empty((0, 0, 0)),), 3.0, 0.0, 0.0)
_NO_EFFORT = np.empty((0, 0, 0)), np.empty((0, 0))  # R = I, r = 0


def look_ahead(
    state: RobotState, ahead: Ahead, T: Seconds, horizon: Seconds, damping: float, *, effort: bool
) -> tuple[Weight, JointVelocities, _MotionPlan] | None:
    """W, b and the plan behind them; None for a path that begins elsewhere than at the tip, and for
    a horizon of less than a cycle for each node.

    Args:
        damping: k_d, with which the motion comes to rest beyond the horizon [1/s].
        effort: The torques beyond gravity count as much as the accelerations.
    """
    path = ahead.path
    model = state.model
    n = model.n
    K = _NODES[6 if len(path.rotations) else 3]
    h = horizon / K
    if h <= T:
        return None
    plan = ahead.plan or _NO_PLAN
    # Another law's, or another task's, or one that is over.
    if plan.horizon != horizon or len(plan.nodes) != K or ahead.elapsed > h:
        plan = _NO_PLAN
    R, r = _effort(state, plan.nodes, K, T, h) if effort else _NO_EFFORT
    nodes = np.empty((K, n))
    L = np.empty((K, n, n))
    Y = np.empty((K, n, width(n)))
    W = np.empty((n, n))
    b = np.empty(n)
    # as much as one more step, that is free, would still cost
    problem = T, h, damping / (1.0 + damping * h), *model.inner_range
    announced = path.times, path.positions, path.rotations
    trust, merit = plan_motion(
        *(state.q, state.dq_prev, problem, model.kinematics.chain, announced, ahead.elapsed),
        *(plan[:5], R, r, nodes, L, Y, W, b),
    )
    if not trust > 0.0:
        return None
    return W, b, _MotionPlan(nodes, L, Y, trust, merit, horizon)


def _effort(
    state: RobotState, nodes: np.ndarray, K: int, T: Seconds, h: Seconds
) -> tuple[np.ndarray, np.ndarray]:
    """R = I + M M, (K + 1, n, n), and r = M (n - g), (K + 1, n), of each step where it began in the
    last plan, if there is one: of |tau - g|^2 + |ddq|^2 with tau = M ddq + n.
    """
    n = state.model.n
    reached = state.q + T * state.dq_prev
    q = np.vstack((state.q, reached, nodes[:-1] if len(nodes) else [reached] * (K - 1)))
    durations = np.array([T, *[h] * (len(q) - 2)])
    dq = np.vstack((state.dq_prev, np.diff(q, axis=0) / durations[:, None]))
    R = np.empty((len(q), n, n))
    r = np.empty((len(q), n))
    for k in range(len(q)):
        each = RobotState(state.model, q[k], dq[k])
        M = each.M
        R[k] = np.eye(n) + M.dot(M)
        r[k] = M.dot(each.n - each.gravity)
    return R, r
