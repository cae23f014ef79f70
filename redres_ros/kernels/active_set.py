"""Least squares in order of priority under limits, by an active-set search.

Each level minimises 1/2 |A z - a|^2 over what the levels before it have left, subject to
lower <= G z <= upper. A finished level leaves A z as it is, and fixes the limits that its
multipliers prove tight in every optimum. The method is a primal active-set method (Nocedal and
Wright, Numerical Optimization, 2006, Algorithm 16.3): z keeps every limit after every step.

The state of a search is in arrays of fixed size, which the functions change in place.

DAQP, a dual solver with the same levels, softens each one by a slack weight and a tolerance, which
leaves limits and tasks with errors near 1e-6; 1e-10 is asked here.
"""

from typing import NamedTuple

import numpy as np
from numba import boolean, float64, int64

from redres_ros.kernels.compiled import compiled, direct, inlined, matrix, part, several, vector

# The rows of Search.values: of a limit, and what a row of a level is to become.
_LOWER = 0
_UPPER = 1
_DESIRED = 2
_LENGTH = 3  # of a limit's row, before it became a unit vector
_LEAST = 4  # a row depends on the basis if less of it is orthogonal to that

# The rows of Search.marks.
_STATE = 0  # of each row, one of the four below
_SIDE = 1  # of each limit that is held, +1 for its upper end and -1 for its lower one
_BEHIND = 2  # the row behind row k of the basis
_COUNT = 3  # the three below

_BASIS = 0  # how many rows the basis has,
_BEYOND = 1  # and with those of the level behind it,
_VARIABLES = 2  # and how many elements of z are in use

_FREE = 0  # the state of a limit that z may come to,
_HELD = 1  # of one whose end z may not leave for now,
_FIXED = 2  # or for good, as a row of a finished level,
_LATER = 3  # and of a row that a later level brings in

_ROUNDING = 4e-15  # of a sum, beside the sizes of its terms

_MUCH = (
    0.5  # a row that keeps this fraction of its square is orthogonal to the others after one pass
)
_DEPENDENT = (
    1e-13  # a row is dependent if less than this fraction of it is orthogonal to the others
)

_RANK = 1e-11  # a row of a level is dependent below this fraction of the longest one

_MAX_STEPS = 200  # of one level; ten are many
_BY_INDEX = 60  # from this step on the lowest index decides, which cannot cycle (Bland)
_WRONG = 1e-14  # a force of the wrong sign counts from this fraction of the gradient's terms on
_TIGHT = 1e-10  # one of the right sign proves its limit tight from this fraction on

# The last element of what a search leaves behind for the next one.
_UNKNOWN = 0  # nothing: there was none
_WHOLE = 1  # the whole task was executed
_LESS = -1  # less of it


class _Search(NamedTuple):
    """A point, its limits, and the rows along which it may not move.

    In as few arrays as possible: of each one numba counts the references, wherever it is used.
    """

    z: np.ndarray  # (d,)
    p: np.ndarray  # (d,) its next step
    largest: np.ndarray  # (d,) that |z| has been; its rounding stays when z comes to zero
    rows: np.ndarray  # (K, d) of limits, of unit length; of tasks; of slack variables or the law
    values: np.ndarray  # (5, K), lower <= rows z <= upper for limits, what levels want of rows z
    Q: np.ndarray  # (d, d) orthonormal rows; behind the basis there are those of the level
    R: np.ndarray  # (d, d) lower triangular: row k of the basis is sum_j R[k, j] Q[j]
    marks: np.ndarray  # (4, K + 3) of int64
    n: int  # z = (dq, s, slack variables), where dq is (n,)


@inlined
def _dot(A: np.ndarray, i: int, x: np.ndarray, d: int) -> float:
    """The first d elements of row i of A (m, d) times those of x (d,)."""
    total = 0.0
    for j in range(d):
        total += A[i, j] * x[j]
    return total


@inlined
def _dot_rows(A: np.ndarray, i: int, B: np.ndarray, k: int, d: int) -> float:
    """As `_dot` with row k of B (r, d): a view of the row would take longer than the product."""
    total = 0.0
    for j in range(d):
        total += A[i, j] * B[k, j]
    return total


