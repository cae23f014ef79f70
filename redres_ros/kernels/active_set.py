"""Least squares in order of priority under limits, by an active-set search.

Each level minimises 1/2 |A z - a|^2 over what the levels before it have left, subject to
lower <= G z <= upper. A finished level leaves A z as it is, and fixes the limits that its
multipliers prove tight in every optimum. The method is a primal active-set method (Nocedal and
Wright, Numerical Optimization, 2006, Algorithm 16.3): z keeps every limit after every step.

The state of a search is in arrays of fixed size, which the functions change in place.

DAQP, a dual solver with the same levels, softens each one by a slack weight and a tolerance, which
leaves limits and tasks with errors near 1e-6; 1e-10 is asked here.
"""

from typing import Any, NamedTuple

import numpy as np
from numba import boolean, float64, int64, types

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

_MUCH = 0.5  # of its square; a row that keeps it is orthogonal to the others after one pass
_DEPENDENT = 1e-13  # a limit is dependent if less of its unit vector is orthogonal to the others,
_RANK = 1e-11  # and a row of a level below this fraction of the longest one

# Components that are scaled, limits/component_scaling.py
DIRECTION_TOLERANCE = float(np.radians(10.0))  # [rad] of what is left of a component
_SLIDING_TOLERANCE = float(np.radians(85.0))  # [rad], if it leaves nothing
SPREAD = 0.7  # [rad/s] by which a component that gives way may differ from its velocity
RADIUS = 0.25  # [m] at which a turn counts as a speed
_LEAD = 4.0  # by which another component must be larger to take over from the one that goes on
_CREEP = 0.05, 0.02  # of its velocity the leading one, of its spread the other one
_NOTHING = 1e-9  # of dx; a component with less is not asked for

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


