"""Where a search starts: in the box, near what is wanted without limits."""

import numpy as np

from redres_ros.kernels.basis import hold
from redres_ros.kernels.compiled import inlined
from redres_ros.kernels.search import (
    COUNT,
    FIXED,
    HELD,
    LATER,
    LOWER,
    SIDE,
    STATE,
    UPPER,
    Search,
)

# The last element of what a search leaves behind for the next one.
UNKNOWN = 0  # nothing: there was none
WHOLE = 1  # the whole task was executed
LESS = -1  # less of it


@inlined
def begin_at(
    dq_free: np.ndarray,
    lower: np.ndarray,
    upper: np.ndarray,
    C: np.ndarray,
    low: np.ndarray,
    high: np.ndarray,
    d: int,
    active_set: np.ndarray,
) -> tuple[Search, np.ndarray]:
    """A search that starts at the point of the box nearest to dq_free, with a share of 1.

    It holds the limits that the last search held in the end: most often it is there after one step
    of each level. Without one, it holds those that dq_free does not keep. The start has no say in
    where the search ends, but for rounding.

    Returns:
        The search, and the lengths (K,) of its rows before they became unit vectors.
    """
    n = len(dq_free)
    K = n + 1 + len(C)
    search = Search(
        np.zeros(d),
        np.zeros((K, d)),
        np.zeros((2, K)),
        np.zeros((2, d, d)),
        np.zeros((4, K + d), np.int64),
        n,
    )
    z, G, ends, _, marks, _ = search
    length = np.zeros(K)
    z[n] = 1.0
    G[n, n] = 1.0  # 0 <= s <= 1
    ends[UPPER, n] = 1.0
    for i in range(n):
        G[i, i] = 1.0
        ends[LOWER, i] = lower[i]
        ends[UPPER, i] = upper[i]
        z[i] = min(max(dq_free[i], lower[i]), upper[i])
        if lower[i] == upper[i]:
            hold(search, i, dq_free[i] - z[i])
            marks[STATE, i] = FIXED
    marks[COUNT, 0] = marks[COUNT, 1]
    for i in range(n):
        if marks[STATE, i] == FIXED:
            continue
        towards = dq_free[i] - z[i]
        if active_set[n] != UNKNOWN:
            towards = float(active_set[i])
            end = upper[i] if towards > 0.0 else lower[i]
            if towards == 0.0 or not np.isfinite(end):
                continue
            z[i] = end
        if towards != 0.0:
            hold(search, i, towards)
    if active_set[n] != LESS:
        hold(search, n, 1.0)
    for r in range(len(C)):
        i = n + 1 + r
        marks[STATE, i] = LATER
        square = 0.0
        for j in range(n):
            square += C[r, j] ** 2
        length[i] = np.sqrt(square) if square > 0.0 else 1.0
        for j in range(n):
            G[i, j] = C[r, j] / length[i]
        ends[LOWER, i] = low[r] / length[i]
        ends[UPPER, i] = high[r] / length[i]
    return search, length


@inlined
def leave_behind(search: Search, active_set: np.ndarray) -> None:
    """Write down which limits a search holds in the end: the side of each joint, and the share."""
    for i in range(search.n):
        active_set[i] = 0
        if search.marks[STATE, i] in (HELD, FIXED):
            active_set[i] = search.marks[SIDE, i]
    active_set[search.n] = WHOLE if search.z[search.n] >= 1.0 else LESS