# --- orthonormal rows -----------------------------------------------------------------------------


@part
def _append(Q: np.ndarray, R: np.ndarray, k: int, rows: np.ndarray, i: int, d: int) -> float:
    """Row k of Q (m, d) becomes row i of others, made orthogonal to the rows before and a unit
    vector; the length of what is orthogonal to those.

    Row k of R (m, m) becomes what the row is in terms of Q, as far as its diagonal; d is the number
    of the elements that count.
    """
    for c in range(d):
        Q[k, c] = rows[i, c]
    for j in range(k):
        R[k, j] = 0.0
    before = _dot_rows(Q, k, Q, k, d)
    square = before
    for _ in range(2):  # Gram-Schmidt, and once more where rounding may have left something
        for j in range(k):
            along = _dot_rows(Q, j, Q, k, d)
            R[k, j] += along
            for c in range(d):
                Q[k, c] -= along * Q[j, c]
        square = _dot_rows(Q, k, Q, k, d)
        if square > _MUCH * before:
            break
    R[k, k] = np.sqrt(square)
    for c in range(d):
        Q[k, c] /= R[k, k]
    return float(R[k, k])


@part
def _substitute(R: np.ndarray, x: np.ndarray, m: int) -> None:
    """The first m elements of x become R'^-1 x, with as many rows of the lower triangular R."""
    for k in range(m - 1, -1, -1):
        for j in range(k + 1, m):
            x[k] -= R[j, k] * x[j]
        x[k] /= R[k, k]


# --- the basis: the rows along which the point of a search may not move, R Q with orthonormal Q ---


@part
def _build_basis(search: _Search) -> None:
    """The basis of the rows that are fixed, and then of the limits that are held.

    A held limit that those keep in its place already is set free.
    """
    rows = search.rows
    values = search.values
    Q = search.Q
    R = search.R
    marks = search.marks
    d = marks[_COUNT, _VARIABLES]
    count = 0
    for state in range(_FIXED, _FREE, -1):
        for i in range(len(rows)):
            if marks[_STATE, i] != state:
                continue
            if count < d and _append(Q, R, count, rows, i, d) > values[_LEAST, i]:
                marks[_BEHIND, count] = i
                count += 1
            elif state == _HELD:
                marks[_STATE, i] = _FREE
    marks[_COUNT, _BASIS] = count


@inlined
def _hold(search: _Search, i: int, towards: float) -> None:
    """Keep limit i at its upper end if towards > 0, else at its lower one.

    It stays free where the basis keeps it in its place already.
    """
    rows = search.rows
    Q = search.Q
    R = search.R
    marks = search.marks
    d = marks[_COUNT, _VARIABLES]
    k = marks[_COUNT, _BASIS]
    if k < d and _append(Q, R, k, rows, i, d) > search.values[_LEAST, i]:
        marks[_COUNT, _BASIS] = k + 1
        marks[_BEHIND, k] = i
        marks[_STATE, i] = _HELD
        marks[_SIDE, i] = 1 if towards > 0.0 else -1


# --- one step -------------------------------------------------------------------------------------


@part
def _step(search: _Search, begin: int, end: int) -> None:
    """p becomes the shortest step across the basis to the least |A (z + p) - a|.

    A are the rows of a level. Those that do not depend on the basis are added behind it.
    """
    z = search.z
    p = search.p
    rows = search.rows
    values = search.values
    Q = search.Q
    R = search.R
    marks = search.marks
    d = marks[_COUNT, _VARIABLES]
    count = marks[_COUNT, _BASIS]
    m = end - begin
    square = 0.0
    for i in range(begin, end):
        square = max(square, _dot_rows(rows, i, rows, i, d))
    rank = 0
    for i in range(begin, end):
        k = count + rank
        values[_LEAST, i] = _RANK * np.sqrt(square)
        if k < d and _append(Q, R, k, rows, i, d) > values[_LEAST, i]:
            marks[_BEHIND, k] = i
            rank += 1
    marks[_COUNT, _BEYOND] = count + rank
    # p = V' t with the orthonormal rows V from `count` on: |B t - rest| is least, B = A V'.
    space = np.zeros((2 * rank + 2, m))  # one array takes less time than four
    Y = space[:rank]  # B'
    U = space[rank : 2 * rank]
    rest = space[2 * rank]
    t = space[2 * rank + 1]
    for i in range(m):
        rest[i] = values[_DESIRED, begin + i] - _dot(rows, begin + i, z, d)
        for k in range(rank):
            Y[k, i] = _dot_rows(rows, begin + i, Q, count + k, d)
    for k in range(rank):
        _append(Y, U, k, Y, k, m)
        t[k] = _dot(Y, k, rest, m)
    _substitute(U, t, rank)
    for j in range(d):
        p[j] = 0.0
        for k in range(rank):
            p[j] += t[k] * Q[count + k, j]


