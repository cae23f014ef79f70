"""Difference of a velocity law from its second-order scheme, sampled and in continuous time."""

from dataclasses import replace
from typing import NamedTuple

import numpy as np

from redres_ros.command import norms
from redres_ros.controller import Controller
from redres_ros.errors import RedresError
from redres_ros.geometry import quintic
from redres_ros.laws import Law, make_law
from redres_ros.paper.second_order import Scheme, SecondOrderController, step
from redres_ros.planning.planner import Planner
from redres_ros.planning.waypoints import WaypointTask
from redres_ros.resolution import resolve
from redres_ros.robot_model import RobotModel
from redres_ros.simulation.closed_loop import run
from redres_ros.simulation.recording import Recording
from redres_ros.types import Seconds, Times

_PERIODS = (0.004, 0.002, 0.001, 0.0005)  # [s]

_RTOL = 1e-10
_ATOL = 1e-12  # of q [rad] and dq [rad/s]; far below what a sampling time of 0.1 ms changes


class Difference(NamedTuple):
    """Largest |dq_I - dq_II| of a law (I) and its scheme (II) [rad/s]. Where a loop amplifies
    rounding, only same_past stays small.
    """

    max: float  # each in a closed loop of its own
    same_past: float  # the scheme being given at each tick what the law had


def difference(
    law: Law, scheme: Scheme, T: Seconds, task: WaypointTask, model: RobotModel
) -> Difference:
    """The task executed by a law and by a scheme, each in its own closed loop, both with the
    scheme's preference.
    """
    preferences = (scheme.preference,) if scheme.preference else ()
    one = run(Controller(model, law, T, preferences=preferences), task)
    two = run(SecondOrderController(model, scheme, T), task)
    apart = velocity_difference(one, two)
    same_past = _with_same_past(one, model, scheme)[: len(apart)]
    return Difference(float(apart.max()), float(same_past.max()))


def velocity_difference(law: Recording, scheme: Recording) -> np.ndarray:
    """|dq_I - dq_II| in each tick that both have, (N,) [rad/s]."""
    dq_I = law.vectors('dq1')
    dq_II = scheme.vectors('dq1')
    both = min(len(dq_I), len(dq_II))
    return norms(dq_I[:both] - dq_II[:both])


def _with_same_past(law: Recording, model: RobotModel, scheme: Scheme) -> np.ndarray:
    """|dq_I - dq_II| of a law's motion and a scheme that is given at each tick what the law had,
    (ticks,) [rad/s].
    """
    differences = []
    dq_prev = np.zeros(model.n)
    J_prev = np.zeros((3, model.n))
    dx_prev = np.zeros(3)
    for q, dq in zip(law.vectors('q1'), law.vectors('dq1'), strict=True):
        state = model.state(q, dq_prev)
        dx = state.J[:3] @ dq
        dq_II = step(scheme, law.T, state, J_prev, dx, dx_prev)
        differences.append(np.linalg.norm(dq - dq_II))
        dq_prev = dq
        J_prev = state.J[:3]
        dx_prev = dx
    return np.array(differences)


def convergence(
    scheme: Scheme, task: WaypointTask, model: RobotModel, periods: tuple[float, ...] = _PERIODS
) -> float:
    """The order with which a sampled law tends to its scheme in continuous time, on the first
    segment: the slope of log |q_k - q(t_k)| over log T, 1 for the differences (8), (9), (10), (13).
    """
    law = make_law(scheme.law, damping=scheme.damping)
    errors = []
    segment = replace(task, waypoints=task.waypoints[:2])
    for T in periods:
        sampled = run(Controller(model, law, T), segment)
        watched = sampled['t'] <= task.segment_time
        q = integrate(scheme, model, segment, sampled['t'][watched])
        errors.append(np.linalg.norm(sampled.vectors('q1')[watched] - q, axis=1).max())
    return float(np.polyfit(np.log(periods), np.log(errors), 1)[0])


def integrate(scheme: Scheme, model: RobotModel, task: WaypointTask, t: Times) -> np.ndarray:
    """q (N, n) [rad] at ascending times of the first segment, as a scheme executes the task with dJ
    dq and ddx known exactly.

    ddx = ddx_d + k_P (dx_d - J dq) is the derivative of Eq. (37) and so keeps Eq. (37) itself, but
    only if the motion begins with it: if the start misses x_0, the arm starts with the least
    velocity that fulfils it, J_W^# dx(0), which is the first tick of a law as T goes to zero.

    Raises RedresError for a point out of reach.
    """
    from scipy.integrate import solve_ivp  # an extra, which takes a while to load

    start = model.state(task.start, np.zeros(model.n))
    dx = Planner(task).reference(start.x, 0.0).dx
    dq = resolve(start.J[:3], dx, np.zeros(model.n), scheme.metric(start))
    y = np.concatenate((start.q, dq))  # (2n,)
    span = (0.0, task.segment_time)
    solution = solve_ivp(
        _flow,
        span,
        y,
        method='DOP853',
        rtol=_RTOL,
        atol=_ATOL,
        t_eval=t,
        args=(scheme, model, task),
    )
    if not solution.success:
        raise RedresError(f'no continuous motion: {solution.message}')
    return solution.y[: model.n].T


def _flow(
    t: float, y: np.ndarray, scheme: Scheme, model: RobotModel, task: WaypointTask
) -> np.ndarray:
    """The right side of (q, dq)' = (dq, ddq), (2n,)."""
    way = task.waypoints[1] - task.waypoints[0]
    T_AB = task.segment_time
    xi = t / T_AB
    q, dq = np.split(y, 2)
    state = model.state(q, dq)
    dx_d = way / T_AB * quintic(xi)[1]  # Eq. (36)
    ddx_d = way / T_AB**2 * (60.0 * xi * (1.0 + xi * (2.0 * xi - 3.0)))
    ddx = ddx_d + task.feedback_gain * (dx_d - state.J[:3] @ dq)  # derivative of Eq. (37)
    dJ_dq = model.velocity_product(q, dq)[:3]
    return np.concatenate((dq, scheme.acceleration(state, ddx, dJ_dq)))