@part
def _copy(values: np.ndarray, row: np.ndarray) -> None:
    """Begin a row with these values. With row[:n] = values numba compiles texts of errors, too."""
    for j in range(len(values)):
        row[j] = values[j]


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

    Row k of R (m, m) becomes the row in terms of Q, up to its diagonal; d elements of a row count.
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

    These rows and the limits tight in every optimum are fixed; others stay held. A = I is plain.
    """
    marks = search.marks
    fixed = 0
    for k in range(marks[_COUNT, _BASIS]):
        fixed += marks[_STATE, marks[_BEHIND, k]] == _FIXED
    if fixed == marks[_COUNT, _VARIABLES]:  # nothing can move
        marks[_STATE, begin:end] = _FIXED
        return
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
    """Move z along p as far as limits allow: the limit that stops it, or -1; the speed along it."""
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
    """The row of the basis with the largest force against a descent inside the limits, or -1."""
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
    """Fix limits with a larger force than `tight`; note the hardest of the first level with any."""
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


@part
def _beyond(search: _Search, i: int, z: np.ndarray) -> float:
    """How far z is above limit i, negative below it; 0 if that may be rounding."""
    value = 0.0
    noise = 0.0
    for j in range(search.n + 1):
        value += search.rows[i, j] * z[j]
        noise += abs(search.rows[i, j] * z[j])
    above = value - search.values[_UPPER, i]
    below = search.values[_LOWER, i] - value
    if not max(above, below) > _ROUNDING * noise:
        return 0.0
    return above if above > below else -below


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
        beyond = _beyond(search, i, z)
        marks[_STATE, i] = _FREE
        if beyond != 0.0:
            z[slack + r] = beyond
            marks[_STATE, i] = _HELD
            marks[_SIDE, i] = 1 if beyond > 0.0 else -1
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
        if values[_LOWER, i] == values[_UPPER, i]:
            search.marks[_STATE, i] = _FIXED
    _build_basis(search)
    return square


# --- the start and the end of a search ------------------------------------------------------------


@inlined
def _begin_at(problem: tuple[Any, ...], most: int, own: int, held: np.ndarray) -> _Search:
    """A search that starts at the point of the box nearest to dq_free, with s = 1.

    It holds the limits that the last search held in the end: most often it is there after one step
    of each level. Without one, it holds those that dq_free does not keep. The start has no say in
    where the search ends, but for rounding. If components have limits of their own, so many, the
    rows of the first task are left to `_enter`.
    """
    dq_free, _, J, dx, tasks, box, C, low, high, _ = problem
    n = len(dq_free)
    d = n + 1 + most
    limits = n + 1 + len(C) + own
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
    if own:
        marks[_STATE, n] = _FIXED
    marks[_SIDE, n] = 1
    for r in range(len(C)):
        _copy(C[r], rows[n + 1 + r])
        _limit(search, n + 1 + r, low[r], high[r])
    for r in range(tasks[0] if own else 0, len(J)):
        _copy(J[r], rows[limits + r])
        if r < tasks[0]:  # J dq - s dx = 0 of the first task, J dq = dx of others
            rows[limits + r, n] = -dx[r]
        else:
            values[_DESIRED, limits + r] = dx[r]
    for j in range(n + 1):
        search.largest[j] = abs(z[j])
    marks[_COUNT, _VARIABLES] = n + 1
    marks[_COUNT, _HARDEST] = -1
    marks[_COUNT, _NAMED] = n + 1 + len(C)
    _build_basis(search)
    return search


@part
def _limit(search: _Search, i: int, low: float, high: float) -> None:
    """Row i becomes a limit, low <= row z <= high, of unit length."""
    square = 0.0
    for j in range(search.n):
        square += search.rows[i, j] ** 2
    length = np.sqrt(square) if square > 0.0 else 1.0
    for j in range(search.n):
        search.rows[i, j] /= length
    search.values[_LENGTH, i] = length
    search.values[_LOWER, i] = low / length
    search.values[_UPPER, i] = high / length


# --- components with scaling factors of their own: limits/component_scaling.py --------------------


class Parts(NamedTuple):
    """A first task whose components are scaled, and how."""

    sizes: np.ndarray  # (c,) rows of each component
    dq_prev: np.ndarray  # (n,)
    velocity: np.ndarray  # (m,) of a correction, like the next two
    is_held: np.ndarray  # (m,)
    away: np.ndarray  # (m,)
    scale: np.ndarray  # (m,) of the rows
    executed: np.ndarray  # (c + 1,), written: of each, and of what the leading one may have
    weight: float  # how far components yield,
    sliding: float  # and slide
    s: float  # of the whole; NaN: it is searched for, if all components or none are asked for


_NO = np.zeros(0)
WHOLE = Parts(_NO.astype(np.int64), _NO, _NO, _NO.astype(bool), _NO, _NO, _NO, 0.0, 0.0, np.nan)


class _Components(NamedTuple):
    """Those of the first task."""

    sizes: np.ndarray  # (k,) rows of each
    rates: np.ndarray  # (m, n) of the tip along each one's velocity, and in the directions across
    speeds: np.ndarray  # (k,) the length of each one's velocity,
    asked: np.ndarray  # (k,) and that which is asked for, or 0


@inlined
def _split(components: _Components, problem: tuple[Any, ...], parts: Parts) -> int:
    """Write the components, with rates by a Householder reflection of J; the one that leads."""
    _, _, J, dx, _, _, _, _, _, _ = problem
    sizes, rates, _, _ = components
    for r in range(len(rates)):
        _copy(J[r], rates[r])
    noise = _NOTHING * np.sqrt(np.sum(dx[: len(rates)] ** 2))
    leading = 0
    most = 0.0
    for c, size in enumerate(sizes):
        begin = sizes[:c].sum()
        end = begin + size
        velocity = dx[begin:end].copy()
        if parts.is_held[begin]:
            velocity = parts.scale[begin] * parts.velocity[begin:end]
        speed = np.sqrt(np.sum(velocity**2))
        if speed > 0.0:
            velocity /= speed
            sign = np.copysign(1.0, velocity[0])
            velocity[0] += sign
            for j in range(rates.shape[1]):
                along = 0.0
                for i in range(size):
                    along += velocity[i] * rates[begin + i, j] / abs(velocity[0])
                for i in range(size):
                    rates[begin + i, j] = sign * (along * velocity[i] - rates[begin + i, j])
        components.speeds[c] = speed
        components.asked[c] = speed if speed > noise and not parts.is_held[begin] else 0.0
        # What goes on already counts more.
        lead = (1.0 + (_LEAD - 1.0) * _executed(components, c, parts.dq_prev)) * components.asked[c]
        if lead > most:
            leading = c
            most = lead
    return leading


@part
def _executed(components: _Components, c: int, dq: np.ndarray) -> float:
    """The fraction of a component that is executed; 1 if it is not asked for."""
    if components.asked[c] == 0.0:
        return 1.0
    along = _dot(components.rates, components.sizes[:c].sum(), dq, len(dq))
    return min(max(along / components.asked[c], 0.0), 1.0)


@inlined
def _enter(search: _Search, components: _Components, leading: int, parts: Parts) -> float:
    """Write the limits of components and the rows of their levels, where no component that is
    asked for has less than the factor s; the largest factor of the leading one.
    """
    sizes, rates, speeds, asked = components
    rows = search.rows
    desired = search.values[_DESIRED]
    stuck = parts.weight * parts.sliding
    size = sizes[leading]
    first = sizes[:leading].sum()  # the row of the leading one
    tolerance = DIRECTION_TOLERANCE + parts.sliding * (_SLIDING_TOLERANCE - DIRECTION_TOLERANCE)
    most = np.cos(tolerance) / np.cos(DIRECTION_TOLERANCE)  # no faster with what goes across
    least = 0.0 if np.isnan(parts.s) else parts.s
    i = search.marks[_COUNT, _NAMED]
    level = i + len(rates) + size - 1
    _copy(rates[first], rows[level])
    desired[level] = most * speeds[leading]
    for c in range(len(sizes)):
        if c == leading:
            continue
        row = sizes[:c].sum()
        spread = SPREAD * parts.scale[row] * (RADIUS if c == 0 else 1.0)
        wide = parts.weight * spread / np.sqrt(float(sizes[c]))  # a cube
        lowest = min(speeds[c] - wide, least * asked[c])
        if parts.weight > 0.0 and parts.is_held[row]:
            lowest = max(lowest, -parts.scale[row] * parts.away[row])
        if stuck > 0.0:
            lowest = min(lowest, -_CREEP[1] * stuck * spread)
        for r in range(sizes[c]):
            level += 1
            _copy(rates[row + r], rows[i])
            _copy(rates[row + r], rows[level])
            desired[level] = speeds[c] if r == 0 else 0.0
            _limit(search, i, lowest if r == 0 else -wide, desired[level] + wide)
            i += 1
    creep = _CREEP[0] * stuck * speeds[leading]
    _copy(rates[first], rows[i])
    _limit(search, i, least * speeds[leading] - creep, most * speeds[leading])
    slope = np.tan(tolerance) / np.sqrt(max(size - 1.0, 1.0))
    for r in range(1, size):  # a pyramid
        _copy(rates[first + r], rows[level + r])
        for side in (1.0, -1.0):
            i += 1
            _copy(side * rates[first + r] - slope * rates[first], rows[i])
            _limit(search, i, -np.inf, creep)
    return most


@inlined
def _resume(search: _Search, end: int, held: np.ndarray, dq: np.ndarray) -> None:
    """Move z near dq, to where all that the last search held is at its end, if that keeps all
    limits up to `end`.
    """
    p = search.p
    values = search.values
    marks = search.marks
    d = search.n + 1
    begin = marks[_COUNT, _NAMED]
    _copy(search.z, p)
    for i in range(search.n):
        if marks[_STATE, i] == _FREE:
            p[i] = min(max(dq[i], values[_LOWER, i]), values[_UPPER, i])
    for i in range(begin, end):
        side = held[d + i - begin] if d + i - begin < len(held) else 0
        if values[_LOWER, i] == values[_UPPER, i]:
            marks[_STATE, i] = _FIXED
        elif side != 0 and np.isfinite(values[_UPPER if side > 0 else _LOWER, i]):
            marks[_STATE, i] = _HELD
            marks[_SIDE, i] = side
    _build_basis(search)
    for k in range(marks[_COUNT, _BASIS]):
        i = marks[_BEHIND, k]
        bound = values[_UPPER if marks[_SIDE, i] > 0 else _LOWER, i]
        along = (bound - _dot(search.rows, i, p, d)) / search.R[k, k]
        for j in range(d):
            p[j] += along * search.Q[k, j]
    is_inside = True
    for i in range(end):
        is_inside = is_inside and _beyond(search, i, p) == 0.0
    for i in range(d, end):
        if not is_inside or marks[_STATE, i] == _LATER:
            marks[_STATE, i] = _FREE if is_inside else _LATER
    if is_inside:
        _copy(p, search.z)
    else:
        _build_basis(search)


# --- all levels -----------------------------------------------------------------------------------


@direct
@compiled(
    several(float64, float64, float64, int64, int64, boolean)(
        several(
            *(vector(), matrix(), matrix(), vector(), vector(int64)),
            *(matrix(), matrix(), vector(), vector(), vector(int64)),
        ),
        *(int64[::1], float64[::1]),
        types.NamedTuple(  # type: ignore[no-untyped-call]
            (
                *(vector(int64), vector(), vector(), vector(boolean), vector(), vector()),
                *(float64[::1], float64, float64, float64),
            ),
            Parts,
        ),
    )
)
def hierarchical_qp(
    problem: tuple[Any, ...], held: np.ndarray, dq: np.ndarray, parts: Parts
) -> tuple[float, float, float, int, int, bool]:
    """Write the joint velocity nearest to dq_free (n,), in the norm of W = F'F, under limits and
    after tasks, in order of priority, into dq (n,).

    The problem is dq_free, F, J, dx, tasks, box, C, low, high and groups. F is (n, n), or (0, 0)
    for the identity. J (m, n) and dx (m,) are the rows of all tasks, of which each has so many of
    `tasks` (k,); C (r, n), low and high (r,) those of the other limits, of which each of `groups`
    (g,) has a priority of its own; box (2, n) are the limits of dq. A search starts from what the
    last one left in `held` (n + 1,), at first zeros: sides of held joints, and 1 for s = 1 or -1.

    If the whole is searched for, parts.executed ends with the number of components asked for. Else
    `held` goes on with the joints of this search, and the limits of components.

    Returns the scaling factor s of the first task; its error; the excess of the rows; the limit
    that resists hardest, the joints' first, then the rows', -1 for none; its side, +1 for the upper
    end; and whether each level got to its least.
    """
    dq_free, F, _, _, tasks, box, C, _, _, groups = problem
    sizes = parts.sizes
    n = len(dq)
    k = len(sizes)
    components = _Components(sizes, np.empty((sizes.sum(), n)), np.empty(k), np.empty(k))
    leading = _split(components, problem, parts) if k else 0
    asked = np.count_nonzero(components.asked)
    own = 0
    groups = groups.copy()
    tasks = tasks.copy()
    if not np.isnan(parts.s) or 0 < asked < k:
        size = sizes[leading]
        own = sizes.sum() + size - 1
        following = np.delete(sizes, leading)
        groups = np.concatenate((groups, following, np.array([2 * size - 1])))
        tasks = np.concatenate((np.array([1]), following, np.array([size - 1]), tasks[1:]))
    held = held[n + 1 :] if own else held[: n + 1]
    most = groups.max() if len(groups) else 0
    limits = n + 1 + len(C) + own
    search = _begin_at(problem, most, own, held)
    fraction = 1.0
    if own:
        fraction = _enter(search, components, leading, parts)
        _resume(search, limits, held, parts.dq_prev)
    z = search.z
    rows = search.rows
    marks = search.marks
    last = len(rows) - max(n, most)  # the rows of the law, or of slack variables
    begin = n + 1
    excess = 0.0
    for count in groups:
        if marks[_STATE, begin] == _LATER and _open_slack(search, begin, count, last):
            _solve_level(search, last, last + count, False)
            excess += _close_slack(search, begin, count, last)
        begin += count
    error = 0.0
    for t, count in enumerate(tasks):
        _solve_level(search, begin, begin + count, False)
        if t == 0 and own == 0:
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
        dq[i] = min(max(z[i], box[0, i]), box[1, i])  # which changes it at rounding level
    for r in range(len(held)):
        i = r if r <= n else r + len(C)
        is_held = solved and i < limits and marks[_STATE, i] in (_HELD, _FIXED)
        held[r] = marks[_SIDE, i] if is_held else 0
    s = min(max(z[n], 0.0), 1.0)
    held[n] = 1 if s == 1.0 else -1
    for c in range(k):
        parts.executed[c] = _executed(components, c, dq) if own else np.nan
        parts.executed[k] = parts.executed[leading] / fraction if own else asked
    hardest = marks[_COUNT, _HARDEST]
    side = marks[_SIDE, hardest] if hardest >= 0 else 0
    if hardest > n:
        hardest -= 1  # s is no limit to others
    return s, np.sqrt(error), np.sqrt(excess), hardest, side, solved