@part
def _step_across(search: _Search, begin: int) -> None:
    """As `_step` for A = I, where p is what the basis leaves of a - dq."""
    p = search.p
    Q = search.Q
    d = search.marks[_COUNT, _VARIABLES]
    before = 0.0
    for j in range(d):
        p[j] = search.values[_DESIRED, begin + j] - search.z[j] if j < search.n else 0.0
        before += p[j] ** 2
    for _ in range(2):  # once more, for rounding
        for k in range(search.marks[_COUNT, _BASIS]):
            along = _dot(Q, k, p, d)
            for j in range(d):
                p[j] -= along * Q[k, j]
    after = 0.0
    for j in range(d):
        after += p[j] ** 2
    if after <= _DEPENDENT**2 * before:
        for j in range(d):
            p[j] = 0.0


# --- one level ------------------------------------------------------------------------------------


@inlined
def _minimise(
    search: _Search, begin: int, end: int, is_plain: bool, force: np.ndarray
) -> tuple[float, bool]:
    """Move z to the least |A z - a| of a level within the limits, with A = I where it is plain; the
    least force that proves a limit tight, and whether z got there.

    `force` (d,) receives the forces of the rows of the basis.
    """
    marks = search.marks
    for count in range(_MAX_STEPS):
        if is_plain:
            _step_across(search, begin)
        else:
            _step(search, begin, end)
        i, along = _advance(search)
        if marks[_STATE, i] == _FREE:
            _hold(search, i, along)
            continue
        largest = _fill_forces(search, begin, end, force)
        k = _most_wrong(search, force, _WRONG * largest, count > _BY_INDEX)
        if k < 0:
            return _TIGHT * largest, True
        marks[_STATE, marks[_BEHIND, k]] = _FREE
        _build_basis(search)
    marks[_COUNT, _BEYOND] = marks[_COUNT, _BASIS]
    return np.inf, False


@part
def _advance(search: _Search) -> tuple[int, float]:
    """Move z along p as far as the limits allow: the limit that stops it, -1 for none; and the
    speed along its row.
    """
    z = search.z
    p = search.p
    rows = search.rows
    values = search.values
    d = search.marks[_COUNT, _VARIABLES]
    largest = 0.0
    for j in range(d):
        largest = max(largest, abs(p[j]))
    fraction = 1.0
    first = -1
    along = 0.0
    for i in range(len(rows)):
        if search.marks[_STATE, i] != _FREE:
            continue
        slope = 0.0
        value = 0.0
        noise = largest
        for j in range(d):
            slope += rows[i, j] * p[j]
            value += rows[i, j] * z[j]
            noise += abs(rows[i, j] * z[j])
        margin = values[_UPPER, i] - value if slope > 0.0 else value - values[_LOWER, i]
        speed = abs(slope)
        if speed <= 10.0 * _DEPENDENT * largest or speed <= margin + _ROUNDING * noise:
            continue
        if fraction * speed > margin:
            fraction = max(margin, 0.0) / speed
            first = i
            along = slope
    for j in range(d):
        z[j] += fraction * p[j]
        search.largest[j] = max(search.largest[j], abs(z[j]))
    return first, along


