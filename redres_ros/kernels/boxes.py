"""The boxes of joint limits, compiled: which velocities of a joint a limit allows."""

import numpy as np
from numba import boolean, float64, int64, types

from redres_ros.kernels.compiled import compiled, direct, inlined, part, several, vector

_TOUCHING = 1e-9  # [rad/s] apart, boxes still touch: q has 16 digits, which leaves d / T with 13

_AT_REST = 1e-13  # [rad/s]
_ENOUGH = 1e-11  # [rad] within which the end of a braking is found
_MOST_GUESSES = 60
_LEAST_ACCELERATION = 0.1  # of the limit, which is left however many commands may get lost

# What a limit is, and what its figures (3, n) are then.
ACCELERATION = 0  # A [rad/s^2], and the arm's own, with which a joint may brake where it has to
VELOCITY = 1  # V [rad/s]
POSITION = 2  # q_min, q_max [rad], A [rad/s^2]
GIVEN = 3  # the box itself, lower and upper [rad/s]
JERK = 4  # J [rad/s^3], A [rad/s^2], and the changes J T by which A is lowered

_FIGURES = types.Array(types.float64, 3, 'C')


@part
def _speed_to_stop(d: float, A: float, T: float, first: float) -> float:
    """As stopping_speed(), for a joint that goes on at its speed for some ticks before it brakes.

    Args:
        d: As of stopping_speed().
        A: The same.
        T: The same.
        first: These ticks, at least 1; not of a joint that comes back.
    """
    if not np.isfinite(d):
        return d
    if d < 0.0:
        first = 1.0
    way = abs(d)
    if not np.isfinite(A):
        return d / (first * T)
    step = A * T
    h = 2.0 * first - 1.0
    N = np.floor((np.sqrt(h * h + 8.0 * way / (step * T)) - h) / 2.0)  # ticks beside the first
    return np.copysign((way / T + step * N * (N + 1.0) / 2.0) / (first + N), d)


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
    return _speed_to_stop(d, A, T, 1.0)


@compiled(float64(*(float64,) * 5))
def _braking_distance(v: float, a: float, A: float, J: float, T: float) -> float:
    """How far a joint gets at most when it brakes as hard as it may, [rad]; 0 if it recedes.

    Each tick changes the acceleration by J T at most. A joint comes to rest without acceleration if
    its deceleration is always at most stopping_speed(v, J, T): for velocity and acceleration this
    is what the stopping speed is for position and velocity. What the braking does after its first
    tick is the braking of the state after that tick: if one stops in time, so can the next tick.

    Args:
        v: Its velocity towards the end [rad/s].
        a: The acceleration in the tick before [rad/s^2].
        A: Largest acceleration [rad/s^2].
        J: Largest jerk [rad/s^3].
        T: Sampling time [s].
    """
    h = J * T
    d = 0.0
    farthest = 0.0
    while v > _AT_REST or a > _AT_REST:
        b = min(min(A, h - a), stopping_speed(max(v, 0.0), J, T))  # the deceleration
        b = max(b, -a - h)
        v -= T * b
        a = -b
        d += T * v
        farthest = max(farthest, d)
        if b == A:  # as long as the stopping speed allows it
            k = np.floor(A / h)
            last = T * (A * (k + 1.0) - h * k * (k + 1.0) / 2.0)  # whose stopping speed is A
            N = np.floor((v - last) / (A * T))
            if N > 0.0:
                d += T * (N * v - A * T * N * (N + 1.0) / 2.0)
                v -= N * A * T
                farthest = max(farthest, d)
    return farthest


@part
def stops(dq: float, d: float, dq_prev: float, A: float, J: float, T: float, first: float) -> float:
    """By how much a joint that takes a velocity stops beyond the end, [rad]; negative: before.

    Args:
        dq: The velocity [rad/s].
        d: Distance to the end now [rad].
        dq_prev: The last velocity [rad/s].
        A: Largest acceleration [rad/s^2].
        J: Largest jerk [rad/s^3].
        T: Sampling time [s].
        first: Ticks for which it goes on at that velocity.
    """
    a = (dq - dq_prev) / T
    left = d - first * T * dq
    rising = max(a, 0.0)
    w = max(dq, 0.0) + rising * (rising / J + T)
    if w * (w / A + (rising + 2.0 * A) / J + 2.0 * T) <= left:  # far from the end
        return -1.0
    return _braking_distance(dq, a, A, J, T) - left


