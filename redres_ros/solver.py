"""The constrained optimum: the best of the joint velocities that keep the limits.

In order of priority, each level as well as the higher ones allow:

1. the box, lower <= dq <= upper, always;
2. rows, low <= C dq <= high, group after group, with the least sum of squares of the excess;
3. the first task with its direction kept, J dq = s dx with the largest s in [0, 1]; if no s is
   feasible, the least |J dq - s dx|, and then the largest s;
4. the other tasks with the least |J dq - dx|, one after the other;
5. the law, with the least 1/2 (dq - b)' W (dq - b).

The caller knows dq_free, the same optimum without limits (resolution.py), which does not keep them.
It replaces b in level 5: W (dq_free - b) is orthogonal to all motion that leaves J dq as it is, so
both have the same minimum. kernels/active_set.py searches; no limit, task or law is named here.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np

from redres_ros.kernels.active_set import WHOLE, Parts, hierarchical_qp
from redres_ros.kernels.closed_form import WEIGHT, fill_factor
from redres_ros.resolution import Level, Weight, as_array, stacked
from redres_ros.types import FLOAT64, JointVelocities

# Rows that are given to the search at once, and those that are then added, or this part of all that
# are exceeded: its time grows with the square of their number
_FEW = 10
_ADDED = 4
_SHORTEST = 1e-12  # of a row whose excess is measured by its length

Box = tuple[np.ndarray, np.ndarray] | np.ndarray  # lower, upper, (n,) [rad/s]
Rows = tuple[np.ndarray, np.ndarray, np.ndarray]  # C (r, n), low (r,), high (r,)
_StackedRows = tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]
# The first six arguments of hierarchical_qp()
_Problem = tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray, np.ndarray, np.ndarray]


@dataclass(slots=True)  # made in every tick in which limits act
class Constrained:
    """A joint velocity that keeps the box, and the violations of the lower levels."""

    dq: JointVelocities
    s: float = 1.0  # task scaling: the fraction of the first task's velocity that is executed
    error: float = 0.0  # |J dq - s dx| of the first task; more than rounding if no s is feasible
    excess: float = 0.0  # of the rows, the root of the sum of squares
    limiting: int = -1  # the limit that resists hardest: joints first, then rows; -1 for none
    side: int = 0  # of that limit: +1 its upper bound, -1 its lower one
    solved: bool = True  # False if a level stopped before its optimum
    component_scaling: tuple[float, ...] = ()  # executed of each component


def solve_constrained(
    dq_free: JointVelocities,
    W: Weight,
    tasks: Sequence[Level],
    box: Box,
    rows: Sequence[Rows] = (),
    active_set: np.ndarray | None = None,
    parts: Parts = WHOLE,
) -> Constrained:
    """The optimum under limits: finite and in the box; nearest to rest if the input is not finite.

    Args:
        tasks: In order of priority, without singular directions that dq_free does not execute.
        box: With lower <= upper.
        rows: Each group of other limits, in order of priority.
        active_set: (n + 1,) of int64, from the search of the tick before, at first zeros. It
            shortens this one, and is overwritten. None: there was none.
        parts: As of hierarchical_qp(), with an active_set of (4 n + 3,); WHOLE has none.
    """
    n = len(dq_free)
    J, dx = stacked(tasks, n)
    counts = _sizes(*[len(dx) for _, dx in tasks])
    stacked_rows = _stacked_rows(rows, n)
    factor, form = as_array(W)  # that of a SQUARE is symmetric: W = M'M
    if form == WEIGHT:
        factor = np.zeros((n, n))
        fill_factor(np.asarray(W, FLOAT64), factor)
    if active_set is None:
        active_set = np.zeros(4 * n + 3, np.int64)
    problem = dq_free, factor, J, dx, counts, np.asarray(box, FLOAT64)
    dq = np.empty(n)
    how = active_set, dq, parts
    if len(stacked_rows[1]) > _FEW:
        return _with_needed_rows(problem, stacked_rows, how)
    return Constrained(dq, *hierarchical_qp((*problem, *stacked_rows), *how))


def _with_needed_rows(problem: _Problem, rows: _StackedRows, how: tuple[Any, ...]) -> Constrained:
    """The optimum under many rows, found with those it would exceed: others do not change it."""
    dq_free, *_, box = problem
    C, low, high, groups = rows
    n = len(dq_free)
    group = np.repeat(np.arange(len(groups)), groups)
    length = np.maximum(np.linalg.norm(C, axis=1), _SHORTEST)
    chosen = np.zeros(len(low), bool)
    dq = np.clip(dq_free, *box, out=how[1])
    solved = None
    while True:
        values = C.dot(dq)
        excess = np.maximum(values - high, low - values) / length
        excess[chosen] = 0.0
        exceeded = np.flatnonzero(~(excess <= 0.0))  # also what is not finite
        if solved and not exceeded.size:
            break
        count = max(_ADDED, len(exceeded) // _ADDED)
        chosen[exceeded[np.argsort(-excess[exceeded])[:count]]] = True
        counts = np.bincount(group[chosen], minlength=len(groups))
        few = *problem, C[chosen], low[chosen], high[chosen], counts
        solved = Constrained(dq, *hierarchical_qp(few, *how))
    if solved.limiting >= n:
        solved.limiting = n + int(np.flatnonzero(chosen)[solved.limiting - n])
    return solved


def _stacked_rows(rows: Sequence[Rows], n: int) -> _StackedRows:
    """C (r, n), low and high (r,) of all rows, and how many each group has."""
    if not rows:
        return _no_rows(n)
    counts = _sizes(*[len(low) for _, low, _ in rows])
    if len(rows) == 1:  # nothing to copy
        C, low, high = (np.asarray(each, FLOAT64) for each in rows[0])
    else:
        C, low, high = (np.concatenate(each, dtype=FLOAT64) for each in zip(*rows, strict=True))
    return C, low, high, counts


@lru_cache
def _sizes(*rows: int) -> np.ndarray:
    return np.array(rows or (0,), np.int64)


@lru_cache
def _no_rows(n: int) -> _StackedRows:
    return np.zeros((0, n)), np.zeros(0), np.zeros(0), np.zeros(0, np.int64)
