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

import numpy as np

from redres_ros.kernels.active_set import hierarchical_qp
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
_StackedRows = tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray, int]
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
    sizes: Sequence[int] = (),
    groups: Sequence[int] = (),
) -> Constrained:
    """The optimum under limits: always finite and in the box, and nearest to standing still if the
    input is not finite.

    Args:
        tasks: In order of priority; beside a singularity without the directions that dq_free does
            not execute.
        box: With lower <= upper.
        rows: Each group of other limits, in order of priority.
        active_set: (n + 1,) of int64, from the search of the tick before, at first zeros. It
            shortens this one, and is overwritten. None: there was none.
        sizes, groups: Rows of each task and group, if several come as one; the last have no names.
    """
    n = len(dq_free)
    J, dx = stacked(tasks, n)
    counts = _sizes(*sizes) if sizes else _sizes(*[len(dx) for _, dx in tasks])
    stacked_rows = _stacked_rows(rows, n, groups)
    factor, form = as_array(W)  # that of a SQUARE is symmetric: W = M'M
    if form == WEIGHT:
        factor = np.zeros((n, n))
        fill_factor(np.asarray(W, FLOAT64), factor)
    if active_set is None:
        active_set = np.zeros(n + 1, np.int64)
    problem = dq_free, factor, J, dx, counts, np.asarray(box, FLOAT64)
    if len(stacked_rows[1]) > _FEW:
        return _with_needed_rows(problem, stacked_rows, active_set)
    dq = np.empty(n)
    return Constrained(dq, *hierarchical_qp(*problem, *stacked_rows, active_set, dq))


def _with_needed_rows(problem: _Problem, rows: _StackedRows, active_set: np.ndarray) -> Constrained:
    """The optimum under many rows, found with those alone that it would exceed: rows that it keeps
    anyway do not change it.
    """
    dq_free, *_, box = problem
    C, low, high, groups, named = rows
    n = len(dq_free)
    group = np.repeat(np.arange(len(groups)), groups)
    length = np.maximum(np.linalg.norm(C, axis=1), _SHORTEST)
    chosen = np.zeros(len(low), bool)
    dq = np.clip(dq_free, *box)
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
        few = C[chosen], low[chosen], high[chosen], counts, int(chosen[:named].sum())
        solved = Constrained(dq, *hierarchical_qp(*problem, *few, active_set, dq))
    if solved.limiting >= n:
        solved.limiting = n + int(np.flatnonzero(chosen)[solved.limiting - n])
    return solved


def _stacked_rows(rows: Sequence[Rows], n: int, groups: Sequence[int]) -> _StackedRows:
    """C (r, n), low and high (r,) of all rows, how many each group has, and how many have names."""
    if not rows:
        return _no_rows(n)
    counts = _sizes(*(groups or [len(low) for _, low, _ in rows]))
    if len(rows) == 1:  # nothing to copy
        C, low, high = (np.asarray(each, FLOAT64) for each in rows[0])
    else:
        C, low, high = (np.concatenate(each, dtype=FLOAT64) for each in zip(*rows, strict=True))
    return C, low, high, counts, len(low) - (len(rows[-1][1]) if groups else 0)


@lru_cache
def _sizes(*rows: int) -> np.ndarray:
    return np.array(rows or (0,), np.int64)


@lru_cache
def _no_rows(n: int) -> _StackedRows:
    return np.zeros((0, n)), np.zeros(0), np.zeros(0), np.zeros(0, np.int64), 0
