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
_FORCE = 5  # how hard row k of the basis resists the descent

# The rows of Search.marks.
_STATE = 0  # of each row, one of the four below
_SIDE = 1  # of each limit that is held, +1 for its upper end and -1 for its lower one
_BEHIND = 2  # the row behind row k of the basis
_COUNT = 3  # the six below

_BASIS = 0  # how many rows the basis has,
_BEYOND = 1  # and with those of the level behind it
_VARIABLES = 2  # how many elements of z are in use
_UNSOLVED = 3  # 1 if a level stopped before its least
_HARDEST = 4  # the limit that resists hardest, -1 for none,
_NAMED = 5  # among so many

_LATER = 0  # the state of a row that a later level brings in,
_FREE = 1  # of a limit that z may come to,
_HELD = 2  # of one whose end z may not leave for now,
_FIXED = 3  # or for good, as a row of a finished level

_ROUNDING = 4e-15  # of a sum, beside the sizes of its terms

# A row that keeps this fraction of its square is orthogonal to the others after one pass.
_MUCH = 0.5
_DEPENDENT = 1e-13  # a limit is dependent if less of its unit vector is orthogonal to the others,
_RANK = 1e-11  # and a row of a level below this fraction of the longest one

_MAX_STEPS = 200  # of one level; ten are many
_WRONG = 1e-14  # a force of the wrong sign counts from this fraction of the gradient's terms on
_TIGHT = 1e-10  # one of the right sign proves its limit tight from this fraction on


class _Search(NamedTuple):
    """A point, its limits, and the rows along which it may not move.

    In as few arrays as possible: of each one numba counts the references, wherever it is used.
    """

    z: np.ndarray  # (d,)
    p: np.ndarray  # (d,) its next step
    largest: np.ndarray  # (d,) that |z| has been; its rounding stays when z comes to zero
    rows: np.ndarray  # (K, d) of limits, of unit length; of tasks; of slack variables or the law
    values: np.ndarray  # (6, K), lower <= rows z <= upper for limits, what levels want of rows z
    Q: np.ndarray  # (d, d) orthonormal rows; behind the basis there are those of the level
    R: np.ndarray  # (d, d) lower triangular: row k of the basis is sum_j R[k, j] Q[j]
    marks: np.ndarray  # (4, K + 6) of int64
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
    marks = search.marks
    d = marks[_COUNT, _VARIABLES]
    k = marks[_COUNT, _BASIS]
    if k < d and _append(search.Q, search.R, k, search.rows, i, d) > search.values[_LEAST, i]:
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
        values[_LEAST, i] = _RANK * np.sqrt(square)
        k = count + rank
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
    """As `_step` for A = I, where p is what the basis leaves of a - dq: in a fifth of the time, and
    where many limits act, this step is made ten times a tick.
    """
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
        p[:] = 0.0


# --- one level ------------------------------------------------------------------------------------


@part
def _solve_level(search: _Search, begin: int, end: int, is_plain: bool) -> None:
    """Move z to the least |A z - a| of a level, rows A from `begin` to `end`, within the limits.

    These rows and the limits that are then tight in every optimum are fixed; others stay held. It
    is plain if A = I.
    """
    marks = search.marks
    tight = np.inf
    for _ in range(_MAX_STEPS):
        if is_plain:
            _step_across(search, begin)
        else:
            _step(search, begin, end)
        i, along = _advance(search)
        if marks[_STATE, i] == _FREE:
            _hold(search, i, along)
            continue
        largest = _fill_forces(search, begin, end)
        k = _most_wrong(search, _WRONG * largest)
        if k < 0:
            tight = _TIGHT * largest
            break
        marks[_STATE, marks[_BEHIND, k]] = _FREE
        _build_basis(search)
    else:
        marks[_COUNT, _UNSOLVED] = 1
        marks[_COUNT, _BEYOND] = marks[_COUNT, _BASIS]
    _fix_tight(search, tight)
    marks[_STATE, begin:end] = _FIXED
    marks[_COUNT, _BASIS] = marks[_COUNT, _BEYOND]


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
def _fill_forces(search: _Search, begin: int, end: int) -> float:
    """Write how hard each row resists the descent: A' (A z - a) + sum_k force_k row_k = 0 at the
    least; the largest term of the gradient, beside which rounding is judged.
    """
    z = search.z
    rows = search.rows
    d = search.marks[_COUNT, _VARIABLES]
    g = search.p  # the step has been made
    g[:] = 0.0
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
        search.values[_FORCE, k] = -_dot(search.Q, k, g, d)
    _substitute(search.R, search.values[_FORCE], count)
    return largest


@part
def _most_wrong(search: _Search, least: float) -> int:
    """The row of the basis that keeps z with the largest force from where it wants to go inside the
    limits, -1 for none.
    """
    marks = search.marks
    found = -1
    for k in range(marks[_COUNT, _BASIS]):
        i = marks[_BEHIND, k]
        pull = -search.values[_FORCE, k] * marks[_SIDE, i]
        if marks[_STATE, i] == _HELD and pull > least:
            found = k
            least = pull
    return found


