"""Difference of a velocity law from its second-order scheme, sampled and in continuous time."""

from dataclasses import dataclass, replace

import numpy as np

from redres_ros.command import Command
from redres_ros.controller import Controller
from redres_ros.errors import RangeError
from redres_ros.laws import make_law
from redres_ros.paper.continuous import integrate
from redres_ros.paper.second_order import Scheme, SecondOrderController, make_scheme, step
from redres_ros.planning.waypoints import WaypointTask
from redres_ros.preferences import Preference
from redres_ros.robot_model import RobotModel
from redres_ros.simulation.closed_loop import run

ZERO = 1e-9  # [rad/s]; a difference up to here is taken for rounding
SIMULATION_DYNAMICS = 'cylinders'  # the equal links of Section 5.2
PERIODS = (0.004, 0.002, 0.001, 0.0005)  # [s]


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
    T: float,
    task: WaypointTask,
    *,
    model: RobotModel | None = None,
    preference: Preference | None = None,
) -> Difference:
    """The task executed by a law and by its scheme, each in its own closed loop.

    Args:
        law_name: In the table LAWS.
        damping: k_d [1/s].
        T: Sampling time [s].
        task: What both execute.
        model: Of the arm; None for the task's with the equal links of Section 5.2.
        preference: Of both, Eqs. (18) and (19).

    Raises:
        UnknownNameError: The law has no yardstick.
        RangeError: Damping or T is not allowed.
    """
    model = model or RobotModel.named(task.robot, dynamics=SIMULATION_DYNAMICS)
    scheme = yardstick(law_name, damping, T, preference)
    preferences = (preference,) if preference else ()
    controller = Controller(model, make_law(law_name, damping=damping), T, preferences=preferences)
    law = _Accompanied(controller, scheme)
    one = run(law, task)
    two = run(SecondOrderController(model, scheme, T), task)
    norm = velocity_difference(one.vectors('dq1'), two.vectors('dq1'))
    ticks = len(norm)
    return Difference(one['t'][:ticks], norm, np.array(law.differences[:ticks]))


def velocity_difference(dq_I: np.ndarray, dq_II: np.ndarray) -> np.ndarray:
    """|dq_I - dq_II|, sample by sample as long as there are both, (N,) [rad/s].

    Args:
        dq_I: Joint velocities, (N_I, n) [rad/s].
        dq_II: Others, (N_II, n) [rad/s].
    """
    both = min(len(dq_I), len(dq_II))
    return np.linalg.norm(dq_I[:both] - dq_II[:both], axis=1)


def yardstick(
    law_name: str, damping: float, T: float, preference: Preference | None = None
) -> Scheme:
    """The scheme of second order that a law is compared with.

    minimum_velocity is of first order; it is what the sampled scheme of least acceleration becomes
    for k_d = 1/T (Appendix B), whatever its damping. minimum_kinetic_energy is of first order, too,
    and has no scheme in the paper.

    Args:
        law_name: In the table LAWS.
        damping: k_d [1/s].
        T: Sampling time [s].
        preference: A further preferred acceleration.

    Raises:
        UnknownNameError: There is none.
        RangeError: The damping is not allowed.
    """
    if law_name == 'minimum_velocity':
        return make_scheme('minimum_acceleration', 1.0 / T, preference)
    return make_scheme(law_name, damping, preference)


@dataclass(frozen=True)
class Convergence:
    """Largest distance of a sampled law from its scheme in continuous time, |q_k - q(t_k)| and
    |dq_k - dq(t_k)|.

    A law holds dq_k from t_k to t_{k+1}, so up to T ddq of dq_errors is only a shift in time. Where
    gravity enters the null space at the start, the first tick alone makes dq_errors exactly
    proportional to T. Then q_errors say more.

    Attributes:
        periods: Sampling times, (p,) [s].
        q_errors: (p,) [rad].
        dq_errors: (p,) [rad/s].
    """

    periods: np.ndarray
    q_errors: np.ndarray
    dq_errors: np.ndarray

    @property
    def q_order(self) -> float:
        """The slope of log(error) over log(period): 1 for the differences (8), (9), (10), (13)."""
        return _slope(self.periods, self.q_errors)


def convergence(
    law_name: str,
    damping: float,
    task: WaypointTask,
    periods: tuple[float, ...] = PERIODS,
    *,
    stretch: float = 3.0,
    model: RobotModel | None = None,
) -> Convergence:
    """A law at several sampling times beside its scheme in continuous time.

    Args:
        law_name: In the table LAWS.
        damping: k_d [1/s]. It is the same at every sampling time.
        task: Its segments have to be over in time at every sampling time.
        periods: Sampling times [s].
        stretch: How long the motion is watched from its beginning [s].
        model: Of the arm; None for the task's with the equal links of Section 5.2.

    Raises:
        UnknownNameError: The law has no scheme of second order.
        RangeError: Damping, a sampling time or the stretch is not allowed.
    """
    if not 0.0 < stretch <= task.segments * task.segment_time:
        raise RangeError('stretch', stretch, 0.0, task.segments * task.segment_time, 's')
    model = model or RobotModel.named(task.robot, dynamics=SIMULATION_DYNAMICS)
    scheme = make_scheme(law_name, damping)
    law = make_law(law_name, damping=damping)
    errors = []
    part = replace(task, waypoints=task.waypoints[: int(np.ceil(stretch / task.segment_time)) + 1])
    for T in periods:
        sampled = run(Controller(model, law, T), part)
        watched = sampled['t'] <= stretch
        exact = integrate(scheme, model, part, sampled['t'][watched])
        q_error = np.linalg.norm(sampled.vectors('q1')[watched] - exact.q, axis=1)  # (ticks,)
        dq_error = np.linalg.norm(sampled.vectors('dq1')[watched] - exact.dq, axis=1)
        errors.append((q_error.max(), dq_error.max()))
    return Convergence(np.array(periods), *np.transpose(errors))


def _slope(periods: np.ndarray, errors: np.ndarray) -> float:
    return float(np.polyfit(np.log(periods), np.log(errors), 1)[0])


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

    def update(self, q: np.ndarray, dx: np.ndarray) -> Command:
        command = self._controller.update(q, dx)
        dq = step(self.model, self._scheme, self.T, command.state, self._J_prev, dx, self._dx_prev)
        self.differences.append(float(np.linalg.norm(command.dq - dq)))
        self._J_prev = command.J
        self._dx_prev = dx
        return command