@part
def _largest_speed(
    d: float,
    lower: float,
    upper: float,
    dq_prev: float,
    A: float,
    J: float,
    T: float,
    first: float,
) -> float:
    """The largest velocity in [lower, upper] from which a joint stops before the end, [rad/s].

    Args:
        d: Distance to the end [rad].
        lower: The least that other limits allow [rad/s].
        upper: The largest [rad/s].
        dq_prev: The last velocity [rad/s].
        A: Largest acceleration [rad/s^2].
        J: Largest jerk [rad/s^3].
        T: Sampling time [s].
        first: Ticks for which it goes on at a velocity before it brakes.

    Returns:
        The velocity; infinity if all do, -infinity if none does. Beyond the end, the velocity
        with which the joint comes back so that it stops there.
    """
    side = 1.0
    if d < -_ENOUGH / T:
        first = 1.0
        side = -1.0
        d = -d
        dq_prev = -dq_prev
        most = -lower
        lower = -upper
        upper = most
    beyond = stops(upper, d, dq_prev, A, J, T, first)
    if not beyond > 0.0:
        return side * np.inf
    before = stops(lower, d, dq_prev, A, J, T, first)
    if before > 0.0:
        return side * (lower if before < _ENOUGH else -np.inf)
    for count in range(_MOST_GUESSES):  # Illinois, and bisection every third time
        if T * (upper - lower) < _ENOUGH:
            break
        share = 0.5 if count % 3 == 2 else before / (before - beyond)
        guess = lower + min(max(share, 0.01), 0.99) * (upper - lower)
        value = stops(guess, d, dq_prev, A, J, T, first)
        if value > 0.0:
            upper = guess
            beyond = value
        else:
            lower = guess
            before = value
    return side * lower


@inlined
def _box_of_joint(
    kind: int,
    figures: np.ndarray,
    k: int,
    i: int,
    q: float,
    last: tuple[float, float],
    jerk: tuple[float, float, float],
    box: tuple[float, float],
    T: float,
    gap: float,
    first: float,
) -> tuple[float, float]:
    """The least and the largest velocity of joint i under one limit [rad/s].

    Args:
        kind: What the limit is.
        figures: Of all limits, (k, 3, n).
        k: The limit.
        i: The joint.
        q: Its position [rad].
        last: Its last velocity [rad/s] and acceleration [rad/s^2].
        jerk: The largest one [rad/s^3], infinite without a limit on it, and the largest
            acceleration [rad/s^2] that goes with it; by how much that is lowered [rad/s^2].
        box: What the limits before allow [rad/s].
        T: Sampling time [s].
        gap: As of fill_boxes().
        first: Gaps until the next command, at most.
    """
    dq_prev, ddq_prev = last
    J, A_most, lowered = jerk
    if kind == JERK:  # |ddq - ddq_prev| <= J T
        least = max(ddq_prev - J * T, min(-A_most, ddq_prev + J * T))
        most = min(ddq_prev + J * T, max(A_most, ddq_prev - J * T))
        return dq_prev + T * least, dq_prev + T * most
    if kind == ACCELERATION:  # |dq - dq_prev| <= A T
        reach = T * figures[k, 0, i]
        return dq_prev - reach, dq_prev + reach
    if kind == VELOCITY and J < np.inf:  # the acceleration comes to zero before the velocity to V
        V = figures[k, 0, i] - T * lowered
        least = dq_prev - T * stopping_speed(V + dq_prev, J, T)
        return least, dq_prev + T * stopping_speed(V - dq_prev, J, T)
    if kind == VELOCITY:  # |dq| <= V
        return -figures[k, 0, i], figures[k, 0, i]
    if kind == POSITION:  # -beta(q - q_min) <= dq <= beta(q_max - q)
        # Each command changes a velocity by A T. With one command in `gap` cycles a joint stops
        # within d from the speed from which it otherwise stops within d / gap.
        below = (q - figures[k, 0, i]) / gap
        above = (figures[k, 1, i] - q) / gap
        A = min(figures[k, 2, i], A_most)
        if J < np.inf:
            lower, upper = box
            least = -_largest_speed(below, -upper, -lower, -dq_prev, A, J, T, first)
            return least, _largest_speed(above, lower, upper, dq_prev, A, J, T, first)
        return -_speed_to_stop(below, A, T, first), _speed_to_stop(above, A, T, first)
    return figures[k, 0, i], figures[k, 1, i]


