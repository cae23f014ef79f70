"""The rows of limits that keep distances, compiled: with numpy they take as long as a tick."""

import numpy as np
from numba import float64, int64

from redres_ros.kernels.compiled import compiled, direct, inlined, matrix, several, vector

# Of a row for where the arm comes to rest, beside a velocity damper, where not all can be kept:
# what cannot be braked any more comes first.
_WEIGHT = 100.0

_ROWS = float64[:, ::1]
_VECTOR = float64[::1]
_PAIRS = int64[:, ::1]


@inlined
def _is_among(who: np.ndarray, count: int, one: int, other: int) -> bool:
    """Whether a pair is among the first rows of who (r, 2)."""
    found = False
    for i in range(count):
        if who[i, 0] == one and who[i, 1] == other:
            found = True
    return found


@direct
@compiled(
    float64(
        *(vector(), vector(), float64, vector(), float64, _VECTOR, _VECTOR, _VECTOR),
    )
)
def brake(
    q: np.ndarray,
    dq_prev: np.ndarray,
    gap: float,
    A: np.ndarray,
    T: float,
    q_stop: np.ndarray,
    v: np.ndarray,
    slope: np.ndarray,
) -> float:
    """Write where joints come to rest that brake from this tick on.

    Args:
        q: (n,) [rad].
        dq_prev: (n,) [rad/s].
        gap: Cycles between two commands.
        A: (n,) [rad/s^2].
        T: Sampling time [s].
        q_stop: (n,) receives q + s(v) [rad].
        v: (n,) receives the velocity of braking in this tick [rad/s].
        slope: (n,) receives S = ds/dv [s].

    Returns:
        The sum over the joints of how much further one may come to rest that does not brake in this
        tick, [rad].
    """
    further = 0.0
    for i in range(len(q)):
        speed = max(abs(dq_prev[i]) - A[i] * T, 0.0)
        v[i] = speed if dq_prev[i] > 0.0 else -speed
        q_stop[i] = q[i] + gap * v[i] * (speed / (2.0 * A[i]) + T / 2.0)
        slope[i] = gap * (speed / A[i] + T)
        further += slope[i] * 2.0 * T * A[i]
    return further


@compiled(
    several(_ROWS, _VECTOR, _PAIRS)(
        *(matrix(), vector(), matrix(int64), matrix(), vector(), matrix(int64)),
        *(vector(), vector(), vector(), vector(), float64, float64, float64, float64),
    )
)
def clearance_rows(
    C: np.ndarray,
    distance: np.ndarray,
    who: np.ndarray,
    C_stop: np.ndarray,
    distance_stop: np.ndarray,
    who_stop: np.ndarray,
    dq_prev: np.ndarray,
    v: np.ndarray,
    slope: np.ndarray,
    A: np.ndarray,
    T: float,
    gap: float,
    rate: float,
    clearance: float,
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """The rows that no acceleration within the limits keeps by itself: see ClearanceLimit.

    Args:
        C: (r, n) of what is near, C dq is the speed of approach [m/s].
        distance: (r,) [m].
        who: (r, 2) approaches whom.
        C_stop: (k, n), the same where the joints come to rest, and so are the next two.
        distance_stop: (k,) [m].
        who_stop: (k, 2).
        dq_prev: (n,) [rad/s].
        v: (n,) as from `brake` [rad/s].
        slope: (n,) as from `brake` [s].
        A: (n,) [rad/s^2].
        T: Sampling time [s].
        gap: Cycles between two commands.
        rate: 1 / t_d [1/s].
        clearance: d_s [m].

    Returns:
        Rows (j, n), their upper ends (j,), and who approaches whom (j, 2).
    """
    n = len(dq_prev)
    r = len(C)
    most = r + len(C_stop)
    rows = np.empty((most, n))
    high = np.empty(most)
    pairs = np.empty((most, 2), np.int64)
    count = 0
    for i in range(r):
        fastest = 0.0  # in this tick
        for j in range(n):
            rows[count, j] = C[i, j]
            fastest += C[i, j] * dq_prev[j] + abs(C[i, j]) * 2.0 * T * A[j]
        high[count] = rate * (distance[i] - clearance)
        pairs[count, 0] = who[i, 0]
        pairs[count, 1] = who[i, 1]
        if fastest > high[count]:
            count += 1
    inside = np.empty((r, 2), np.int64)
    number_inside = 0
    for i in range(r):
        if distance[i] < clearance:
            inside[number_inside, 0] = who[i, 0]
            inside[number_inside, 1] = who[i, 1]
            number_inside += 1
    for i in range(len(C_stop)):
        before = 0.0  # |C|^2
        after = 0.0  # of the row
        braking = 0.0
        reach = 0.0
        for j in range(n):
            # The chord of s that is on the safe side: it becomes steeper with the speed.
            chord = slope[j] + 0.5 * gap * T * np.sign(C_stop[i, j] * v[j])
            rows[count, j] = C_stop[i, j] * chord
            before += C_stop[i, j] * C_stop[i, j]
            after += rows[count, j] * rows[count, j]
            braking += rows[count, j] * v[j]
            reach += abs(rows[count, j]) * 2.0 * T * A[j]
        margin = distance_stop[i] - clearance
        if not margin < reach:
            continue
        # What is inside already comes out again as slowly as by the damper.
        one = who_stop[i, 0]
        other = who_stop[i, 1]
        if margin < 0.0 and _is_among(inside, number_inside, one, other):
            margin *= min(rate * T, 1.0)
        size = _WEIGHT * np.sqrt(before / after)  # as long as the other rows, times the weight
        for j in range(n):
            rows[count, j] *= size
        high[count] = size * (margin + braking)
        pairs[count, 0] = one
        pairs[count, 1] = other
        count += 1
    return rows[:count], high[:count], pairs[:count]