@part
def _fill_forces(search: _Search, begin: int, end: int, force: np.ndarray) -> float:
    """Write how hard each row resists the descent: A' (A z - a) + sum_k force_k row_k = 0 at the
    least; the largest term of the gradient, beside which rounding is judged.
    """
    z = search.z
    rows = search.rows
    d = search.marks[_COUNT, _VARIABLES]
    g = search.p  # the step has been made
    for j in range(d):
        g[j] = 0.0
    fastest = 0.0
    for j in range(search.n):
        fastest = max(fastest, search.largest[j])
    largest = 0.0
    for i in range(begin, end):
        rest = -search.values[_DESIRED, i]
        size = abs(rest)
        for j in range(d):
            rest += rows[i, j] * z[j]
            # A slack variable is a difference of velocities.
            size += abs(rows[i, j]) * (fastest if j > search.n else search.largest[j])
        for j in range(d):
            g[j] += rows[i, j] * rest
            largest = max(largest, abs(rows[i, j]) * size)
    count = search.marks[_COUNT, _BASIS]
    for k in range(count):
        force[k] = -_dot(search.Q, k, g, d)
    _substitute(search.R, force, count)
    return largest


@part
def _most_wrong(search: _Search, force: np.ndarray, least: float, by_index: bool) -> int:
    """The row that keeps z from where it wants to go inside the limits, -1 for none.

    Of several it is the one with the largest force, or that of the first limit.
    """
    marks = search.marks
    found = -1
    for k in range(marks[_COUNT, _BASIS]):
        i = marks[_BEHIND, k]
        if marks[_STATE, i] != _HELD:
            continue
        pull = -force[k] * marks[_SIDE, i]
        if by_index and found >= 0 and i > marks[_BEHIND, found]:
            continue
        if pull > least:
            found = k
            if not by_index:
                least = pull
    return found


@part
def _fix_level(search: _Search, begin: int, end: int, force: np.ndarray, tight: float) -> int:
    """Fix the rows of a finished level, and the limits that are tight; others stay held.

    The result is the limit with the largest force of those that are tight, but that of s; -1: none.
    """
    marks = search.marks
    hardest = -1
    largest = tight
    for k in range(marks[_COUNT, _BASIS]):
        i = marks[_BEHIND, k]
        push = force[k] * marks[_SIDE, i]
        if marks[_STATE, i] != _HELD or push <= tight:
            continue
        marks[_STATE, i] = _FIXED
        if push > largest and i != search.n:
            largest = push
            hardest = i
    for i in range(begin, end):
        marks[_STATE, i] = _FIXED
    marks[_COUNT, _BASIS] = marks[_COUNT, _BEYOND]
    return hardest


# --- limits that are rows, in a level of their own ------------------------------------------------


@inlined
def _open_slack(search: _Search, begin: int, count: int, level: int) -> bool:
    """Bring in the limits from `begin` on, and whether z exceeds one of them.

    If so, lower <= rows z - w <= upper, where w are the variables of z from n + 1 on. The rows from
    `level` on then ask for the least |length w|.
    """
    z = search.z
    rows = search.rows
    marks = search.marks
    slack = search.n + 1
    is_exceeded = False
    for r in range(count):
        i = begin + r
        value = 0.0
        noise = 0.0
        for j in range(slack):
            value += rows[i, j] * z[j]
            noise += abs(rows[i, j] * z[j])
        above = value - search.values[_UPPER, i]
        below = search.values[_LOWER, i] - value
        marks[_STATE, i] = _FREE
        if max(above, below) > _ROUNDING * noise:
            z[slack + r] = above if above > below else -below
            marks[_STATE, i] = _HELD
            marks[_SIDE, i] = 1 if above > below else -1
            is_exceeded = True
    if is_exceeded:
        marks[_COUNT, _VARIABLES] = slack + count
        for r in range(count):
            rows[begin + r, slack + r] = -1.0
            rows[level + r, slack + r] = search.values[_LENGTH, begin + r]
        _build_basis(search)
    return is_exceeded


