"""The boxes of joint limits, compiled: which velocities of a joint a limit allows."""

import numpy as np
from numba import boolean, float64, int64, types

from redres_ros.kernels.compiled import compiled, direct, inlined, part, vector

TOUCHING = 1e-9  # [rad/s] apart, boxes still touch: q has 16 digits, which leaves d / T with 13

# What a limit is, and what its figures (3, n) are then.
ACCELERATION = 0  # A [rad/s^2], and the arm's own, with which a joint may brake where it has to
VELOCITY = 1  # V [rad/s]
POSITION = 2  # q_min, q_max [rad], A [rad/s^2]
GIVEN = 3  # the box itself, lower and upper [rad/s]

_FIGURES = types.Array(types.float64, 3, 'C')


@compiled(float64(float64, float64, float64))
def stopping_speed(d: float, A: float, T: float) -> float:
    """beta(d), the largest speed from which a joint stops within the distance d.

    It goes on at this speed for one tick, and is then slower by A T in every further one. The usual
    sqrt(2 A d) is its limit for T -> 0. For d < 0 it is -beta(-d): the joint comes back at the
    speed from which it stops at the limit.

    Args:
        d: distance to the limit [rad]; it may be infinite.
        A: acceleration [rad/s^2]; infinite for a joint that stops at once.
        T: sampling time [s].

    Returns:
        The speed [rad/s].
    """
    if d < 0.0:
        return -stopping_speed(-d, A, T)
    if not np.isfinite(d):
        return d
    if not np.isfinite(A):
        return d / T
    step = A * T
    N = np.floor(
        (np.sqrt(1.0 + 8.0 * d / (step * T)) - 1.0) / 2.0
    )  # ticks it takes beside the first
    return (d / T + step * N * (N + 1.0) / 2.0) / (N + 1.0)


@inlined
def box_of_joint(
    kind: int, figures: np.ndarray, k: int, i: int, q: float, dq_prev: float, T: float
) -> tuple[float, float]:
    """The least and the largest velocity of joint i under one limit [rad/s]."""
    if kind == ACCELERATION:  # |dq - dq_prev| <= A T
        reach = T * figures[k, 0, i]
        return dq_prev - reach, dq_prev + reach
    if kind == VELOCITY:  # |dq| <= V
        return -figures[k, 0, i], figures[k, 0, i]
    if kind == POSITION:  # -beta(q - q_min) <= dq <= beta(q_max - q)
        A = figures[k, 2, i]
        least = -stopping_speed(q - figures[k, 0, i], A, T)
        return least, stopping_speed(figures[k, 1, i] - q, A, T)
    return figures[k, 0, i], figures[k, 1, i]


@inlined
def narrowed(lower: float, upper: float, least: float, most: float) -> tuple[float, float]:
    """The part of [lower, upper] in [least, most]; where they are apart, the nearest point."""
    return min(max(least, lower), upper), max(min(most, upper), lower)


@part
def saved(
    lower: float,
    upper: float,
    margin: tuple[float, float],
    dq_prev: float,
    hardest: float,
    T: float,
) -> tuple[float, float]:
    """[lower, upper], wider where a joint leaves its range unless it brakes harder than that.

    So it is where limits have become narrower while the joint was fast.

    Args:
        lower: Of what the acceleration that is allowed lets it do [rad/s].
        upper: The same.
        margin: To the lower and to the upper end of the range [rad].
        dq_prev: The last command [rad/s].
        hardest: Acceleration that the arm is able to [rad/s^2].
        T: Sampling time [s].
    """
    least = -stopping_speed(margin[0], hardest, T)
    most = stopping_speed(margin[1], hardest, T)
    if most < lower:
        lower = min(lower, max(dq_prev - T * hardest, most, 0.0))
    elif least > upper:
        upper = max(upper, min(dq_prev + T * hardest, least, 0.0))
    return lower, upper


@direct
@compiled(boolean(vector(), vector(), vector()))
def within(values: np.ndarray, lower: np.ndarray, upper: np.ndarray) -> bool:
    """Whether lower <= values <= upper, element by element; False for NaN."""
    for i in range(len(values)):  # noqa: SIM110 (numba knows no generators)
        if not lower[i] <= values[i] <= upper[i]:
            return False
    return True


