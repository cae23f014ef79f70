"""A task velocity whose components, translation and rotation, have scaling factors of their own.

A path must keep its direction: one factor s for all of dx (solver.py). An operator prefers an arm
that continues with what is possible. If s < 1, the other factors follow, each level as well as the
higher ones allow:

1. J_i dq = s_i dx_i for each component i with s <= s_i <= 1: the least sum of (1 - s_i)^2;
2. each component's direction, to DIRECTION_TOLERANCE;
3. the largest velocity a_i |dx_i| along it with s_i <= a_i <= 1: the least sum of
   ((1 - a_i) |dx_i|)^2;
4. the least velocity across it, and of the components that are not asked for;
5. the other tasks, and the law.

If joints at their ends leave less than a fifth of the whole, the components lock each other. Then
the largest one that can go on alone does, and of the other what is possible beside it. If it cannot
go on in its direction, it slides along what stops it, within the first of the sliding tolerances
that leaves something; only then it is the other's turn. This is judged without the limits on
accelerations, and blended in. The one that the arm executes already counts _LEAD times as much:
else the two might come to rest where both are of one size, each undoing what the other does.

The factors a_i are variables beside dq, so that solve_constrained() does the work.
"""

from collections.abc import Sequence
from dataclasses import replace
from itertools import product
from typing import NamedTuple

import numpy as np

from redres_ros.resolution import Factor, Level, Weight, as_array
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
    components = _split(tasks[0], sizes, held)
    lengths = _lengths(components)
    is_whole = is_exact and whole.s >= 1.0
    if is_whole or not lengths.any() or not np.isfinite(whole.error):
        return replace(whole, component_scaling=(whole.s,) * len(sizes))
    problem = _WithFactors(dq_free, W, tasks[1:], box, rows, len(sizes))
    factors = np.full(len(sizes), whole.s if is_exact else 0.0)
    if is_exact and np.count_nonzero(lengths) > 1:
        factors = problem.largest_factors(tasks[0], sizes, factors)
    executed = problem.executed(components, factors)
    dq = executed.dq[: len(dq_free)]
    if not is_exact or locked(whole.s):
        steady = _WithFactors(dq_free, W, tasks[1:], steady_box, rows, len(sizes))
        weight = steady.locked(components)
        if weight > 0.0:
            fractions = np.array([component.fraction(dq_prev) for component in components])
            executing = 1.0 + (_LEAD - 1.0) * fractions
            order = np.argsort(-executing * lengths, kind='stable')
            dq = dq + weight * (_alone(problem, steady, components, order, dq) - dq)
    solved = whole.solved and executed.solved
    scaling = tuple(component.fraction(dq) for component in components)
    return replace(whole, dq=dq, solved=solved, component_scaling=scaling)


def _alone(
    problem: '_WithFactors',
    steady: '_WithFactors',
    components: Sequence[_Component],
    order: np.ndarray,
    dq: JointVelocities,
) -> JointVelocities:
    """A velocity for the first component, in an order (g,), that can go on without the others; dq
    if none can. `steady` is the problem without acceleration limits.
    """
    lengths = _lengths(components)
    left = 1.0  # the part of the mixture that the next one gets
    mixed = dq
    for i, tolerance in product(order, (DIRECTION_TOLERANCE, *_SLIDING_TOLERANCES)):
        if not lengths[i] or not left:
            continue
        # With what goes across, the tip is no faster than asked.
        speed = 1.0 if tolerance == DIRECTION_TOLERANCE else np.cos(tolerance)
        J, dx, length = components[i]
        only = [component._replace(length=0.0) for component in components]
        only[i] = _Component(J, speed * dx, speed * length)
        part = left * min(_LEAD * lengths[i] / lengths.max(), 1.0)  # little of what is hardly asked
        part *= 1.0 - steady.locked(only, tolerance)
        if part > 0.0:
            executed = problem.executed(only, np.zeros(len(lengths)), tolerance)
            mixed = mixed + part * (executed.dq[: len(dq)] - dq)
        left -= part
    return mixed