@inlined
def _close_slack(search: _Search, begin: int, count: int) -> float:
    """Move the ends of limits that remain in excess to where they are; the sum of squares of it."""
    z = search.z
    rows = search.rows
    values = search.values
    slack = search.n + 1
    search.marks[_COUNT, _VARIABLES] = slack
    square = 0.0
    for r in range(count):
        i = begin + r
        square += (search.values[_LENGTH, i] * z[slack + r]) ** 2
        z[slack + r] = 0.0
        rows[i, slack + r] = 0.0
        value = _dot(rows, i, z, slack)
        values[_UPPER, i] = max(values[_UPPER, i], value)
        values[_LOWER, i] = min(values[_LOWER, i], value)
    _build_basis(search)
    return square


# --- the start and the end of a search ------------------------------------------------------------


@inlined
def _begin_at(
    dq_free: np.ndarray,
    box: np.ndarray,
    C: np.ndarray,
    low: np.ndarray,
    high: np.ndarray,
    J: np.ndarray,
    dx: np.ndarray,
    first: int,
    most: int,
    held: np.ndarray,
) -> _Search:
    """A search that starts at the point of the box nearest to dq_free, with s = 1.

    It holds the limits that the last search held in the end: most often it is there after one step
    of each level. Without one, it holds those that dq_free does not keep. The start has no say in
    where the search ends, but for rounding.
    """
    n = len(dq_free)
    d = n + 1 + most
    limits = n + 1 + len(C)
    K = limits + len(J) + max(n, most)
    space = np.zeros((3 + K + 2 * d, d))  # one array takes less time than six
    search = _Search(
        space[0],
        space[1],
        space[2],
        space[3 : 3 + K],
        np.zeros((_LEAST + 1, K)),
        space[3 + K : 3 + K + d],
        space[3 + K + d :],
        np.full((_COUNT + 1, K + 3), _LATER),
        n,
    )
    z = search.z
    rows = search.rows
    values = search.values
    values[_LEAST] = _DEPENDENT
    marks = search.marks
    for i in range(n):
        rows[i, i] = 1.0
        lower = box[0, i]
        upper = box[1, i]
        values[_LOWER, i] = lower
        values[_UPPER, i] = upper
        z[i] = min(max(dq_free[i], lower), upper)
        towards = dq_free[i] - z[i]
        marks[_STATE, i] = _FREE
        if lower == upper:
            marks[_STATE, i] = _FIXED
        elif held[n] != _UNKNOWN:
            towards = float(held[i])
            end = upper if towards > 0.0 else lower
            if towards != 0.0 and np.isfinite(end):
                z[i] = end
                marks[_STATE, i] = _HELD
        elif towards != 0.0:
            marks[_STATE, i] = _HELD
        marks[_SIDE, i] = 1 if towards > 0.0 else -1
    z[n] = 1.0
    rows[n, n] = 1.0  # 0 <= s <= 1
    values[_UPPER, n] = 1.0
    values[_DESIRED, n] = 1.0
    marks[_STATE, n] = _FREE if held[n] == _LESS else _HELD
    marks[_SIDE, n] = 1
    for r in range(len(C)):
        i = n + 1 + r
        square = 0.0
        for j in range(n):
            square += C[r, j] ** 2
        values[_LENGTH, i] = np.sqrt(square) if square > 0.0 else 1.0
        for j in range(n):
            rows[i, j] = C[r, j] / values[_LENGTH, i]
        values[_LOWER, i] = low[r] / values[_LENGTH, i]
        values[_UPPER, i] = high[r] / values[_LENGTH, i]
    for r in range(len(J)):  # J dq - s dx = 0 of the first task, J dq = dx of others
        for j in range(n):
            rows[limits + r, j] = J[r, j]
        if r < first:
            rows[limits + r, n] = -dx[r]
        else:
            values[_DESIRED, limits + r] = dx[r]
    for j in range(n + 1):
        search.largest[j] = abs(z[j])
    marks[_COUNT, _VARIABLES] = n + 1
    _build_basis(search)
    return search