@part
def _fix_tight(search: _Search, tight: float) -> None:
    """Fix the limits with a larger force than `tight`; note the hardest of the first level that has
    any, but for that of s.
    """
    marks = search.marks
    hardest = -1
    largest = tight
    for k in range(marks[_COUNT, _BASIS]):
        i = marks[_BEHIND, k]
        push = search.values[_FORCE, k] * marks[_SIDE, i]
        if marks[_STATE, i] != _HELD or push <= tight:
            continue
        marks[_STATE, i] = _FIXED
        if push > largest and i != search.n and i < marks[_COUNT, _NAMED]:
            largest = push
            hardest = i
    if marks[_COUNT, _HARDEST] < 0:
        marks[_COUNT, _HARDEST] = hardest


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
def _close_slack(search: _Search, begin: int, count: int, level: int) -> float:
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
        search.marks[_STATE, level + r] = _LATER
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
        np.zeros((_FORCE + 1, K)),
        space[3 + K : 3 + K + d],
        space[3 + K + d :],
        np.zeros((_COUNT + 1, K + _NAMED + 1), np.int64),
        n,
    )
    z = search.z
    rows = search.rows
    values = search.values
    values[_LEAST] = _DEPENDENT
    marks = search.marks
    for i in range(n):
        lower = box[0, i]
        upper = box[1, i]
        z[i] = min(max(dq_free[i], lower), upper)
        side = held[i] if held[n] != 0 else np.sign(dq_free[i] - z[i])
        end = upper if side > 0 else lower
        rows[i, i] = 1.0
        values[_LOWER, i] = lower
        values[_UPPER, i] = upper
        marks[_SIDE, i] = side
        marks[_STATE, i] = _FREE
        if lower == upper:
            marks[_STATE, i] = _FIXED
        elif side != 0 and np.isfinite(end):
            z[i] = end
            marks[_STATE, i] = _HELD
    z[n] = 1.0
    rows[n, n] = 1.0  # 0 <= s <= 1
    values[_UPPER, n] = 1.0
    values[_DESIRED, n] = 1.0
    marks[_STATE, n] = _FREE if held[n] < 0 else _HELD
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
    marks[_COUNT, _HARDEST] = -1
    _build_basis(search)
    return search


# --- all levels -----------------------------------------------------------------------------------


@direct
@compiled(
    several(float64, float64, float64, int64, int64, boolean)(
        *(vector(), matrix(), matrix(), vector(), vector(int64)),
        *(matrix(), matrix(), vector(), vector(), vector(int64), int64, int64[::1], float64[::1]),
    )
)
def hierarchical_qp(
    dq_free: np.ndarray,
    F: np.ndarray,
    J: np.ndarray,
    dx: np.ndarray,
    tasks: np.ndarray,
    box: np.ndarray,
    C: np.ndarray,
    low: np.ndarray,
    high: np.ndarray,
    groups: np.ndarray,
    named: int,
    held: np.ndarray,
    dq: np.ndarray,
) -> tuple[float, float, float, int, int, bool]:
    """Write the joint velocity nearest to dq_free (n,), in the norm of W = F'F, under limits and
    after tasks, in order of priority, into dq (n,).

    F is (n, n), or (0, 0) for the identity. J (m, n) and dx (m,) are the rows of all tasks, of
    which each has so many of `tasks` (k,); C (r, n), low and high (r,) those of the other limits,
    of which each of `groups` (g,) has a priority of its own; box (2, n) are the limits of dq. The
    search starts from what the last one left in `held` (n + 1,), at first zeros, and leaves there
    what the next one starts from: the side of each joint that is held, and 1 for s = 1, else -1.

    Returns:
        The scaling factor s of the first task; its error; the excess of the rows; the limit that
        resists hardest, the joints' first, then the first `named` rows', -1 for none; its side, +1
        for the upper end; and whether each level got to its least.
    """
    n = len(dq_free)
    most = 0
    for count in groups:
        most = max(most, count)
    search = _begin_at(dq_free, box, C, low, high, J, dx, tasks[0], most, held)
    search.marks[_COUNT, _NAMED] = n + 1 + named
    z = search.z
    rows = search.rows
    marks = search.marks
    last = n + 1 + len(C) + len(J)  # the rows of the law, or of slack variables
    begin = n + 1
    excess = 0.0
    for count in groups:
        if _open_slack(search, begin, count, last):
            _solve_level(search, last, last + count, False)
            excess += _close_slack(search, begin, count, last)
        begin += count
    error = 0.0
    for k, count in enumerate(tasks):
        _solve_level(search, begin, begin + count, False)
        if k == 0:
            for i in range(begin, begin + count):
                error += _dot(rows, i, z, n + 1) ** 2
            _solve_level(search, n, n + 1, False)  # s = 1
        begin += count
    for i in range(n):
        for j in range(n):
            rows[last + i, j] = F[i, j] if len(F) else rows[i, j]
            search.values[_DESIRED, last + i] += rows[last + i, j] * dq_free[j]
    _solve_level(search, last, last + n, len(F) == 0)

    total = error + excess + z[n]
    for i in range(n):
        total += search.values[_DESIRED, last + i] + z[i]
    solved = marks[_COUNT, _UNSOLVED] == 0
    if not np.isfinite(total):  # as the input was
        z[:] = 0.0
        error = np.nan
        solved = False
    for i in range(n):
        is_held = solved and marks[_STATE, i] in (_HELD, _FIXED)
        held[i] = marks[_SIDE, i] if is_held else 0
        dq[i] = min(max(z[i], box[0, i]), box[1, i])  # which changes it at rounding level
    s = min(max(z[n], 0.0), 1.0)
    held[n] = 1 if s == 1.0 else -1
    hardest = marks[_COUNT, _HARDEST]
    side = marks[_SIDE, hardest] if hardest >= 0 else 0
    if hardest > n:
        hardest -= 1  # s is no limit to others
    return s, np.sqrt(error), np.sqrt(excess), hardest, side, solved
