"""The rows of limits that keep distances, compiled: with numpy they take as long as a tick."""

import numpy as np
from numba import float64, int64

from redres_ros.kernels.compiled import compiled, direct, inlined, matrix, several, vector

# Of a row for the path of a braking arm, beside a velocity damper, where not all can be kept: what
# cannot be braked any more comes first.
_WEIGHT = 1000.0
_INSIDE = 1e-6  # [m] beyond its clearance a pair is too near by more than rounding

_ROWS = float64[:, ::1]
_VECTOR = float64[::1]
_PAIRS = int64[:, ::1]


@inlined
def _index_of(who: np.ndarray, near: int, one: int, other: int) -> int:
    """Index of a pair in who (r, 2), which is likely to be `near`; -1 if it is not there."""
    r = len(who)
    for step in range(r):
        i = (near + step) % r
        if who[i, 0] == one and who[i, 1] == other:
            return i
    return -1


@direct
@compiled(
    float64(
        *(vector(), vector(), float64, vector(), float64, float64, _VECTOR, _VECTOR, _VECTOR),
    )
)
def brake(
    q: np.ndarray,
    dq_prev: np.ndarray,
    gap: float,
    A: np.ndarray,
    T: float,
    ticks: float,
    q_ahead: np.ndarray,
    v: np.ndarray,
    slope: np.ndarray,
) -> float:
    """Write where joints are that have braked for so many ticks, this one included.

    A joint goes on by v, v - A T, v - 2 A T, ..., until less than A T is left.

    Args:
        q: (n,) [rad].
        dq_prev: (n,) [rad/s].
        gap: Cycles between two commands.
        A: (n,) [rad/s^2].
        T: Sampling time [s].
        ticks: Any number; infinity: until all are at rest.
        q_ahead: (n,) receives q + s(v) [rad].
        v: (n,) receives the velocity of braking in this tick [rad/s].
        slope: (n,) receives S = ds/dv [s].

    Returns:
        After how many ticks the last joint is at rest.
    """
    longest = 0.0
    for i in range(len(q)):
        speed = max(abs(dq_prev[i]) - A[i] * T, 0.0)
        v[i] = speed if dq_prev[i] > 0.0 else -speed
        stop = np.floor(speed / (A[i] * T)) + 1.0
        k = min(ticks, stop)
        path = gap * T * (k * speed - A[i] * T * k * (k - 1.0) / 2.0)
        q_ahead[i] = q[i] + (path if dq_prev[i] > 0.0 else -path)
        slope[i] = gap * min(ticks * T, speed / A[i] + T)
        longest = max(longest, stop)
    return longest


@direct
@compiled(float64(vector(), float64, vector(), float64, vector()))
def farthest_path(
    dq_prev: np.ndarray, gap: float, A: np.ndarray, T: float, levers: np.ndarray
) -> float:
    """How far any point may move, at most, if the joints brake after this tick [m].

    Args:
        dq_prev: (n,) [rad/s].
        gap: Cycles between two commands.
        A: (n,) [rad/s^2].
        T: Sampling time [s].
        levers: How far a radian of each joint moves any point, at most, (n,) [m].
    """
    path = 0.0
    for i in range(len(A)):
        fastest = abs(dq_prev[i]) + A[i] * T
        path += levers[i] * gap * (fastest + A[i] * T) ** 2 / (2.0 * A[i])
    return path


