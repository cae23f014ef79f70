"""The schemes of second order in continuous time: the limit of the velocity laws as the sampling
time goes to zero.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from redres_ros.errors import RangeError, RedresError
from redres_ros.interpolation import quintic
from redres_ros.paper.second_order import Scheme
from redres_ros.planning.planner import Planner
from redres_ros.planning.waypoints import WaypointTask
from redres_ros.policy import SPEED_LIMIT
from redres_ros.robot_model import RobotModel

_RTOL = 1e-10
_ATOL = 1e-12  # of q [rad] and dq [rad/s]; far below what a sampling time of 0.1 ms changes


class LostMotionError(RedresError):
    """A continuous motion that cannot be followed to its end."""


@dataclass(frozen=True)
class ContinuousMotion:
    """A motion in continuous time, at chosen times.

    Attributes:
        t: (N,) [s].
        q: (N, n) [rad].
        dq: (N, n) [rad/s].
    """

    t: np.ndarray
    q: np.ndarray
    dq: np.ndarray


def integrate(
    scheme: Scheme, model: RobotModel, task: WaypointTask, t: np.ndarray
) -> ContinuousMotion:
    """The task as a scheme executes it with dJ dq and ddx known exactly.

    Each segment takes exactly T_AB ('at_rest'; the tip is then far closer than the tolerance). ddx
    = ddx_d + k_P (dx_d - J dq) is the derivative of Eq. (37) and so keeps Eq. (37) itself, but only
    if the motion begins with it: where the start misses x_0, the arm starts with the least velocity
    that fulfils it, J_W^# dx(0), which is the first tick of a law as T goes to zero.

    Args:
        scheme: Of second order.
        model: Of the arm.
        task: Its segments take exactly T_AB.
        t: Ascending times up to the task's end, (N,) [s].

    Raises:
        RangeError: A time is outside the task.
        LostMotionError: The motion cannot be followed.
        ArrayError: J loses rank.
    """
    from scipy.integrate import solve_ivp  # an extra, which takes a while to load

    T_AB = task.segment_time
    T_end = task.segments * task.segment_time
    if not 0.0 <= t[0] <= t[-1] <= T_end:
        raise RangeError('t', t[0] if t[0] < 0.0 else t[-1], 0.0, T_end, 's')
    segment_of = np.minimum(t // T_AB, task.segments - 1).astype(int)  # (N,)
    y = _start(scheme, model, task)
    rows: list[np.ndarray] = []  # (2n,), N of it
    for segment in range(segment_of[-1] + 1):
        span = (segment * T_AB, min((segment + 1) * T_AB, t[-1]))
        flow = _flow(scheme, model, task, segment)
        solution = solve_ivp(
            flow, span, y, method='DOP853', rtol=_RTOL, atol=_ATOL, dense_output=True
        )
        if solution.sol is None or not solution.success:
            raise LostMotionError(
                f'no continuous motion beyond {solution.t[-1]:.3f} s: {solution.message}'
            )
        *within, y = solution.sol(np.append(t[segment_of == segment], span[1])).T
        rows += within
    q, dq = np.split(np.array(rows), 2, axis=1)
    return ContinuousMotion(t.copy(), q, dq)


def _start(scheme: Scheme, model: RobotModel, task: WaypointTask) -> np.ndarray:
    """(q, dq) at t = 0, (2n,)."""
    state = model.state(task.start, np.zeros(model.n))
    dx = Planner(task).reference(state.x, 0.0).dx
    return np.concatenate((state.q, scheme.pseudoinverse(state) @ dx))


def _flow(
    scheme: Scheme, model: RobotModel, task: WaypointTask, segment: int
) -> Callable[[float, np.ndarray], np.ndarray]:
    """The right side of (q, dq)' = (dq, ddq), (2n,), on one segment."""
    A = task.waypoints[segment]
    B = task.waypoints[segment + 1]
    T_AB = task.segment_time

    def flow(t: float, y: np.ndarray) -> np.ndarray:
        q, dq = np.split(y, 2)
        if np.abs(dq).max() > SPEED_LIMIT:
            raise LostMotionError(
                f'no continuous motion beyond {t:.3f} s: a joint speed above {SPEED_LIMIT:g} rad/s'
            )
        xi = t / T_AB - segment
        state = model.state(q, dq)
        dx_d = (B - A) / T_AB * quintic(xi)[1]  # Eq. (36)
        ddx_d = (B - A) / T_AB**2 * _ddquintic(xi)
        ddx = ddx_d + task.feedback_gain * (dx_d - state.J[:3] @ dq)  # derivative of Eq. (37)
        dJ_dq = model.velocity_product(q, dq)[:3]
        return np.concatenate((dq, scheme.acceleration(model, state, ddx, dJ_dq)))

    return flow


def _ddquintic(xi: float) -> float:
    """Second derivative of s(xi), Eq. (36)."""
    return 60.0 * xi * (1.0 + xi * (2.0 * xi - 3.0))
