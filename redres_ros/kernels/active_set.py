"""Least squares in order of priority under limits, by an active-set search.

Each level minimises 1/2 |A z - a|^2 over what the levels before it have left, subject to
lower <= G z <= upper. A finished level leaves A z as it is, and fixes the limits that its
multipliers prove tight in every optimum. The method is a primal active-set method (Nocedal and
Wright, Numerical Optimization, 2006, Algorithm 16.3): z keeps every limit after every step.

The state of a search is in arrays of fixed size, which the functions change in place.
"""

from typing import NamedTuple

import numpy as np
from numba import boolean, float64, int64

from redres_ros.kernels.compiled import compiled, inlined, matrix, part, several, vector

# The rows of Search.ends, and the sides of a limit.
_LOWER = 0
_UPPER = 1

# The rows of Search.marks.
_STATE = 0  # of each limit, one of the four below
_SIDE = 1  # of each limit that is held, +1 for its upper end and -1 for its lower one
_BEHIND = 2  # the limit behind row k of the basis
_COUNT = 3  # how many rows are fixed for good, and how many there are

_FREE = 0  # the state of a limit that z may come to,
_HELD = 1  # of one whose end z may not leave for now,
_FIXED = 2  # or for good,
_LATER = 3  # and of one that a later level brings in

ROUNDING = 4e-15  # of a sum, beside the sizes of its terms

_MUCH = 0.5  # a row that keeps this share of its square is orthogonal to the others after one pass
_DEPENDENT = 1e-13  # a row is dependent if less than this share of it is orthogonal to the others

_RANK = 1e-11  # a row of A is dependent below this share of the longest one

_MAX_STEPS = 200  # of one level; ten are many
_BY_INDEX = 60  # from this step on the lowest index decides, which cannot cycle (Bland)
_WRONG = 1e-14  # a force of the wrong sign counts from this share of the gradient's terms on
_TIGHT = 1e-10  # one of the right sign proves its limit tight from this share on

# The last element of what a search leaves behind for the next one.
_UNKNOWN = 0  # nothing: there was none
_WHOLE = 1  # the whole task was executed
_LESS = -1  # less of it


class _Search(NamedTuple):
    """A point, its limits, and the rows along which it may not move."""

    z: np.ndarray  # (d,)
    G: np.ndarray  # (K, d), of unit length
    ends: np.ndarray  # (2, K), lower <= G z <= upper
    length: np.ndarray  # (K,) of the rows of G before they became unit vectors
    Q: np.ndarray  # (d, d) orthonormal rows; behind those that count there may be others
    R: np.ndarray  # (d, d) lower triangular: row k of those rows is sum_j R[k, j] Q[j]
    marks: np.ndarray  # (4, K + d) of int64
    n: int  # z = (dq, s, slack variables), where dq is (n,)
    largest: np.ndarray  # (d,) that |z| has been; its rounding stays when z comes to zero


@inlined
def dot(A: np.ndarray, i: int, x: np.ndarray) -> float:
    """Row i of A (m, d) times x (d,)."""
    total = 0.0
    for j in range(len(x)):
        total += A[i, j] * x[j]
    return total


@part
def product(A: np.ndarray, i: int, B: np.ndarray, j: int) -> float:
    """Row i of A (m, d) times row j of B (k, d)."""
    total = 0.0
    for c in range(A.shape[1]):
        total += A[i, c] * B[j, c]
    return total


@part
def zeros(m: int, n: int) -> np.ndarray:
    """Zeros, (m, n)."""
    return np.zeros((m, n))


# --- orthonormal rows -----------------------------------------------------------------------------


@part
def _make_orthonormal(Q: np.ndarray, R: np.ndarray, k: int) -> None:
    """Row k of Q becomes a unit vector orthogonal to the rows before it: it was R[k] Q.

    Args:
        Q: (m, d).
        R: (m, m); its row k is overwritten as far as its diagonal.
        k: Number of the row.
    """
    for j in range(k):
        R[k, j] = 0.0
    before = product(Q, k, Q, k)
    square = before
    for _ in range(2):  # Gram-Schmidt, and once more where rounding may have left something
        for j in range(k):
            along = product(Q, j, Q, k)
            R[k, j] += along
            for c in range(Q.shape[1]):
                Q[k, c] -= along * Q[j, c]
        square = product(Q, k, Q, k)
        if square > _MUCH * before:
            break
    R[k, k] = np.sqrt(square)
    for c in range(Q.shape[1]):
        Q[k, c] /= R[k, k]


