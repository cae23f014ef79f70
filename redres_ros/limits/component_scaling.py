"""A task velocity whose components, translation and rotation, have scaling factors of their own.

A path must keep its direction: one factor s for all of dx (solver.py). An operator prefers an arm
that continues with what is possible. If s < 1, the other factors follow, each level as well as the
higher ones allow:

1. J_i dq = s_i dx_i for each component i with s <= s_i <= 1: the least sum of (1 - s_i)^2;
2. each component's direction, to DIRECTION_TOLERANCE, and then a velocity a_i |dx_i| along it with
   s_i <= a_i <= 1;
3. the largest a_i: the least sum of ((1 - a_i) |dx_i|)^2;
4. the least velocity across it, and of the components that are not asked for;
5. the other tasks, and the law.

If joints at their ends leave less than a fifth of the whole, the components lock each other. Then
the largest one that can go on alone does, and of the other what is possible beside it. If it cannot
go on in its direction, it slides along what stops it, within the first of the sliding tolerances
that leaves something; only then it is the other's turn. This is judged without the limits on
accelerations, and blended in. The one that the arm executes already counts _LEAD times as much:
else the two might come to rest where both are of one size, each undoing what the other does.
"""

from collections.abc import Sequence
from dataclasses import replace
from itertools import product
from typing import NamedTuple

import numpy as np

from redres_ros.resolution import Level, Weight
from redres_ros.singularity import locked
from redres_ros.solver import Box, Constrained, Rows, solve_constrained
from redres_ros.types import Jacobian, JointVelocities, Radians, TaskVelocity

DIRECTION_TOLERANCE = float(np.radians(10.0))  # [rad] of what is left of a component
_SLIDING_TOLERANCES = tuple(np.radians((60.0, 85.0)).tolist())  # [rad], if it leaves nothing
_LEAD = 4.0  # by which another component must be larger to take over from the one that goes on

_NOTICEABLE = 1e-9  # an error [m/s] or an excess from which on a level counts as not fully kept
_NOTHING = 1e-9  # of dx; a component with less is not asked for


class _Component(NamedTuple):
    """The rows of one component."""

    J: Jacobian
    dx: TaskVelocity
    length: float  # of dx; 0 if it is not asked for
    rates: Jacobian  # of the tip along dx, and in the directions across it; J if not asked for

    def fraction(self, dq: JointVelocities) -> float:
        """That is executed along it; 1 if it is not asked for."""
        if not self.length:
            return 1.0
        return min(max(float(self.J.dot(dq).dot(self.dx)) / self.length**2, 0.0), 1.0)


def executed_fractions(task: Level, sizes: Sequence[int], dq: JointVelocities) -> tuple[float, ...]:
    """The fraction of each component of a task, of so many rows, that is executed; 1 if it is not
    asked for.
    """
    components = _split(task, sizes, [False] * len(sizes))
    return tuple(component.fraction(dq) for component in components)


def solve_components(
    dq_free: JointVelocities,
    W: Weight,
    tasks: Sequence[Level],
    box: Box,
    rows: Sequence[Rows],
    active_set: np.ndarray,
    sizes: Sequence[int],
    held: Sequence[bool],
    steady_box: Box,
    dq_prev: JointVelocities,
) -> Constrained:
    """As solve_constrained(), also `active_set`, with a scaling factor for each component of the
    first task, which has so many rows (sizes).

    The dx of a component that is `held` is only to hold it: it then counts as not asked for, and is
    executed with the least error in level 4. The steady box is that without the limits on
    accelerations.
    """
    whole = solve_constrained(dq_free, W, tasks, box, rows, active_set)
    is_exact = whole.error <= _NOTICEABLE
    one_for_all = replace(whole, component_scaling=(whole.s,) * len(sizes))
    if (is_exact and whole.s >= 1.0) or not np.isfinite(whole.error):
        return one_for_all
    components = _split(tasks[0], sizes, held)
    lengths = np.array([component.length for component in components])
    if not lengths.any():
        return one_for_all
    problem = _Problem(dq_free, W, tasks[1:], box, rows)
    least = whole.s if is_exact else 0.0
    factors = np.full(len(sizes), least)
    if is_exact and np.count_nonzero(lengths) > 1:
        factors = problem.exact_factors(components, least)
    executed = problem.executed(components, factors)
    dq = executed.dq
    if not is_exact or locked(whole.s):
        steady = problem._replace(box=steady_box)
        weight = steady.locked(components)
        if weight > 0.0:
            fractions = np.array([component.fraction(dq_prev) for component in components])
            executing = 1.0 + (_LEAD - 1.0) * fractions
            order = np.argsort(-executing * lengths, kind='stable')
            mixed = dq + weight * (_alone(problem, steady, components, order, dq) - dq)
            dq = np.clip(mixed, *box)  # the rounding of the mixture
    solved = whole.solved and executed.solved
    scaling = tuple(component.fraction(dq) for component in components)
    return replace(whole, dq=dq, solved=solved, component_scaling=scaling)