class _WithFactors:
    """A constrained problem in z = (dq, a), with a factor a_i for each of count components."""

    def __init__(
        self,
        dq_free: JointVelocities,
        W: Weight,
        tasks: Sequence[Level],
        box: Box,
        rows: Sequence[Rows],
        count: int,
    ) -> None:
        self._n = len(dq_free)
        self._ones = np.ones(count)
        self._free = np.concatenate((dq_free, self._ones))
        self._weight = _with_ones(W, self._n, count)
        self._box = box
        self._tasks = [(self._widened(J), dx) for J, dx in tasks]
        self._rows = [(self._widened(C), low, high) for C, low, high in rows]
        self._factors = np.eye(self._n + count)[self._n :]  # (g, n + g), that are a in z

    def largest_factors(self, task: Level, sizes: Sequence[int], least: np.ndarray) -> np.ndarray:
        """The factors s_i of level 1, (g,), of which the least are given, (g,)."""
        J, dx = task
        rows = self._widened(J)
        component = np.repeat(np.arange(len(sizes)), sizes)
        rows[np.arange(len(dx)), self._n + component] = -dx
        z = self._solve([(rows, np.zeros(len(dx))), (self._factors, self._ones)], least).dq
        return np.maximum(z[self._n :], least)

    def executed(
        self,
        components: Sequence[_Component],
        least: np.ndarray,
        tolerance: Radians = DIRECTION_TOLERANCE,
    ) -> Constrained:
        """The optimum of the levels 2 to 5 with z in place of dq, for the least factors s_i (g,) of
        level 1 and a tolerance of the directions.
        """
        along = []
        across = []
        rest = []
        cones = []
        for (J, dx, length), factor in zip(components, self._factors, strict=True):
            if not length:
                across.append(J)
                rest.append(dx)
                continue
            frame = _frame(dx / length)
            along.append(self._widened(frame[:1].dot(J)) - length * factor)
            across.append(frame[1:].dot(J))
            rest.append(np.zeros(len(frame) - 1))
            cones.append(_cone(frame, J, tolerance))
        lengths = _lengths(components)
        tasks = [
            (np.concatenate(along), np.zeros(len(along))),
            (lengths[:, None] * self._factors, lengths),
            (self._widened(np.concatenate(across)), np.concatenate(rest)),
            *self._tasks,
        ]
        return self._solve(tasks, least, cones)

    def locked(
        self, components: Sequence[_Component], tolerance: Radians = DIRECTION_TOLERANCE
    ) -> float:
        """How far the task velocity counts as locked, 0 to 1, with a tolerance as of executed()."""
        lengths = _lengths(components)
        dq = self.executed(components, np.zeros(len(lengths)), tolerance).dq[: self._n]
        fractions = np.array([component.fraction(dq) for component in components])
        return locked(fractions.dot(lengths**2) / lengths.dot(lengths))

    def _solve(
        self, tasks: Sequence[Level], least: np.ndarray, cones: Sequence[np.ndarray] = ()
    ) -> Constrained:
        """The optimum within the limits, with z (n + g,) in place of dq."""
        lower, upper = self._box
        box = np.concatenate((lower, least)), np.concatenate((upper, self._ones))
        rows = self._rows
        if cones:
            C = self._widened(np.concatenate(cones))
            rows = [*rows, (C, np.full(len(C), -np.inf), np.zeros(len(C)))]
        return solve_constrained(self._free, self._weight, tasks, box, rows)

    def _widened(self, C: np.ndarray) -> np.ndarray:
        """Rows (r, n) of dq as rows (r, n + g) of z."""
        return np.hstack((C, np.zeros((len(C), len(self._ones)))))


def _split(task: Level, sizes: Sequence[int], held: Sequence[bool]) -> list[_Component]:
    """The components of a task."""
    J, dx = task
    noise = _NOTHING * float(np.linalg.norm(dx))
    components = []
    begin = 0
    for size, is_held in zip(sizes, held, strict=True):
        rows = slice(begin, begin + size)
        length = float(np.linalg.norm(dx[rows]))
        is_asked = length > noise and not is_held
        components.append(_Component(J[rows], dx[rows], length if is_asked else 0.0))
        begin += size
    return components


def _lengths(components: Sequence[_Component]) -> np.ndarray:
    """|dx_i| of each component, (g,)."""
    return np.array([component.length for component in components])


def _frame(direction: np.ndarray) -> np.ndarray:
    """Orthonormal rows (k, k), of which the first is a unit vector (k,)."""
    Q, R = np.linalg.qr(np.column_stack((direction, np.eye(len(direction)))))
    return Q.T * np.copysign(1.0, R[0, 0])


def _cone(frame: np.ndarray, J: Jacobian, tolerance: Radians) -> np.ndarray:
    """Rows C (2 (k - 1), n) with C dq <= 0 within the tolerance: a pyramid inside the cone."""
    along = frame[0] * np.tan(tolerance) / np.sqrt(max(len(frame) - 1, 1))
    return np.concatenate((frame[1:] - along, -frame[1:] - along)).dot(J)


def _with_ones(W: Weight, n: int, count: int) -> Weight:
    """A weight of z, with ones for the factors."""
    if W is None:
        return None
    array = np.eye(n + count)
    array[:n, :n] = as_array(W)[0]
    return Factor(array) if isinstance(W, Factor) else array
