"""The best motion along a path to come: a linearisation and a recursion of dynamic programming.

Over K + 1 steps, the first of T and the others of h, from q_{i+1} = q_i + h_i u_i,

    minimise  sum_i 1/2 (u_i - u_{i-1})' R_i (u_i - u_{i-1}) / t_i + r_i' (u_i - u_{i-1})
              + 1/2 k u_K' u_K + sum_j 1/2 rho |f(q_j) - x_j|^2 + 1/2 w |range excess of q_j|^2

with t_0 = T, t_i the mean of two neighbouring steps, and the nodes q_j = q_{i+1} of all steps but
the first, whose end J u_0 = dx decides. f is linearised at the nodes of the last plan, from which
a trust mu keeps the new ones. The cost to go is quadratic in (q, v), V = 1/2 s'P s + g's. A step
back with E = [h I; I] completes the square in u:

    Q = R/t + E'PE = L L',   Y = L^-1 [E'P [I; 0], -R/t, E'g + r],   u = -L'^-1 Y [q; v; 1]
    [P, g] <- [diag(P_qq, R/t), [g_q; -r]] - [Y_q, Y_v]' Y

so that for the first step 1/2 |u - v|^2_R / T + r'(u - v) + V(q + T u, u) is a law's W and b.

Matrices S = [P, g] and Y have w >= 2 n + 1 columns, a multiple of 16, of which the last are zero:
loops over as many are what processors do at once. So have the rows of a linearisation [A, 0, -c],
which stand for 1/2 rho |A q - c|^2.

A chain of k joints is `turns` (k + 1, 3, 3) and `offsets` (k + 1, 3), from each joint's frame to
the next, the last to the tip, then `joints` (k,), their indices, and `slides` (k,): each turns
about, or slides along, the z axis of its frame.
"""

import numpy as np
from numba import boolean, float64, int64, void

from redres_ros.kernels.compiled import compiled, direct, inlined, part, several, vector

_RHO = 5e5  # [1/(m^2 s^3)] weight of errors, beside squares of accelerations over time
_STIFFNESS = 1e4  # of the excess of ranges
_LONGEST = 0.1  # [m] error that counts at once: a linearisation holds no farther
_LEVER = 1.0  # [m] on which an angle counts by its arc
_LEAST_TRUST = 3.0
_MOST_TRUST = 1e5
_FASTER = 1.5  # by which the trust falls with each plan that is accepted
_SLOWER = 4.0  # by which it rises with one that is not
# A plan is stuck whose trust has risen so far, or an error [m]: another branch may be better
_STUCK = 100.0
_OFF = 5e-3
_RISE = 1e-3  # of the merit that is taken for that of the time that has come into sight
_ROUNDING = 1e-6  # of a merit
_GUESSES = 2  # iterations of the first guess at each node
_SINGULAR = 1e-4  # [m^2] its damping near singularities
_WARM = 5  # iterations from it, before the first plan is used

# The best motion along a whole path
_ON_PATH = 1e-6  # [m^2] damping of steps towards the path
_MOST_ITERATIONS = 80
_STALLED = 1e-5  # relative improvement that counts as none
_NEAR_HALF_A_TURN = 3.13  # [rad]; no axis is known beyond it, and the turn counts as none

_BLOCK = 16  # columns

_VECTOR = float64[::1]
_MATRIX = float64[:, ::1]
_ARRAY = float64[:, :, ::1]

# What a motion is planned within: T, h, damping, and the lower and upper ends of ranges, (n,).
_Problem = tuple[float, float, float, np.ndarray, np.ndarray]
_PROBLEM = several(float64, float64, float64, vector(), vector())
_CHAIN = several(_ARRAY, _MATRIX, int64[::1], boolean[::1])