def _alone(
    problem: '_Problem',
    steady: '_Problem',
    components: Sequence[_Component],
    order: np.ndarray,
    dq: JointVelocities,
) -> JointVelocities:
    """A velocity for the first component, in an order (g,), that can go on without the others; dq
    if none can. `steady` is the problem without acceleration limits.
    """
    longest = max(component.length for component in components)
    left = 1.0  # the part of the mixture that the next one gets
    mixed = dq
    for i, tolerance in product(order, (DIRECTION_TOLERANCE, *_SLIDING_TOLERANCES)):
        length = components[i].length
        if not length or not left:
            continue
        # With what goes across, the tip is no faster than asked.
        speed = 1.0 if tolerance == DIRECTION_TOLERANCE else np.cos(tolerance)
        only = [component._replace(length=0.0) for component in components]
        only[i] = components[i]._replace(dx=speed * components[i].dx, length=speed * length)
        part = left * min(_LEAD * length / longest, 1.0)  # little of what is hardly asked
        part *= 1.0 - steady.locked(only, tolerance)
        if part > 0.0:
            executed = problem.executed(only, np.zeros(len(only)), tolerance)
            mixed = mixed + part * (executed.dq - dq)
        left -= part
    return mixed


class _Problem(NamedTuple):
    """Limits, and what comes after the first task."""

    dq_free: JointVelocities
    W: Weight
    tasks: Sequence[Level]
    box: Box
    rows: Sequence[Rows]

    def exact_factors(self, components: Sequence[_Component], least: float) -> np.ndarray:
        """The factors s_i of level 1, (g,), that are at least s; `least` if not asked for."""
        asked = [component for component in components if component.length]
        along = np.array([each.rates[0] / each.length for each in asked])  # times dq: the factors
        across = np.concatenate([each.rates[1:] / each.length for each in asked])
        ones = np.ones(len(asked))
        levels = [(across, np.zeros(len(across))), (along, ones)]
        dq = self._solve(levels, (along, least * ones, ones)).dq
        factors = np.full(len(components), least)
        factors[[component.length > 0.0 for component in components]] = along.dot(dq)
        return np.clip(factors, least, 1.0)

    def executed(
        self,
        components: Sequence[_Component],
        factors: np.ndarray,
        tolerance: Radians = DIRECTION_TOLERANCE,
    ) -> Constrained:
        """The optimum of levels 2 to 5, for the factors s_i (g,) of level 1 and a tolerance of the
        directions.
        """
        along = []
        across = []
        rest = []
        cones = []
        for component in components:
            if not component.length:
                across.append(component.J)
                rest.append(component.dx)
                continue
            rates = component.rates
            along.append(rates[0])
            across.append(rates[1:])
            rest.append(np.zeros(len(rates) - 1))
            slope = np.tan(tolerance) / np.sqrt(max(len(rates) - 1, 1))
            cones += [rates[1:] - slope * rates[0], -rates[1:] - slope * rates[0]]  # pyramids
        lengths = np.array([component.length for component in components])
        least = factors[lengths > 0.0]
        lengths = lengths[lengths > 0.0]
        C = np.concatenate(cones)
        directions = C, np.full(len(C), -np.inf), np.zeros(len(C))
        A = np.array(along)
        levels = [(A, lengths), (np.concatenate(across), np.concatenate(rest))]
        return self._solve(levels, directions, (A, least * lengths, lengths))

    def locked(
        self, components: Sequence[_Component], tolerance: Radians = DIRECTION_TOLERANCE
    ) -> float:
        """How far the task velocity counts as locked, 0 to 1, with a tolerance as of executed()."""
        lengths = np.array([component.length for component in components])
        dq = self.executed(components, np.zeros(len(lengths)), tolerance).dq
        fractions = np.array([component.fraction(dq) for component in components])
        return locked(fractions.dot(lengths**2) / lengths.dot(lengths))

    def _solve(self, levels: Sequence[Level], *rows: Rows) -> Constrained:
        """The optimum within the limits and these rows."""
        first = np.empty((0, len(self.dq_free))), np.empty(0)  # none has a factor
        tasks = [first, *levels, *self.tasks]
        return solve_constrained(self.dq_free, self.W, tasks, self.box, [*self.rows, *rows])


def _split(task: Level, sizes: Sequence[int], held: Sequence[bool]) -> list[_Component]:
    """The components of a task."""
    noise = _NOTHING * float(np.linalg.norm(task[1]))
    components = []
    begin = 0
    for size, is_held in zip(sizes, held, strict=True):
        J = task[0][begin : begin + size]
        dx = task[1][begin : begin + size]
        length = float(np.linalg.norm(dx))
        if is_held or not length > noise:
            length = 0.0
        rates = J
        if length:
            Q, R = np.linalg.qr(np.column_stack((dx, np.eye(size))))
            frame = Q.T * np.copysign(1.0, R[0, 0])  # orthonormal rows, the first is along dx
            rates = frame.dot(J)
        components.append(_Component(J, dx, length, rates))
        begin += size
    return components
