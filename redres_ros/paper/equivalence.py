"""Difference of a velocity law from its second-order scheme, sampled and in continuous time."""

from collections.abc import Callable
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from redres_ros.controller import Controller
from redres_ros.errors import RedresError
from redres_ros.geometry import quintic
from redres_ros.laws import make_law
from redres_ros.paper.second_order import Scheme, SecondOrderController, step
from redres_ros.planning.planner import Planner
from redres_ros.planning.waypoints import WaypointTask
from redres_ros.preferences import Preference
from redres_ros.resolution import resolve
from redres_ros.robot_model import RobotModel
from redres_ros.simulation.closed_loop import run
from redres_ros.simulation.recording import Recording
from redres_ros.types import Seconds, Times

SIMULATION_DYNAMICS = 'cylinders'  # the equal links of Section 5.2
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
    law_name: str,
    damping: float,
    T: Seconds,
    task: WaypointTask,
    *,
    model: RobotModel | None = None,
    preference: Preference | None = None,
) -> Difference:
    """The task executed by a law and by its scheme, each in its own closed loop, both with the
    damping k_d [1/s] and the preference. Raises UnknownNameError for a law without yardstick.
    """
    model = model or RobotModel.named(task.robot, dynamics=SIMULATION_DYNAMICS)
    scheme = _yardstick(law_name, damping, T, preference)
    preferences = (preference,) if preference else ()
    law = make_law(law_name, damping=damping)
    one = run(Controller(model, law, T, preferences=preferences), task)
    two = run(SecondOrderController(model, scheme, T), task)
    apart = velocity_difference(one.vectors('dq1'), two.vectors('dq1'))
    same_past = _with_same_past(one, model, scheme)[: len(apart)]
    return Difference(float(apart.max()), float(same_past.max()))


def velocity_difference(dq_I: np.ndarray, dq_II: np.ndarray) -> np.ndarray:
    """|dq_I - dq_II| of rows (N_I, n) and (N_II, n), as long as there are both, (N,) [rad/s]."""
    both = min(len(dq_I), len(dq_II))
    return np.linalg.norm(dq_I[:both] - dq_II[:both], axis=1)


def _yardstick(
    law_name: str, damping: float, T: Seconds, preference: Preference | None = None
) -> Scheme:
    """The scheme of second order that a law is compared with. Raises UnknownNameError.

    minimum_velocity is of first order; it is what the sampled scheme of least acceleration becomes
    for k_d = 1/T (Appendix B), whatever its damping. minimum_kinetic_energy is of first order, too,
    and has no scheme in the paper.
    """
    if law_name == 'minimum_velocity':
        return Scheme('minimum_acceleration', 1.0 / T, preference)
    return Scheme(law_name, damping, preference)


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
    law_name: str,
    damping: float,
    task: WaypointTask,
    periods: tuple[float, ...] = _PERIODS,
    *,
    model: RobotModel | None = None,
) -> float:
    """The order with which a sampled law tends to its scheme in continuous time, on the first
    segment: the slope of log |q_k - q(t_k)| over log T, 1 for the differences (8), (9), (10), (13).
    Raises UnknownNameError for a law without scheme.
    """
    model = model or RobotModel.named(task.robot, dynamics=SIMULATION_DYNAMICS)
    scheme = Scheme(law_name, damping)
    law = make_law(law_name, damping=damping)
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
    flow = _flow(scheme, model, task)
    solution = solve_ivp(flow, span, y, method='DOP853', rtol=_RTOL, atol=_ATOL, t_eval=t)
    if not solution.success:
        raise RedresError(f'no continuous motion: {solution.message}')
    return solution.y[: model.n].T


def _flow(
    scheme: Scheme, model: RobotModel, task: WaypointTask
) -> Callable[[float, np.ndarray], np.ndarray]:
    """The right side of (q, dq)' = (dq, ddq), (2n,)."""
    A = task.waypoints[0]
    B = task.waypoints[1]
    T_AB = task.segment_time

    def flow(t: float, y: np.ndarray) -> np.ndarray:
        q, dq = np.split(y, 2)
        xi = t / T_AB
        state = model.state(q, dq)
        dx_d = (B - A) / T_AB * quintic(xi)[1]  # Eq. (36)
        ddx_d = (B - A) / T_AB**2 * (60.0 * xi * (1.0 + xi * (2.0 * xi - 3.0)))
        ddx = ddx_d + task.feedback_gain * (dx_d - state.J[:3] @ dq)  # derivative of Eq. (37)
        dJ_dq = model.velocity_product(q, dq)[:3]
        return np.concatenate((dq, scheme.acceleration(state, ddx, dJ_dq)))

    return flow