@inlined
def _narrowed(lower: float, upper: float, least: float, most: float) -> tuple[float, float]:
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
@compiled(
    several(boolean, boolean)(
        *(vector(), vector(), vector(), vector(), float64, vector(int64), _FIGURES, _FIGURES),
        *(float64, float64),
    )
)
def fill_boxes(
    dq: np.ndarray,
    q: np.ndarray,
    dq_prev: np.ndarray,
    ddq_prev: np.ndarray,
    T: float,
    kinds: np.ndarray,
    figures: np.ndarray,
    boxes: np.ndarray,
    gap: float,
    longest_gap: float,
) -> tuple[bool, bool]:
    """Write the box of each limit, and last the one that is in all of them.

    A joint for which a box has nothing in common with those before it goes as near to it as they
    allow. Only where it would leave its range it brakes as hard as the arm is able to.

    Args:
        dq: (n,) [rad/s] a velocity.
        q: (n,) [rad].
        dq_prev: (n,) [rad/s] the last command.
        ddq_prev: (n,) [rad/s^2] its acceleration.
        T: Sampling time [s].
        kinds: (k,) what each limit is.
        figures: (k, 3, n) of each limit.
        boxes: (k + 1, 2, n) receives them.
        gap: Cycles between two commands, with which a joint must be able to stop.
        longest_gap: Cycles until the next command, at most.

    Returns:
        Whether they have something in common in every joint; and whether dq is in all of them.
    """
    meet = True
    inside = True
    first = max(longest_gap / gap, 1.0)  # of these cycles, before the next command
    for i in range(len(q)):
        lower = -np.inf
        upper = np.inf
        hardest = 0.0
        last = (dq_prev[i], ddq_prev[i])
        J = np.inf
        A_most = np.inf
        lowered = 0.0
        for k in range(len(kinds)):
            if kinds[k] == JERK:
                J = figures[k, 0, i]
                A = figures[k, 1, i]
                lowered = figures[k, 2, i] * J * T
                A_most = max(A - lowered, _LEAST_ACCELERATION * A)
            box = (lower, upper)
            least, most = _box_of_joint(
                kinds[k], figures, k, i, q[i], last, (J, A_most, lowered), box, T, gap, first
            )
            boxes[k, 0, i] = least
            boxes[k, 1, i] = most
            if kinds[k] == ACCELERATION:
                hardest = figures[k, 1, i]
            is_apart = least > upper + _TOUCHING or most < lower - _TOUCHING
            meet = meet and not is_apart
            if is_apart and kinds[k] == POSITION and J == np.inf:
                margin = (q[i] - figures[k, 0, i], figures[k, 1, i] - q[i])
                lower, upper = saved(lower, upper, margin, dq_prev[i], hardest, T)
            lower, upper = _narrowed(lower, upper, least, most)
        boxes[-1, 0, i] = lower
        boxes[-1, 1, i] = upper
        if not lower <= dq[i] <= upper:
            inside = False
    return meet, inside


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
        lower, upper = _narrowed(lower, upper, min(-V[i], v[i]), max(V[i], v[i]))
        least = -stopping_speed(max(p[i] - q_min[i], 0.0), A[i], T)
        most = stopping_speed(max(q_max[i] - p[i], 0.0), A[i], T)
        lower, upper = _narrowed(lower, upper, least, most)
        admitted[i] = q_ref[i]
        dq[i] = (q_ref[i] - p[i]) / T
        if not lower - _TOUCHING <= dq[i] <= upper + _TOUCHING:
            proposed = dq[i] if np.isfinite(dq[i]) else 0.0
            dq[i] = min(max(proposed, lower), upper)
            admitted[i] = p[i] + T * dq[i]
        elif least - _TOUCHING <= dq[i] <= most + _TOUCHING:
            continue
        if first < 0:
            first = i
    return first