@part
def _substitute(R: np.ndarray, x: np.ndarray) -> None:
    """x becomes R'^-1 x, with as many rows of the lower triangular R as x (k,) has elements."""
    for k in range(len(x) - 1, -1, -1):
        for j in range(k + 1, len(x)):
            x[k] -= R[j, k] * x[j]
        x[k] /= R[k, k]


# --- the rows along which the point of a search may not move, R Q with orthonormal Q --------------


@inlined
def append(search: _Search, rows: np.ndarray, i: int, least: float) -> bool:
    """Add a row, unless less than a length of `least` is orthogonal to those that are there."""
    k = search.marks[_COUNT, 1]
    if k == len(search.Q):
        return False
    for j in range(len(search.Q)):
        search.Q[k, j] = rows[i, j]
    _make_orthonormal(search.Q, search.R, k)
    if not search.R[k, k] > least:
        return False
    search.marks[_COUNT, 1] = k + 1
    return True


@part
def _append_all(search: _Search, A: np.ndarray) -> None:
    """Add the rows of A that do not depend on those that are there."""
    square = 0.0
    for i in range(len(A)):
        square = max(square, product(A, i, A, i))
    for i in range(len(A)):
        append(search, A, i, _RANK * np.sqrt(square))


@part
def hold(search: _Search, i: int, towards: float) -> None:
    """Keep limit i at its upper end if towards > 0, else at its lower one.

    It stays free where the other rows keep it in its place already.
    """
    marks = search.marks
    marks[_STATE, i] = _FREE
    if append(search, search.G, i, _DEPENDENT):
        marks[_BEHIND, marks[_COUNT, 1] - 1] = i
        marks[_STATE, i] = _HELD
        marks[_SIDE, i] = 1 if towards > 0.0 else -1


@inlined
def release(search: _Search, k: int) -> None:
    """Let the limit behind row k go."""
    marks = search.marks
    end = marks[_COUNT, 1]
    marks[_COUNT, 1] = k
    marks[_STATE, marks[_BEHIND, k]] = _FREE
    for j in range(k + 1, end):
        i = marks[_BEHIND, j]
        hold(search, i, float(marks[_SIDE, i]))


# --- one step -------------------------------------------------------------------------------------


@part
def step(search: _Search, A: np.ndarray, a: np.ndarray) -> np.ndarray:
    """The shortest p across the basis with the least |A (z + p) - a|, (d,)."""
    m, d = A.shape
    count = search.marks[_COUNT, 1]
    _append_all(search, A)
    rank = search.marks[_COUNT, 1] - count
    search.marks[_COUNT, 1] = count
    # p = V' t with the orthonormal rows V from `count` on: |B t - rest| is least, B = A V'.
    Y = zeros(rank, m)  # B'
    U = zeros(rank, rank)
    rest = np.zeros(m)
    for i in range(m):
        rest[i] = a[i] - dot(A, i, search.z)
        for k in range(rank):
            Y[k, i] = product(A, i, search.Q, count + k)
    t = np.zeros(rank)
    for k in range(rank):
        _make_orthonormal(Y, U, k)
        t[k] = dot(Y, k, rest)
    _substitute(U, t)
    p = np.zeros(d)
    for k in range(rank):
        for j in range(d):
            p[j] += t[k] * search.Q[count + k, j]
    return p


@part
def _step_across(search: _Search, a: np.ndarray) -> np.ndarray:
    """As `step` for A = I, where p is what the basis leaves of a - dq, (d,)."""
    p = np.zeros(len(search.z))
    before = 0.0
    for j in range(len(a)):
        p[j] = a[j] - search.z[j]
        before += p[j] ** 2
    for _ in range(2):  # once more, for rounding
        for k in range(search.marks[_COUNT, 1]):
            along = dot(search.Q, k, p)
            for j in range(len(p)):
                p[j] -= along * search.Q[k, j]
    after = 0.0
    for j in range(len(p)):
        after += p[j] ** 2
    return p if after > _DEPENDENT**2 * before else np.zeros(len(p))


