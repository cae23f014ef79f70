"""Difference of a velocity law from its second-order scheme, sampled and in continuous time."""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from redres_ros.command import Command
from redres_ros.controller import Controller
from redres_ros.errors import RangeError, RedresError
from redres_ros.geometry import quintic
from redres_ros.laws import make_law
from redres_ros.paper.second_order import Scheme, SecondOrderController, make_scheme, step
from redres_ros.planning.planner import Planner
from redres_ros.planning.waypoints import WaypointTask
from redres_ros.policy import SPEED_LIMIT
from redres_ros.preferences import Preference
from redres_ros.robot_model import RobotModel
from redres_ros.simulation.closed_loop import run
from redres_ros.types import JointPositions, Seconds, TaskVelocity, Times

SIMULATION_DYNAMICS = 'cylinders'  # the equal links of Section 5.2
_PERIODS = (0.004, 0.002, 0.001, 0.0005)  # [s]

_RTOL = 1e-10
_ATOL = 1e-12  # of q [rad] and dq [rad/s]; far below what a sampling time of 0.1 ms changes


@dataclass(frozen=True)
class Difference:
    """|dq_I - dq_II| of a law (I) and its scheme (II), over the ticks that both took.

    Where a loop amplifies rounding, only same_past stays small.

    Attributes:
        t: (ticks,) [s].
        norm: (ticks,) [rad/s], each in a closed loop of its own.
        same_past: (ticks,) [rad/s], the scheme being given at each tick what the law had.
    """

    t: np.ndarray
    norm: np.ndarray
    same_past: np.ndarray

    @property
    def max(self) -> float:
        """Largest difference of the closed loops [rad/s]."""
        return float(self.norm.max())


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
    controller = Controller(model, make_law(law_name, damping=damping), T, preferences=preferences)
    law = _Accompanied(controller, scheme)
    one = run(law, task)
    two = run(SecondOrderController(model, scheme, T), task)
    norm = velocity_difference(one.vectors('dq1'), two.vectors('dq1'))
    ticks = len(norm)
    return Difference(one['t'][:ticks], norm, np.array(law.differences[:ticks]))


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
        return make_scheme('minimum_acceleration', 1.0 / T, preference)
    return make_scheme(law_name, damping, preference)


class _Accompanied:
    """A controller, and at every tick the difference from the command of a scheme with the same
    past.
    """

    def __init__(self, controller: Controller, scheme: Scheme) -> None:
        self.model = controller.model
        self.T = controller.T
        self.m = controller.m
        self._controller = controller
        self._scheme = scheme
        self._J_prev = np.zeros((3, self.model.n))
        self._dx_prev = np.zeros(3)
        self.differences: list[float] = []  # [rad/s], one a tick

    def update(self, q: JointPositions, dx: TaskVelocity) -> Command:
        command = self._controller.update(q, dx)
        dq = step(self.model, self._scheme, self.T, command.state, self._J_prev, dx, self._dx_prev)
        self.differences.append(float(np.linalg.norm(command.dq - dq)))
        self._J_prev = command.J
        self._dx_prev = dx
        return command


@dataclass(frozen=True)
class Convergence:
    """Largest distance |q_k - q(t_k)| of a sampled law from its scheme in continuous time.

    Attributes:
        periods: Sampling times, (p,) [s].
        q_errors: (p,) [rad].
    """

    periods: np.ndarray
    q_errors: np.ndarray

    @property
    def q_order(self) -> float:
        """The slope of log(error) over log(period): 1 for the differences (8), (9), (10), (13)."""
        return float(np.polyfit(np.log(self.periods), np.log(self.q_errors), 1)[0])


def convergence(
    law_name: str,
    damping: float,
    task: WaypointTask,
    periods: tuple[float, ...] = _PERIODS,
    *,
    model: RobotModel | None = None,
) -> Convergence:
    """A law at several sampling times [s] beside its scheme in continuous time, on the first
    segment, which has to be over in time at each. Raises UnknownNameError for a law without scheme.
    """
    model = model or RobotModel.named(task.robot, dynamics=SIMULATION_DYNAMICS)
    scheme = make_scheme(law_name, damping)
    law = make_law(law_name, damping=damping)
    errors = []
    segment = replace(task, waypoints=task.waypoints[:2])
    for T in periods:
        sampled = run(Controller(model, law, T), segment)
        watched = sampled['t'] <= task.segment_time
        q = integrate(scheme, model, segment, sampled['t'][watched])
        errors.append(np.linalg.norm(sampled.vectors('q1')[watched] - q, axis=1).max())
    return Convergence(np.array(periods), np.array(errors))


class LostMotionError(RedresError):
    """A continuous motion that cannot be followed to its end."""


def integrate(scheme: Scheme, model: RobotModel, task: WaypointTask, t: Times) -> np.ndarray:
    """q (N, n) [rad] at ascending times, as a scheme executes the task with dJ dq and ddx known
    exactly.

    Each segment takes exactly T_AB ('at_rest'; the tip is then far closer than the tolerance). ddx
    = ddx_d + k_P (dx_d - J dq) is the derivative of Eq. (37) and so keeps Eq. (37) itself, but only
    if the motion begins with it: if the start misses x_0, the arm starts with the least velocity
    that fulfils it, J_W^# dx(0), which is the first tick of a law as T goes to zero.

    Raises RangeError for a time outside the task, ArrayError if J loses rank, LostMotionError.
    """
    from scipy.integrate import solve_ivp  # an extra, which takes a while to load

    T_AB = task.segment_time
    T_end = task.segments * T_AB
    if not 0.0 <= t[0] <= t[-1] <= T_end:
        raise RangeError('t', t[0] if t[0] < 0.0 else t[-1], 0.0, T_end, 's')
    segment_of = np.minimum(t // T_AB, task.segments - 1).astype(int)  # (N,)
    start = model.state(task.start, np.zeros(model.n))
    dx = Planner(task).reference(start.x, 0.0).dx
    y = np.concatenate((start.q, scheme.pseudoinverse(start) @ dx))  # (q, dq), (2n,)
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
    return np.array(rows)[:, : model.n]


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
        ddx_d = (B - A) / T_AB**2 * (60.0 * xi * (1.0 + xi * (2.0 * xi - 3.0)))
        ddx = ddx_d + task.feedback_gain * (dx_d - state.J[:3] @ dq)  # derivative of Eq. (37)
        dJ_dq = model.velocity_product(q, dq)[:3]
        return np.concatenate((dq, scheme.acceleration(model, state, ddx, dJ_dq)))

    return flow