@compiled(
    several(_ROWS, _VECTOR, _PAIRS)(
        *(matrix(), vector(), matrix(int64), vector(), vector()),
        *(float64, float64, float64, float64),
    )
)
def damper_rows(
    C: np.ndarray,
    distance: np.ndarray,
    who: np.ndarray,
    dq_prev: np.ndarray,
    A: np.ndarray,
    T: float,
    rate: float,
    clearance: float,
    influence: float,
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """C dq <= rate (d - d_s) of all that is nearer than the influence, unless every acceleration
    within the limits keeps it.

    Args:
        C: (r, n), C dq is the speed of approach [m/s].
        distance: (r,) [m].
        who: (r, 2) approaches whom.
        dq_prev: (n,) [rad/s].
        A: (n,) [rad/s^2].
        T: Sampling time [s].
        rate: 1 / t_d [1/s].
        clearance: d_s [m].
        influence: d_i [m].

    Returns:
        Rows (j, n), their upper ends (j,), and who approaches whom (j, 2).
    """
    r, n = C.shape
    rows = np.empty((r, n))
    high = np.empty(r)
    pairs = np.empty((r, 2), np.int64)
    count = 0
    for i in range(r):
        fastest = 0.0  # in this tick
        for j in range(n):
            rows[count, j] = C[i, j]
            fastest += C[i, j] * dq_prev[j] + abs(C[i, j]) * 2.0 * T * A[j]
        high[count] = rate * (distance[i] - clearance)
        pairs[count, 0] = who[i, 0]
        pairs[count, 1] = who[i, 1]
        if distance[i] < influence and fastest > high[count]:
            count += 1
    return rows[:count], high[:count], pairs[:count]


@compiled(
    several(_ROWS, _VECTOR, _PAIRS)(
        *(matrix(), vector(), matrix(int64), vector(), matrix(int64)),
        *(vector(), vector(), vector(), float64, float64, float64, float64, float64, float64),
    )
)
def braking_rows(
    C: np.ndarray,
    distance: np.ndarray,
    who: np.ndarray,
    distance_now: np.ndarray,
    who_now: np.ndarray,
    v: np.ndarray,
    slope: np.ndarray,
    A: np.ndarray,
    T: float,
    gap: float,
    ticks: float,
    rate: float,
    clearance: float,
    lever: float,
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """C S (dq - v) <= d - d_s - b at a place of a braking arm, unless every acceleration within
    the limits keeps it.

    ClearanceLimit says what these are.

    Args:
        C: (r, n) at that place, C dq is the speed of approach [m/s].
        distance: (r,) [m].
        who: (r, 2) approaches whom.
        distance_now: (k,) [m].
        who_now: (k, 2).
        v: (n,) as from `brake` [rad/s].
        slope: (n,) as from `brake` [s].
        A: (n,) [rad/s^2].
        T: Sampling time [s].
        gap: Cycles between two commands.
        ticks: For how long the arm has braked.
        rate: 1 / t_d [1/s].
        clearance: d_s [m].
        lever: How far a radian of any joint moves any point, at most [m].

    Returns:
        As damper_rows().
    """
    r, n = C.shape
    rows = np.empty((r, n))
    high = np.empty(r)
    pairs = np.empty((r, 2), np.int64)
    count = 0
    bend = 0.0  # how far the arm leaves the tangent, for a change of A T in every joint
    for j in range(n):
        bend += 0.5 * lever * (slope[j] * A[j] * T) ** 2
    for i in range(r):
        before = 0.0  # |C|^2
        after = 0.0  # of the row
        braking = 0.0
        reach = 0.0
        for j in range(n):
            # The chord of s that is on the safe side: it becomes steeper with the speed.
            chord = slope[j] + 0.5 * gap * T * np.sign(C[i, j] * v[j])
            rows[count, j] = C[i, j] * min(chord, gap * T * ticks)
            before += C[i, j] * C[i, j]
            after += rows[count, j] * rows[count, j]
            braking += rows[count, j] * v[j]
            reach += abs(rows[count, j]) * 2.0 * T * A[j]
        margin = distance[i] - clearance
        if after == 0.0 or not margin - bend < reach:
            continue
        size = _WEIGHT * np.sqrt(before / after)  # as long as the other rows, times the weight
        # What is inside already comes out again as slowly as by the damper, and after the others:
        # nothing else gets inside for it.
        if margin < 0.0:
            now = _index_of(who_now, i, who[i, 0], who[i, 1])
            if now >= 0 and distance_now[now] < clearance - _INSIDE:
                margin *= min(rate * T, 1.0)
                size /= _WEIGHT
        for j in range(n):
            rows[count, j] *= size
        high[count] = size * (margin - bend + braking)
        pairs[count, 0] = who[i, 0]
        pairs[count, 1] = who[i, 1]
        count += 1
    return rows[:count], high[:count], pairs[:count]