# --- one level ------------------------------------------------------------------------------------


@inlined
def minimise(
    search: _Search, A: np.ndarray, a: np.ndarray, is_plain: bool
) -> tuple[np.ndarray, float, bool]:
    """Move z to the least |A z - a| within the limits, with A = I where it is plain.

    Returns:
        The forces of the rows (d,), the least that proves a limit tight, and whether z got there.
    """
    for count in range(_MAX_STEPS):
        p = _step_across(search, a) if is_plain else step(search, A, a)
        i, along = _advance(search, p)
        if i < len(search.G):
            hold(search, i, along)
            continue
        force, largest = forces(search, A, a)
        k = _most_wrong(search, force, _WRONG * largest, count > _BY_INDEX)
        if k < 0:
            return force, _TIGHT * largest, True
        release(search, k)
    return np.zeros(len(search.z)), 1.0, False


@part
def _advance(search: _Search, p: np.ndarray) -> tuple[int, float]:
    """Move z along p as far as the limits allow.

    Returns:
        The limit that stops it, as many as there are for none; and the speed along its row.
    """
    z = search.z
    largest = 0.0
    for j in range(len(p)):
        largest = max(largest, abs(p[j]))
    share = 1.0
    first = len(search.G)
    along = 0.0
    for i in range(len(search.G)):
        if search.marks[_STATE, i] != _FREE:
            continue
        slope = 0.0
        value = 0.0
        noise = largest
        for j in range(len(z)):
            slope += search.G[i, j] * p[j]
            value += search.G[i, j] * z[j]
            noise += abs(search.G[i, j] * z[j])
        margin = search.ends[_UPPER, i] - value if slope > 0.0 else value - search.ends[_LOWER, i]
        speed = abs(slope)
        if speed <= 10.0 * _DEPENDENT * largest or speed <= margin + ROUNDING * noise:
            continue
        if share * speed > margin:
            share = max(margin, 0.0) / speed
            first = i
            along = slope
    for j in range(len(z)):
        z[j] += share * p[j]
        search.largest[j] = max(search.largest[j], abs(z[j]))
    return first, along


@part
def forces(search: _Search, A: np.ndarray, a: np.ndarray) -> tuple[np.ndarray, float]:
    """How hard each row resists the descent: A' (A z - a) + sum_k force_k row_k = 0 at the least.

    Returns:
        The forces (d,), and the largest term of the gradient, beside which rounding is judged.
    """
    d = len(search.z)
    g = np.zeros(d)
    fastest = 0.0
    for j in range(search.n):
        fastest = max(fastest, search.largest[j])
    largest = 0.0
    for i in range(len(A)):
        rest = -a[i]
        size = abs(a[i])
        for j in range(d):
            rest += A[i, j] * search.z[j]
            # A slack variable is a difference of velocities.
            size += abs(A[i, j]) * (fastest if j > search.n else search.largest[j])
        for j in range(d):
            g[j] += A[i, j] * rest
            largest = max(largest, abs(A[i, j]) * size)
    count = search.marks[_COUNT, 1]
    force = np.zeros(d)
    for k in range(count):
        force[k] = -dot(search.Q, k, g)
    _substitute(search.R, force[:count])
    return force, largest


@inlined
def _most_wrong(search: _Search, force: np.ndarray, least: float, by_index: bool) -> int:
    """The row that keeps z from where it wants to go inside the limits, -1 for none.

    Of several it is the one with the largest force, or that of the first limit.
    """
    marks = search.marks
    found = -1
    for k in range(marks[_COUNT, 0], marks[_COUNT, 1]):
        i = marks[_BEHIND, k]
        pull = -force[k] * marks[_SIDE, i]
        if by_index and found >= 0 and i > marks[_BEHIND, found]:
            continue
        if pull > least:
            found = k
            if not by_index:
                least = pull
    return found