@part
def _remember(search: _Search, held: np.ndarray) -> None:
    """Write down which limits a search holds in the end: the side of each joint, and s."""
    for i in range(search.n):
        held[i] = 0
        if search.marks[_STATE, i] in (_HELD, _FIXED):
            held[i] = search.marks[_SIDE, i]
    held[search.n] = _WHOLE if search.z[search.n] >= 1.0 else _LESS


# --- all levels -----------------------------------------------------------------------------------


@part
def _desire_law(
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


@direct
@compiled(
    several(float64, float64, float64, int64, int64, boolean)(
        *(vector(), matrix(), boolean, matrix(), vector(), vector(int64)),
        *(matrix(), matrix(), vector(), vector(), vector(int64), int64[::1], float64[::1]),
    )
)
def hierarchical_qp(
    dq_free: np.ndarray,
    W: np.ndarray,
    is_factor: bool,
    J: np.ndarray,
    dx: np.ndarray,
    tasks: np.ndarray,
    box: np.ndarray,
    C: np.ndarray,
    low: np.ndarray,
    high: np.ndarray,
    groups: np.ndarray,
    held: np.ndarray,
    dq: np.ndarray,
) -> tuple[float, float, float, int, int, bool]:
    """Write the joint velocity nearest to dq_free (n,), in the norm of W (n, n), under limits and
    after tasks, in order of priority, into dq (n,).

    W may be the factor F of a weight F'F, and (0, 0) for the identity. J (m, n) and dx (m,) are the
    rows of all tasks, of which each has so many of `tasks` (k,); C (r, n), low and high (r,) those
    of the other limits, of which each of `groups` (g,) has a priority of its own; box (2, n) are
    the limits of dq. The search starts from what the last one left in `held` (n + 1,), at first
    zeros, and leaves there what the next one starts from.

    Returns:
        The scaling factor s of the first task; its error; the excess of the rows; the limit that
        resists hardest, the joints' first, then the rows', -1 for none; its side, +1 for the upper
        end; and whether each level got to its least.
    """
    n = len(dq_free)
    most = 0
    for rows in groups:
        most = max(most, rows)
    search = _begin_at(dq_free, box, C, low, high, J, dx, tasks[0], most, held)
    z = search.z
    first_task = len(groups)
    scaling = first_task + 1
    law = scaling + len(tasks)
    last = n + 1 + len(C) + len(J)  # the rows of the law, or of slack variables
    force = np.zeros(len(z))
    hardest = -1
    solved = True
    excess = 0.0
    error = 0.0
    following = n + 1  # the next limits, and then tasks
    for level in range(law + 1):
        if level < first_task:
            begin = last
            end = last + groups[level]
            limits = following
            following += groups[level]
            if not _open_slack(search, limits, groups[level], begin):
                continue
        elif level == scaling:
            begin = n  # s = 1
            end = n + 1
        elif level == law:
            begin = last
            end = last + n
            _desire_law(W, is_factor, dq_free, search.rows[begin:], search.values[_DESIRED, begin:])
        else:
            begin = following
            following += tasks[max(level - scaling, 0)]
            end = following
        tight, reached = _minimise(search, begin, end, level == law and len(W) == 0, force)
        solved = solved and reached
        if level == first_task:
            for i in range(begin, end):
                error += _dot(search.rows, i, z, n + 1) ** 2
        if level < first_task:
            end = begin  # its rows go with the slack variables
        found = _fix_level(search, begin, end, force, tight)
        if hardest < 0:
            hardest = found
        if level < first_task:
            excess += _close_slack(search, limits, groups[level])

    _remember(search, held)
    total = error + excess + z[n]
    for i in range(n):
        total += search.values[_DESIRED, last + i] + z[i]
    if not np.isfinite(total):  # as the input was
        z[:] = 0.0
        held[:] = 0
        error = np.nan
        solved = False
    for i in range(n):
        dq[i] = min(max(z[i], box[0, i]), box[1, i])  # which changes it at rounding level
    s = min(max(z[n], 0.0), 1.0)
    side = search.marks[_SIDE, hardest] if hardest >= 0 else 0
    if hardest > n:
        hardest -= 1  # s is no limit to others
    return s, np.sqrt(error), np.sqrt(excess), hardest, side, solved