@direct
@compiled(boolean(vector(), vector(), float64, vector(int64), _FIGURES, _FIGURES))
def fill_boxes(
    q: np.ndarray,
    dq_prev: np.ndarray,
    T: float,
    kinds: np.ndarray,
    figures: np.ndarray,
    boxes: np.ndarray,
) -> bool:
    """Write the box of each limit, and last the one that is in all of them.

    A joint for which a box has nothing in common with those before it goes as near to it as they
    allow. Only where it would leave its range it brakes as hard as the arm is able to.

    Args:
        q: (n,) [rad].
        dq_prev: (n,) [rad/s] the last command.
        T: Sampling time [s].
        kinds: (k,) what each limit is.
        figures: (k, 3, n) of each limit.
        boxes: (k + 1, 2, n) receives them.

    Returns:
        Whether they have something in common in every joint.
    """
    meet = True
    for i in range(len(q)):
        lower = -np.inf
        upper = np.inf
        hardest = 0.0
        for k in range(len(kinds)):
            least, most = box_of_joint(kinds[k], figures, k, i, q[i], dq_prev[i], T)
            boxes[k, 0, i] = least
            boxes[k, 1, i] = most
            if least > upper + TOUCHING or most < lower - TOUCHING:
                meet = False
            if kinds[k] == ACCELERATION:
                hardest = figures[k, 1, i]
            elif kinds[k] == POSITION and (least > upper + TOUCHING or most < lower - TOUCHING):
                margin = (q[i] - figures[k, 0, i], figures[k, 1, i] - q[i])
                lower, upper = saved(lower, upper, margin, dq_prev[i], hardest, T)
            lower, upper = narrowed(lower, upper, least, most)
        boxes[-1, 0, i] = lower
        boxes[-1, 1, i] = upper
    return meet


@direct
@compiled(
    int64(
        *(vector(), vector(), vector(), float64, vector(), vector(), vector(), vector()),
        *(float64[::1], float64[::1]),
    )
)
def admit(
    q_ref: np.ndarray,
    p: np.ndarray,
    v: np.ndarray,
    T: float,
    V: np.ndarray,
    A: np.ndarray,
    q_min: np.ndarray,
    q_max: np.ndarray,
    admitted: np.ndarray,
    dq: np.ndarray,
) -> int:
    """Write the reference that the robot may get, and its velocity.

    A joint that is faster than V may not get faster; one outside its range may only come back.

    Args:
        q_ref: The reference that is proposed, (n,) [rad].
        p: Where the robot is, (n,) [rad].
        v: Its velocity, (n,) [rad/s].
        T: Sampling time [s].
        V: (n,) [rad/s].
        A: (n,) [rad/s^2].
        q_min: (n,) [rad].
        q_max: (n,) [rad].
        admitted: Receives the reference, (n,) [rad].
        dq: Receives its velocity, (n,) [rad/s].

    Returns:
        The number of the first joint that is changed, or cannot stop within its range any more;
        -1 if there is none.
    """
    first = -1
    for i in range(len(q_ref)):
        lower = v[i] - T * A[i]
        upper = v[i] + T * A[i]
        lower, upper = narrowed(lower, upper, min(-V[i], v[i]), max(V[i], v[i]))
        least = -stopping_speed(max(p[i] - q_min[i], 0.0), A[i], T)
        most = stopping_speed(max(q_max[i] - p[i], 0.0), A[i], T)
        lower, upper = narrowed(lower, upper, least, most)
        admitted[i] = q_ref[i]
        dq[i] = (q_ref[i] - p[i]) / T
        if not lower - TOUCHING <= dq[i] <= upper + TOUCHING:
            proposed = dq[i] if np.isfinite(dq[i]) else 0.0
            dq[i] = min(max(proposed, lower), upper)
            admitted[i] = p[i] + T * dq[i]
        elif least - TOUCHING <= dq[i] <= most + TOUCHING:
            continue
        if first < 0:
            first = i
    return first