@inlined
def _hardest_of(search: _Search, force: np.ndarray, tight: float) -> int:
    """The limit with the largest force of those that are tight, but the share's; -1 for none."""
    marks = search.marks
    hardest = -1
    largest = tight
    for k in range(marks[_COUNT, 0], marks[_COUNT, 1]):
        i = marks[_BEHIND, k]
        push = force[k] * marks[_SIDE, i]
        if push > largest and i != search.n:
            largest = push
            hardest = i
    return hardest


@inlined
def _fix_level(search: _Search, A: np.ndarray, force: np.ndarray, tight: float) -> None:
    """Fix A z and the limits that are tight; other held limits stay held."""
    marks = search.marks
    fixed = marks[_COUNT, 0]
    held = marks[_BEHIND, fixed : marks[_COUNT, 1]].copy()
    marks[_COUNT, 1] = fixed
    for k in range(len(held)):
        i = held[k]
        if force[fixed + k] * marks[_SIDE, i] > tight:
            hold(search, i, float(marks[_SIDE, i]))
    _append_all(search, A)
    marks[_COUNT, 0] = marks[_COUNT, 1]
    for k in range(len(held)):
        i = held[k]
        if marks[_STATE, i] == _HELD:
            if force[fixed + k] * marks[_SIDE, i] > tight:
                marks[_STATE, i] = _FIXED
            else:
                hold(search, i, float(marks[_SIDE, i]))


# --- limits that are rows, in a level of their own ------------------------------------------------


@inlined
def _open_slack(search: _Search, begin: int, A: np.ndarray, slack: int) -> None:
    """Bring in the limits from `begin` on, as many as A has rows: lower <= G z - w <= upper.

    w are the variables of z from `slack` on. A receives the rows that ask for the least |length w|.
    """
    z = search.z
    for r in range(len(A)):
        i = begin + r
        value = 0.0
        noise = 0.0
        for j in range(slack):
            value += search.G[i, j] * z[j]
            noise += abs(search.G[i, j] * z[j])
        above = value - search.ends[_UPPER, i]
        below = search.ends[_LOWER, i] - value
        A[r, slack + r] = search.length[i]
        search.G[i, slack + r] = -1.0
        search.marks[_STATE, i] = _FREE
        if max(above, below) > ROUNDING * noise:
            z[slack + r] = above if above > below else -below
            hold(search, i, z[slack + r])


@part
def _close_slack(search: _Search, begin: int, A: np.ndarray, slack: int) -> float:
    """Move the ends of limits that remain in excess to where they are.

    Returns:
        The sum of squares of the excess.
    """
    z = search.z
    square = 0.0
    for r in range(len(A)):
        i = begin + r
        square += (search.length[i] * z[slack + r]) ** 2
        z[slack + r] = 0.0
        search.G[i, slack + r] = 0.0
        value = dot(search.G, i, z)
        search.ends[_UPPER, i] = max(search.ends[_UPPER, i], value)
        search.ends[_LOWER, i] = min(search.ends[_LOWER, i], value)
    return square


# --- the start and the end of a search ------------------------------------------------------------


