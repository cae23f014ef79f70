"""Least squares in order of priority under limits: the compiled ground of constrained.py.

Each level minimises 1/2 |A z - a|^2 over what the levels before it have left, subject to
lower <= G z <= upper (active_set.py). A finished level leaves A z as it is, and fixes the limits
that its multipliers prove tight in every optimum.
"""

import numpy as np
from numba import boolean, float64, int64

from redres_ros.kernels.active_set import fix_level, hardest_of, minimise
from redres_ros.kernels.arithmetic import dot
from redres_ros.kernels.compiled import compiled, inlined, matrix, several, vector
from redres_ros.kernels.search import SIDE
from redres_ros.kernels.slack import close_slack, open_slack
from redres_ros.kernels.start import begin_at, leave_behind


@inlined
def rows_of(level: int, groups: np.ndarray, tasks: np.ndarray, n: int) -> int:
    """How many rows a level has: limits, the first task, its share, the other tasks, the law."""
    first_task = len(groups)
    if level < first_task:
        return groups[level]
    if level == first_task:
        return tasks[0]
    if level == first_task + 1:
        return 1
    task = level - first_task - 1
    return tasks[task] if task < len(tasks) else n


@compiled()
def ask_for_task(
    J: np.ndarray, dx: np.ndarray, row: int, is_first: bool, A: np.ndarray, a: np.ndarray
) -> None:
    """J dq - s dx = 0 of the first task, J dq = dx of another one, whose rows begin at `row`."""
    n = J.shape[1]
    for i in range(len(A)):
        for j in range(n):
            A[i, j] = J[row + i, j]
        if is_first:
            A[i, n] = -dx[row + i]
        else:
            a[i] = dx[row + i]


@inlined
def ask_for_law(
    W: np.ndarray, is_factor: bool, dq_free: np.ndarray, A: np.ndarray, a: np.ndarray
) -> None:
    """|A z - a|^2 = (dq - dq_free)' W (dq - dq_free), with A = F of W = F'F; I for an empty W."""
    n = len(dq_free)
    for i in range(n):
        A[i, i] = 1.0
    for i in range(len(W)):
        for j in range(0 if is_factor else i, n):
            if is_factor:
                A[i, j] = W[i, j]
                continue
            rest = W[i, j]
            for k in range(i):
                rest -= A[k, i] * A[k, j]
            A[i, j] = np.sqrt(rest) if i == j else rest / A[i, i]  # Cholesky
    for i in range(n):
        for j in range(n):
            a[i] += A[i, j] * dq_free[j]


@compiled(
    several(float64[::1], float64, float64, float64, int64, int64, boolean)(
        *(vector(), matrix(), boolean, matrix(), vector(), vector(int64)),
        *(vector(), vector(), matrix(), vector(), vector(), vector(int64), int64[::1]),
    )
)
def hierarchical_qp(
    dq_free: np.ndarray,
    W: np.ndarray,
    is_factor: bool,
    J: np.ndarray,
    dx: np.ndarray,
    tasks: np.ndarray,
    lower: np.ndarray,
    upper: np.ndarray,
    C: np.ndarray,
    low: np.ndarray,
    high: np.ndarray,
    groups: np.ndarray,
    active_set: np.ndarray,
) -> tuple[np.ndarray, float, float, float, int, int, bool]:
    """The joint velocity nearest to dq_free under limits and after tasks, in order of priority.

    Args:
        dq_free: (n,) what the last level wants.
        W: (n, n) its weight; (0, 0) for the identity.
        is_factor: whether W is the factor F of a weight F'F.
        J: (m, n) rows of all tasks.
        dx: (m,) what they want.
        tasks: (k,) number of rows of each task, one at least.
        lower: (n,) limits of dq.
        upper: (n,)
        C: (r, n) rows of the other limits.
        low: (r,) limits of C dq.
        high: (r,)
        groups: (g,) number of rows of each group that has a priority of its own.
        active_set: (n + 1,) of the last search, with which this one begins; zeros at first.
            It receives what this one leaves behind.

    Returns:
        dq (n,); the share of the first task; its error; the excess of the rows; the limit that
        resists hardest, the joints' first, then the rows', -1 for none; its side, +1 for the upper
        end; and whether each level got to its least.
    """
    n = len(dq_free)
    d = n + 1  # z = (dq, s, slack variables of one group)
    for rows in groups:
        d = max(d, n + 1 + rows)
    search, length = begin_at(dq_free, lower, upper, C, low, high, d, active_set)
    z = search.z
    first_task = len(groups)
    share = first_task + 1
    law = share + len(tasks)
    hardest = -1
    solved = True
    excess = 0.0
    error = 0.0
    limit_row = n + 1
    task_row = 0
    for level in range(law + 1):
        A = np.zeros((rows_of(level, groups, tasks, n), d))
        a = np.zeros(len(A))
        if level < first_task:
            open_slack(search, limit_row, length, A, n + 1)
        elif level == share:
            A[0, n] = 1.0  # s = 1
            a[0] = 1.0
        elif level == law:
            ask_for_law(W, is_factor, dq_free, A, a)
        else:
            ask_for_task(J, dx, task_row, level == first_task, A, a)
            task_row += len(A)
        force, tight, reached = minimise(search, A, a)
        solved = solved and reached
        if level == first_task:
            for i in range(len(A)):
                error += dot(A[i], z) ** 2
        if hardest < 0:
            hardest = hardest_of(search, force, tight)
        if level < first_task:
            excess += close_slack(search, limit_row, length, A, n + 1)
            limit_row += len(A)
            A = np.zeros((0, d))
        if level < law:
            fix_level(search, A, force, tight)

    leave_behind(search, active_set)
    dq = np.zeros(n)
    if not np.isfinite(dot(a, a) + dot(z, z) + error + excess):  # as the input was
        z[:] = 0.0
        active_set[:] = 0
        error = np.nan
        solved = False
    for i in range(n):
        dq[i] = min(max(z[i], lower[i]), upper[i])  # which changes it at rounding level
    s = min(max(z[n], 0.0), 1.0)
    side = search.marks[SIDE, hardest] if hardest >= 0 else 0
    if hardest > n:
        hardest -= 1  # the share is no limit to others
    return dq, s, np.sqrt(error), np.sqrt(excess), hardest, side, solved