def width(n: int) -> int:
    """w, for n joints."""
    return (2 * n // _BLOCK + 1) * _BLOCK


_width = part(width)


@part
def _place(
    q: np.ndarray, chain: tuple[np.ndarray, ...], J: np.ndarray, x: np.ndarray, R: np.ndarray
) -> None:
    """Write the tip's Jacobian (6, n) or nothing, position (3,) and orientation (3, 3)."""
    turns, offsets, joints, slides = chain
    origins = np.empty((len(joints), 3))
    axes = np.empty((len(joints), 3))
    for i in range(3):
        x[i] = offsets[0, i]
        for k in range(3):
            R[i, k] = turns[0, i, k]
    for j in range(len(joints)):
        value = q[joints[j]]
        sine = np.sin(value)
        cosine = np.cos(value)
        turn = turns[j + 1]
        offset = offsets[j + 1]
        for i in range(3):
            a = R[i, 0]
            b = R[i, 1]
            c = R[i, 2]
            origins[j, i] = x[i]
            axes[j, i] = c
            if slides[j]:
                x[i] += value * c
            else:
                a = cosine * R[i, 0] + sine * b
                b = cosine * b - sine * R[i, 0]
            x[i] += a * offset[0] + b * offset[1] + c * offset[2]
            for k in range(3):
                R[i, k] = a * turn[0, k] + b * turn[1, k] + c * turn[2, k]
    if not len(J):
        return
    for j in range(len(joints)):
        column = joints[j]
        axis = axes[j]
        origin = origins[j]
        for i in range(3):
            J[i, column] = axis[i]
            J[3 + i, column] = 0.0 if slides[j] else axis[i]
        if not slides[j]:
            J[0, column] = axis[1] * (x[2] - origin[2]) - axis[2] * (x[1] - origin[1])
            J[1, column] = axis[2] * (x[0] - origin[0]) - axis[0] * (x[2] - origin[2])
            J[2, column] = axis[0] * (x[1] - origin[1]) - axis[1] * (x[0] - origin[0])


@inlined
def _turn(R: np.ndarray, R_d: np.ndarray, w: np.ndarray) -> None:
    """Write the rotation vector from R to R_d into w[3:]."""
    w[3:] = 0.0
    trace = 0.0
    for j in range(3):
        w[3] += (R[1, j] * R_d[2, j] - R[2, j] * R_d[1, j]) / 2.0
        w[4] += (R[2, j] * R_d[0, j] - R[0, j] * R_d[2, j]) / 2.0
        w[5] += (R[0, j] * R_d[1, j] - R[1, j] * R_d[0, j]) / 2.0
        trace += R[0, j] * R_d[0, j] + R[1, j] * R_d[1, j] + R[2, j] * R_d[2, j]
    sine = np.sqrt(w[3] * w[3] + w[4] * w[4] + w[5] * w[5])
    angle = np.arctan2(sine, (trace - 1.0) / 2.0)
    if angle > _NEAR_HALF_A_TURN:
        w[3:] = 0.0
    elif sine > 0.0:
        w[3:] *= angle / sine


@part
def _linearise(
    nodes: np.ndarray,
    path: tuple[np.ndarray, np.ndarray],
    chain: tuple[np.ndarray, ...],
    A: np.ndarray,
    e: np.ndarray,
) -> None:
    """Write the rows A (K, m, w), unless that is empty, and the error e (K, m), x_d - x, at each
    node; an angle counts by its arc, and an error at most by _LONGEST.
    """
    X, turned = path
    n = nodes.shape[1]
    m = e.shape[1]
    J = np.zeros((6 if len(A) else 0, n))
    x = np.empty(3)
    R = np.empty((3, 3))
    error = np.zeros(6)
    for j in range(len(nodes)):
        _place(nodes[j], chain, J, x, R)
        for i in range(3):
            error[i] = X[j, i] - x[i]
        if m > 3:
            _turn(R, turned[j], error)
            error[3:] *= _LEVER
        for half in range(0, m, 3):
            square = 0.0
            for i in range(half, half + 3):
                square += error[i] * error[i]
            shorter = min(_LONGEST / max(np.sqrt(square), 1e-300), 1.0)
            for i in range(half, half + 3):
                e[j, i] = shorter * error[i]
        for i in range(m if len(A) else 0):
            row = A[j, i]
            c = e[j, i]
            for k in range(n):
                row[k] = J[i, k] if i < 3 else _LEVER * J[i, k]
                c += row[k] * nodes[j, k]
            row[n:] = 0.0
            row[2 * n] = -c


@part
def _merit(
    q: np.ndarray, v: np.ndarray, nodes: np.ndarray, e: np.ndarray, problem: _Problem
) -> float:
    """The cost of nodes after a first step at the velocity v."""
    T, h, damping, lower, upper = problem
    n = len(q)
    K = len(nodes)
    total = 0.0
    u_prev = v.copy()
    last = q + T * v
    for j in range(K):
        t = (h + T) / 2.0 if j == 0 else h
        for i in range(n):
            u = (nodes[j, i] - last[i]) / h
            total += (u - u_prev[i]) ** 2 / t
            excess = max(nodes[j, i] - upper[i], lower[i] - nodes[j, i], 0.0)
            total += _STIFFNESS * excess * excess
            last[i] = nodes[j, i]
            u_prev[i] = u
        for i in range(e.shape[1]):
            total += _RHO * e[j, i] * e[j, i]
    for i in range(n):
        total += damping * u_prev[i] * u_prev[i]
    return total / 2.0


@part
def _solve(Q: np.ndarray, x: np.ndarray) -> None:
    """Turn x (n,) into Q^-1 x for a positive definite Q (n, n), which becomes its factor L."""
    for k in range(len(x)):
        for d in range(k + 1):
            c = Q[k, d]
            for i in range(d):
                c -= Q[k, i] * Q[d, i]
            Q[k, d] = np.sqrt(c) if k == d else c / Q[d, d]
        for i in range(k):
            x[k] -= Q[k, i] * x[i]
        x[k] /= Q[k, k]
    _solve_transposed(Q, x)


@inlined
def _solve_transposed(L: np.ndarray, x: np.ndarray) -> None:
    """Turn x (n,) into L'^-1 x for a lower triangular L (n, n)."""
    n = len(x)
    for k in range(n - 1, -1, -1):
        for i in range(k + 1, n):
            x[k] -= L[i, k] * x[i]
        x[k] /= L[k, k]


@compiled(
    void(
        *(vector(), vector(), _PROBLEM, _MATRIX, _ARRAY, float64, _ARRAY, _MATRIX),
        *(_ARRAY, _ARRAY, _MATRIX, _VECTOR),
    )
)
def _recurse(
    q: np.ndarray,
    v: np.ndarray,
    problem: _Problem,
    nodes: np.ndarray,
    A: np.ndarray,
    trust: float,
    R: np.ndarray,
    r: np.ndarray,
    L: np.ndarray,
    Y: np.ndarray,
    W: np.ndarray,
    b: np.ndarray,
) -> None:
    """Write L (K, n, n) and Y (K, n, w) of the steps but the first, and W and b of the first one,
    (n, n), (n,). R (K + 1, n, n) and r (K + 1, n) may be empty, for I and 0.
    """
    T, h, damping, lower, upper = problem
    K, n = nodes.shape
    w = Y.shape[2]
    weighted = len(R) > 0
    S = np.zeros((2 * n, w))
    for i in range(n):
        S[n + i, n + i] = damping
    for j in range(K - 1, -1, -1):
        t = (h + T) / 2.0 if j == 0 else h
        for i in range(A.shape[1]):
            row = A[j, i]
            for k in range(n):
                c = _RHO * row[k]
                for d in range(w):
                    S[k, d] += c * row[d]
        for k in range(n):
            S[k, k] += trust
            S[k, 2 * n] -= trust * nodes[j, k]
            if not lower[k] <= nodes[j, k] <= upper[k]:
                S[k, k] += _STIFFNESS
                S[k, 2 * n] -= _STIFFNESS * min(max(nodes[j, k], lower[k]), upper[k])
        factor = L[j]
        G = Y[j]
        for k in range(n):  # Q in `factor`, then Q = L L'
            for d in range(w):
                G[k, d] = h * S[k, d] + S[n + k, d]
            for d in range(n):
                factor[k, d] = h * G[k, d] + G[k, n + d]
                G[k, n + d] = 0.0
                if weighted:
                    G[k, n + d] = -R[j + 1, k, d] / t
                elif k == d:
                    G[k, n + d] = -1.0 / t
                factor[k, d] -= G[k, n + d]
            if weighted:
                G[k, 2 * n] += r[j + 1, k]
        for k in range(n):
            for d in range(n):
                S[k, n + d] = 0.0
            for d in range(w):
                S[n + k, d] = 0.0
            for d in range(n):
                S[n + k, n + d] = -G[k, n + d]
            if weighted:
                S[n + k, 2 * n] = -r[j + 1, k]
        for k in range(n):
            for i in range(k):
                c = factor[k, i]
                for d in range(i):
                    c -= factor[k, d] * factor[i, d]
                c /= factor[i, i]
                factor[k, i] = c
                for d in range(w):
                    G[k, d] -= c * G[i, d]
            c = factor[k, k]
            for d in range(k):
                c -= factor[k, d] * factor[k, d]
            factor[k, k] = np.sqrt(c)
            c = 1.0 / factor[k, k]
            for d in range(w):
                G[k, d] *= c
        for k in range(2 * n):
            for i in range(n):
                c = G[i, k]
                for d in range(w):
                    S[k, d] -= c * G[i, d]
    for k in range(n):
        b[k] = -T * (T * S[k, 2 * n] + S[n + k, 2 * n])
        for d in range(n):
            c = T * S[k, d] + S[n + k, d]
            b[k] -= T * c * q[d]
            W[k, d] = T * (T * c + T * S[k, n + d] + S[n + k, n + d])
            if weighted:
                W[k, d] += R[0, k, d]
                b[k] += R[0, k, d] * v[d]
            elif k == d:
                W[k, k] += 1.0
                b[k] += v[k]
        if weighted:
            b[k] -= T * r[0, k]
    _solve(W.copy(), b)


@part
def _roll_out(
    q: np.ndarray,
    v: np.ndarray,
    h: float,
    elapsed: float,
    L: np.ndarray,
    Y: np.ndarray,
    nodes: np.ndarray,
) -> None:
    """Write the nodes to which L and Y lead from (q, v), as they are after some time."""
    K, n = nodes.shape
    at = q.copy()
    u = v.copy()
    y = np.empty(n)
    for j in range(K):
        for k in range(n):
            c = -Y[j, k, 2 * n]
            for d in range(n):
                c -= Y[j, k, d] * at[d] + Y[j, k, n + d] * u[d]
            y[k] = c
        _solve_transposed(L[j], y)
        for k in range(n):
            u[k] = y[k]
            at[k] += h * y[k]
            nodes[j, k] = at[k]
    _shift(nodes, elapsed / h, h * u)


@part
def _copy(values: np.ndarray, out: np.ndarray) -> None:
    """Copy a matrix. For out[:] = values numba would compile the texts of errors, too."""
    for j in range(len(values)):
        for k in range(values.shape[1]):
            out[j, k] = values[j, k]


@inlined
def _shift(nodes: np.ndarray, steps: float, last: np.ndarray) -> None:
    """Move each node towards the next one by a fraction of a step, the last one by `last`."""
    K, n = nodes.shape
    for j in range(K):
        for k in range(n):
            beyond = last[k] if j == K - 1 else nodes[j + 1, k] - nodes[j, k]
            nodes[j, k] += steps * beyond


@part
def _approach_path(
    nodes: np.ndarray,
    path: tuple[np.ndarray, np.ndarray],
    iterations: int,
    damping: float,
    chain: tuple[np.ndarray, ...],
    A: np.ndarray,
    e: np.ndarray,
) -> None:
    """Move nodes towards the path by least steps, A' (A A' + damping I)^-1 e, and linearise."""
    m = e.shape[1]
    n = nodes.shape[1]
    Q = np.empty((m, m))
    for _ in range(iterations):
        _linearise(nodes, path, chain, A, e)
        for j in range(len(nodes)):
            rows = A[j]
            for i in range(m):
                for k in range(i + 1):
                    c = damping if k == i else 0.0
                    for d in range(n):
                        c += rows[i, d] * rows[k, d]
                    Q[i, k] = c
            _solve(Q, e[j])
            for i in range(m):
                for d in range(n):
                    nodes[j, d] += rows[i, d] * e[j, i]
    _linearise(nodes, path, chain, A, e)


@part
def _guess(
    q: np.ndarray,
    path: tuple[np.ndarray, np.ndarray],
    chain: tuple[np.ndarray, ...],
    nodes: np.ndarray,
    A: np.ndarray,
    e: np.ndarray,
) -> None:
    """Write nodes along the path, each near the one before, and linearise."""
    for j in range(len(nodes)):
        for k in range(len(q)):
            nodes[j, k] = q[k] if j == 0 else nodes[j - 1, k]
        there = path[0][j : j + 1], path[1][j : j + 1]
        _approach_path(nodes[j : j + 1], there, _GUESSES, _SINGULAR, chain, A, e)
    _linearise(nodes, path, chain, A, e)


@part
def _sample(times: np.ndarray, values: np.ndarray, t: float, out: np.ndarray) -> None:
    """Write the values at a time, linear between those at `times`, constant beyond."""
    i = int(np.searchsorted(times, t))
    before = max(i - 1, 0)
    after = min(i, len(times) - 1)
    c = (t - times[before]) / (times[after] - times[before]) if before < after else 0.0
    for k in range(len(out)):
        out[k] = values[before, k] + c * (values[after, k] - values[before, k])


@part
def _next_nodes(
    q: np.ndarray,
    v: np.ndarray,
    problem: _Problem,
    path: tuple[np.ndarray, np.ndarray],
    chain: tuple[np.ndarray, ...],
    elapsed: float,
    old: tuple[np.ndarray, np.ndarray, np.ndarray, float, float],
    nodes: np.ndarray,
    A: np.ndarray,
    e: np.ndarray,
) -> tuple[float, float]:
    """Write the nodes to which the old plan leads, or its own if their merit is less, or, if these
    are stuck, a first guess of less merit still; and their linearisation. Their trust and merit.
    """
    old_nodes, old_L, old_Y, trust, merit = old
    h = problem[1]
    K = len(nodes)
    _roll_out(q, v, h, elapsed, old_L, old_Y, nodes)
    _linearise(nodes, path, chain, A, e)
    after = _merit(q, v, nodes, e, problem)
    factor = 1.0 / _FASTER
    if after > merit * (1.0 + _RISE):  # else its own nodes need not be asked
        kept = old_nodes.copy()
        _shift(kept, elapsed / h, old_nodes[K - 1] - old_nodes[K - 2])
        kept_e = np.empty(e.shape)
        _linearise(kept, path, chain, A[:0], kept_e)
        merit = _merit(q, v, kept, kept_e, problem) * (1.0 + _ROUNDING)
        if after > merit:
            _copy(kept, nodes)
            _linearise(nodes, path, chain, A, e)
            after = merit
            factor = _SLOWER
    trust *= factor
    if trust > _STUCK or e.max() > _OFF or e.min() < -_OFF:
        other = np.empty(nodes.shape)
        other_e = np.empty(e.shape)
        _guess(q, path, chain, other, A, other_e)
        merit = _merit(q, v, other, other_e, problem)
        if merit < after:
            _copy(other, nodes)
            _copy(other_e, e)
            return _LEAST_TRUST, merit
        _linearise(nodes, path, chain, A, e)
    return min(max(trust, _LEAST_TRUST), _MOST_TRUST), after


@direct
@compiled(
    several(float64, float64)(
        *(vector(), vector(), _PROBLEM, _CHAIN, several(_VECTOR, _MATRIX, _MATRIX), float64),
        *(several(_MATRIX, _ARRAY, _ARRAY, float64, float64), _ARRAY, _MATRIX),
        *(_MATRIX, _ARRAY, _ARRAY, _MATRIX, _VECTOR),
    )
)
def plan_motion(
    q: np.ndarray,
    v: np.ndarray,
    problem: _Problem,
    chain: tuple[np.ndarray, ...],
    announced: tuple[np.ndarray, np.ndarray, np.ndarray],
    elapsed: float,
    old: tuple[np.ndarray, np.ndarray, np.ndarray, float, float],
    R: np.ndarray,
    r: np.ndarray,
    nodes: np.ndarray,
    L: np.ndarray,
    Y: np.ndarray,
    W: np.ndarray,
    b: np.ndarray,
) -> tuple[float, float]:
    """Write the nodes (K, n) of a plan from (q, v), and what _recurse() makes of them; the trust
    put in it, -1 for a path that begins farther than _LONGEST from the tip, and its merit.

    The path is announced by times (N,), positions (N, 3), and rotations (N, 9) or empty, the old
    plan is its nodes, L, Y, trust and merit, some time ago; without one the nodes are empty.
    """
    times, positions, rotations = announced
    T, h = problem[:2]
    v = v.copy()  # contiguous, as q for _place(): parts are compiled for one type alone
    K, n = nodes.shape
    x = np.empty(3)
    _place(q.copy(), chain, np.empty((0, n)), x, np.empty((3, 3)))
    first = np.empty(3)
    _sample(times, positions, 0.0, first)
    if not ((first - x) ** 2).sum() <= _LONGEST * _LONGEST:
        return -1.0, 0.0
    m = 6 if len(rotations) else 3
    path = np.empty((K, 3)), np.empty((K, 3, 3))
    for j in range(K):
        t = T + h * (j + 1)
        _sample(times, positions, t, path[0][j])
        if m > 3:
            _sample(times, rotations, t, path[1][j].reshape(9))
    A = np.empty((K, m, Y.shape[2]))
    e = np.empty((K, m))
    trust = old[3]
    if len(old[0]):
        trust, merit = _next_nodes(q, v, problem, path, chain, elapsed, old, nodes, A, e)
    else:
        _guess(q, path, chain, nodes, A, e)
        for _ in range(_WARM):
            _recurse(q, v, problem, nodes, A, trust, L[:0], W[:0], L, Y, W, b)
            old = nodes.copy(), L, Y, trust, 0.0
            trust, merit = _next_nodes(q, v, problem, path, chain, T, old, nodes, A, e)
    _recurse(q, v, problem, nodes, A, trust, R, r, L, Y, W, b)
    return trust, merit


@direct
@compiled(void(*(vector(), several(_MATRIX, _ARRAY), float64, vector(), vector(), _CHAIN, _MATRIX)))
def improve_motion(
    q: np.ndarray,
    path: tuple[np.ndarray, np.ndarray],
    T: float,
    lower: np.ndarray,
    upper: np.ndarray,
    chain: tuple[np.ndarray, ...],
    nodes: np.ndarray,
) -> None:
    """Improve nodes (K, n), one for every T, from rest at q, until they are an optimum of the whole
    path, (K, 3), and (K, 3, 3) or empty.

    Each iterate is moved onto the path, so that merits compare motions along it.
    """
    K, n = nodes.shape
    m = 6 if len(path[1]) else 3
    problem = T, T, 0.0, lower, upper
    v = np.zeros(n)
    L = np.empty((K, n, n))
    Y = np.empty((K, n, _width(n)))
    A = np.empty((K, m, Y.shape[2]))
    e = np.empty((K, m))
    W = np.empty((n, n))
    b = np.empty(n)
    other = np.empty((K, n))
    trust = 1.0
    _approach_path(nodes, path, 5, _ON_PATH, chain, A, e)
    merit = _merit(q, v, nodes, e, problem)
    stalled = 0
    for _ in range(_MOST_ITERATIONS):
        _recurse(q, v, problem, nodes, A, trust, L[:0], W[:0], L, Y, W, b)
        _roll_out(q, v, T, 0.0, L, Y, other)
        _approach_path(other, path, 2, _ON_PATH, chain, A, e)
        after = _merit(q, v, other, e, problem)
        if after < merit:
            stalled = stalled + 1 if after > (1.0 - _STALLED) * merit else 0
            _copy(other, nodes)
            merit = after
            trust = max(trust / 5.0, 1e-8)
        else:
            _linearise(nodes, path, chain, A, e)
            trust *= 10.0
        if stalled > 2 or trust > 1e9:
            break