@inlined
def _begin_at(
    dq_free: np.ndarray,
    lower: np.ndarray,
    upper: np.ndarray,
    C: np.ndarray,
    low: np.ndarray,
    high: np.ndarray,
    d: int,
    held: np.ndarray,
) -> _Search:
    """A search that starts at the point of the box nearest to dq_free, with a share of 1.

    It holds the limits that the last search held in the end: most often it is there after one step
    of each level. Without one, it holds those that dq_free does not keep. The start has no say in
    where the search ends, but for rounding.
    """
    n = len(dq_free)
    K = n + 1 + len(C)
    search = _Search(
        np.zeros(d),
        zeros(K, d),
        zeros(_UPPER + 1, K),
        np.zeros(K),
        zeros(d, d),
        zeros(d, d),
        np.zeros((_COUNT + 1, K + d), np.int64),
        n,
        np.zeros(d),
    )
    z = search.z
    G = search.G
    ends = search.ends
    length = search.length
    marks = search.marks
    z[n] = 1.0
    G[n, n] = 1.0  # 0 <= s <= 1
    ends[_UPPER, n] = 1.0
    for i in range(n):
        G[i, i] = 1.0
        ends[_LOWER, i] = lower[i]
        ends[_UPPER, i] = upper[i]
        z[i] = min(max(dq_free[i], lower[i]), upper[i])
        if lower[i] == upper[i]:
            hold(search, i, dq_free[i] - z[i])
            marks[_STATE, i] = _FIXED
    marks[_COUNT, 0] = marks[_COUNT, 1]
    for i in range(n):
        if marks[_STATE, i] == _FIXED:
            continue
        towards = dq_free[i] - z[i]
        if held[n] != _UNKNOWN:
            towards = float(held[i])
            end = upper[i] if towards > 0.0 else lower[i]
            if towards == 0.0 or not np.isfinite(end):
                continue
            z[i] = end
        if towards != 0.0:
            hold(search, i, towards)
    if held[n] != _LESS:
        hold(search, n, 1.0)
    for r in range(len(C)):
        i = n + 1 + r
        marks[_STATE, i] = _LATER
        square = 0.0
        for j in range(n):
            square += C[r, j] ** 2
        length[i] = np.sqrt(square) if square > 0.0 else 1.0
        for j in range(n):
            G[i, j] = C[r, j] / length[i]
        ends[_LOWER, i] = low[r] / length[i]
        ends[_UPPER, i] = high[r] / length[i]
    for j in range(n + 1):
        search.largest[j] = abs(z[j])
    return search


@inlined
def _leave_behind(search: _Search, held: np.ndarray) -> None:
    """Write down which limits a search holds in the end: the side of each joint, and the share."""
    for i in range(search.n):
        held[i] = 0
        if search.marks[_STATE, i] in (_HELD, _FIXED):
            held[i] = search.marks[_SIDE, i]
    held[search.n] = _WHOLE if search.z[search.n] >= 1.0 else _LESS


# --- all levels -----------------------------------------------------------------------------------


@inlined
def _rows_of(level: int, groups: np.ndarray, tasks: np.ndarray, n: int) -> int:
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


@inlined
def _ask_for_task(
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


@part
def _ask_for_law(
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
    held: np.ndarray,
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
        held: (n + 1,) what the last search left behind, of which this one begins; zeros at first.
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
    search = _begin_at(dq_free, lower, upper, C, low, high, d, held)
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
        A = zeros(_rows_of(level, groups, tasks, n), d)
        a = np.zeros(len(A))
        if level < first_task:
            _open_slack(search, limit_row, A, n + 1)
        elif level == share:
            A[0, n] = 1.0  # s = 1
            a[0] = 1.0
        elif level == law:
            _ask_for_law(W, is_factor, dq_free, A, a)
        else:
            _ask_for_task(J, dx, task_row, level == first_task, A, a)
            task_row += len(A)
        force, tight, reached = minimise(search, A, a, level == law and len(W) == 0)
        solved = solved and reached
        if level == first_task:
            for i in range(len(A)):
                error += dot(A, i, z) ** 2
        if hardest < 0:
            hardest = _hardest_of(search, force, tight)
        if level < first_task:
            excess += _close_slack(search, limit_row, A, n + 1)
            limit_row += len(A)
            A = A[:0]
        if level < law:
            _fix_level(search, A, force, tight)

    _leave_behind(search, held)
    dq = np.zeros(n)
    total = error + excess + z[n]
    for i in range(n):
        total += a[i] + z[i]
    if not np.isfinite(total):  # as the input was
        for j in range(d):
            z[j] = 0.0
        for i in range(len(held)):
            held[i] = 0
        error = np.nan
        solved = False
    for i in range(n):
        dq[i] = min(max(z[i], lower[i]), upper[i])  # which changes it at rounding level
    s = min(max(z[n], 0.0), 1.0)
    side = search.marks[_SIDE, hardest] if hardest >= 0 else 0
    if hardest > n:
        hardest -= 1  # the share is no limit to others
    return dq, s, np.sqrt(error), np.sqrt(excess), hardest, side, solved
