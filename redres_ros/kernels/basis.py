"""The rows along which the point of a search may not move, kept as R Q with orthonormal Q."""

import numpy as np

from redres_ros.kernels.arithmetic import dot
from redres_ros.kernels.compiled import compiled
from redres_ros.kernels.search import BEHIND, COUNT, FREE, HELD, SIDE, STATE, Q, R, Search

MUCH = 0.5  # a row that keeps this share of its square is orthogonal to the others after one pass
DEPENDENT = 1e-13  # a row is dependent if less than this share of it is orthogonal to the others


@compiled()
def append(search: Search, row: np.ndarray, least: float) -> bool:
    """Add a row, unless less than a length of `least` is orthogonal to those that are there."""
    basis = search.basis
    k = search.marks[COUNT, 1]
    if k == len(row):
        return False
    rest = row.copy()
    for j in range(k):
        basis[R, k, j] = 0.0
    before = dot(row, row)
    square = before
    for _ in range(2):  # Gram-Schmidt, and once more where rounding may have left something
        for j in range(k):
            along = dot(basis[Q, j], rest)
            basis[R, k, j] += along
            for i in range(len(rest)):
                rest[i] -= along * basis[Q, j, i]
        square = dot(rest, rest)
        if square > MUCH * before:
            break
    length = np.sqrt(square)
    if not length > least:
        return False
    for i in range(len(rest)):
        basis[Q, k, i] = rest[i] / length
    basis[R, k, k] = length
    search.marks[COUNT, 1] = k + 1
    return True


@compiled()
def hold(search: Search, i: int, towards: float) -> None:
    """Keep limit i at its upper end if towards > 0, else at its lower one.

    It stays free where the other rows keep it in its place already.
    """
    marks = search.marks
    marks[STATE, i] = FREE
    if append(search, search.G[i], DEPENDENT):
        marks[BEHIND, marks[COUNT, 1] - 1] = i
        marks[STATE, i] = HELD
        marks[SIDE, i] = 1 if towards > 0.0 else -1


@compiled()
def release(search: Search, k: int) -> None:
    """Let the limit behind row k go."""
    marks = search.marks
    end = marks[COUNT, 1]
    marks[COUNT, 1] = k
    marks[STATE, marks[BEHIND, k]] = FREE
    for j in range(k + 1, end):
        i = marks[BEHIND, j]
        hold(search, i, float(marks[SIDE, i]))
