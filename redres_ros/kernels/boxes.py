"""The box of the joint limits, compiled: which velocities each joint may take."""

import numpy as np
from numba import boolean, float64, from_dtype, int64, types

from redres_ros.kernels.compiled import compiled, direct, inlined, part, vector

_TOUCHING = 1e-9  # [rad/s] apart, boxes still touch: q has 16 digits, which leaves d / T with 13

_AT_REST = 1e-13  # [rad/s]
_ENOUGH = 1e-11  # [rad] within which the end of a braking is found
_MOST_GUESSES = 60
_LEAST_ACCELERATION = 0.1  # of the limit, which is left however many commands may get lost

# The limits of a joint, infinite where there is none. Position limits come twice: the ends of the
# range, and what the robot allows near them.
JOINT_LIMITS = np.dtype(
    [
        ('J', float),  # [rad/s^3]
        ('A_jerk', float),  # [rad/s^2] that goes with the limit on the jerk
        ('A', float),  # [rad/s^2]
        ('A_arm', float),  # [rad/s^2] with which a joint may brake where it has to; 0: A
        ('V', float),  # [rad/s]
        ('V_arm', float),  # [rad/s] that the arm is able to
        ('lower', float, 2),  # [rad]
        ('upper', float, 2),
        ('A_stop', float, 2),  # [rad/s^2] with which the joint stops before these ends
    ]
)
NO_LIMITS = np.array(
    (np.inf, np.inf, np.inf, 0.0, np.inf, np.inf, (-np.inf,) * 2, (np.inf,) * 2, (np.inf,) * 2),
    JOINT_LIMITS,
)

# The boxes in which joint limits are kept, in this order.
JERK = 0
ACCELERATION = 1
VELOCITY = 2
POSITION = 3
END_SPEED = 4
BOXES = 5


@part
def _speed_to_stop(d: float, A: float, T: float, first: float) -> float:
    """As stopping_speed(), for a joint that goes on at its speed for `first` ticks, 1 at least,
    before it brakes; for one in a joint that comes back.
    """
    if not np.isfinite(d):
        return d
    if d < 0.0:
        first = 1.0
    distance = abs(d)
    if not np.isfinite(A):
        return d / (first * T)
    step = A * T
    h = 2.0 * first - 1.0
    N = np.floor((np.sqrt(h * h + 8.0 * distance / (step * T)) - h) / 2.0)  # beside the first
    return np.copysign((distance / T + step * N * (N + 1.0) / 2.0) / (first + N), d)


@compiled(float64(float64, float64, float64))
def stopping_speed(d: float, A: float, T: float) -> float:
    """beta(d), the largest speed [rad/s] from which a joint stops within the distance d [rad].

    It goes on at this speed for one tick, and is then slower by A T in every further one. The usual
    sqrt(2 A d) is its limit for T -> 0. For d < 0 it is -beta(-d): the joint comes back at the
    speed from which it stops at the limit. d and A [rad/s^2] may be infinite.
    """
    return _speed_to_stop(d, A, T, 1.0)


@compiled(float64(*(float64,) * 5))
def _braking_distance(v: float, a: float, A: float, J: float, T: float) -> float:
    """How far a joint gets at most when it brakes as hard as A and J allow, [rad]; 0 if it recedes.

    v is its velocity towards the end, a the acceleration in the tick before. Each tick changes the
    acceleration by J T at most. A joint comes to rest without acceleration if its deceleration is
    always at most stopping_speed(v, J, T): for velocity and acceleration this is what the stopping
    speed is for position and velocity. What the braking does after its first tick is the braking of
    the state after that tick: if one stops in time, so can the next tick.
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
def _overshoot(
    dq: float, d: float, dq_prev: float, A: float, J: float, T: float, first: float
) -> float:
    """By how much a joint that goes on at dq for `first` ticks stops beyond the end, which is d
    away, [rad]; negative: before.
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
    d: float, lower: float, upper: float, dq_prev: float, A: float, J: float, T: float, first: float
) -> float:
    """The largest velocity in [lower, upper] from which a joint stops before the end, [rad/s];
    infinity if it does from all of them, -infinity if from none.

    Beyond the end, d < 0, it is the one with which the joint comes back so that it stops there.
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
    beyond = _overshoot(upper, d, dq_prev, A, J, T, first)
    if not beyond > 0.0:
        return side * np.inf
    before = _overshoot(lower, d, dq_prev, A, J, T, first)
    if before > 0.0:
        return side * (lower if before < _ENOUGH else -np.inf)
    for count in range(_MOST_GUESSES):  # Illinois, and bisection every third time
        if T * (upper - lower) < _ENOUGH:
            break
        fraction = 0.5 if count % 3 == 2 else before / (before - beyond)
        guess = lower + min(max(fraction, 0.01), 0.99) * (upper - lower)
        value = _overshoot(guess, d, dq_prev, A, J, T, first)
        if value > 0.0:
            upper = guess
            beyond = value
        else:
            lower = guess
            before = value
    return side * lower


@inlined
def _narrowed(lower: float, upper: float, least: float, most: float) -> tuple[float, float]:
    """The part of [lower, upper] in [least, most]; where they are apart, the nearest point."""
    return min(max(least, lower), upper), max(min(most, upper), lower)


@part
def _widened(
    lower: float, upper: float, least: float, most: float, v: float, A: float, T: float
) -> tuple[float, float]:
    """[lower, upper], wider where a joint leaves its range unless it brakes with more, with A.

    So it is where limits have become narrower while the joint was fast. v is its last command,
    [least, most] are the velocities from which it then stops in time.
    """
    if most < lower:
        lower = min(lower, max(v - T * A, most, 0.0))
    elif least > upper:
        upper = max(upper, min(v + T * A, least, 0.0))
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
    boolean(
        *(vector(), vector(), vector(), float64),
        *(types.Array(from_dtype(JOINT_LIMITS), 1, 'C'), float64, float64),
    )
)
def are_far(
    dq: np.ndarray,
    q: np.ndarray,
    dq_prev: np.ndarray,
    T: float,
    limits: np.ndarray,
    gap: float,
    longest_gap: float,
) -> bool:
    """Whether a velocity is in all boxes, as in most ticks: in a fifth of the time of fill_boxes().

    False also where it is a close call, and under a limit on the jerk. A joint that brakes from w
    goes on by less than w^2 / (2 A) after the tick.
    """
    first = max(longest_gap / gap, 1.0)
    for i in range(len(q)):
        limit = limits[i]
        w = abs(dq[i])
        if not (w <= limit.V and abs(dq[i] - dq_prev[i]) < T * limit.A and limit.J == np.inf):
            return False
        for end in range(2):
            below = q[i] - limit.lower[end]
            above = limit.upper[end] - q[i]
            ahead = above if dq[i] > 0.0 else below
            braking = (first + 1.0) * T * w + w * w / (2.0 * limit.A_stop[end])
            if not (min(below, above) >= 0.0 and braking <= ahead / gap):
                return False
    return True


@direct
@compiled(
    boolean(
        *(vector(), vector(), vector(), vector(), float64),
        *(types.Array(from_dtype(JOINT_LIMITS), 1, 'C'), float64[:, :, ::1]),
        *(float64, float64, float64),
    )
)
def fill_boxes(
    dq: np.ndarray,
    q: np.ndarray,
    dq_prev: np.ndarray,
    ddq_prev: np.ndarray,
    T: float,
    limits: np.ndarray,
    boxes: np.ndarray,
    gap: float,
    longest_gap: float,
    lost: float,
) -> bool:
    """Write the box of each limit of the joints (n,), and last the one that is in all of them, into
    boxes (BOXES + 1, 2, n).

    A joint for which a box has nothing in common with those before it goes as near to it as they
    allow. Only where it would leave its range, or be faster than the arm is able to, it brakes as
    hard as the arm is able to, whatever the jerk.

    A robot that bridges so many lost commands with constant acceleration sees a jump in the next
    one. It extrapolates from velocity and acceleration as it has seen them, whose errors are those
    of the position, once and twice differenced. The worst is that every other command gets lost:
    each one then triples the error before it. J, A and V are lowered for that.

    A joint must be able to stop with `gap` cycles between two commands, and `longest_gap` until the
    next one; `lost` commands may get lost at short notice.

    Returns:
        Whether dq is in all of them.
    """
    inside = True
    first = max(longest_gap / gap, 1.0)  # of these cycles, before the next command
    tripled = 3.0**lost
    for i in range(len(q)):
        limit = limits[i]
        v = dq_prev[i]
        a = ddq_prev[i]
        lower = -np.inf
        upper = np.inf
        J = limit.J / ((3.0 * tripled - 1.0) / 2.0)
        A_most = np.inf
        V = limit.V
        if J < np.inf:
            lowered = (tripled - 1.0) * J * T
            A_most = max(limit.A_jerk - lowered, _LEAST_ACCELERATION * limit.A_jerk)
            V -= T * lowered
        for k in range(BOXES):
            least = -np.inf
            most = np.inf
            end = max(k - POSITION, 0)
            if k == JERK:  # |ddq - ddq_prev| <= J T
                if J < np.inf:
                    least = v + T * max(a - J * T, min(-A_most, a + J * T))
                    most = v + T * min(a + J * T, max(A_most, a - J * T))
            elif k == ACCELERATION:  # |dq - dq_prev| <= A T
                least = v - T * limit.A
                most = v + T * limit.A
            elif k == VELOCITY and J < np.inf:  # ddq comes to zero before the velocity to V
                least = v - T * stopping_speed(V + v, J, T)
                most = v + T * stopping_speed(V - v, J, T)
                # ... and where it does not, V_arm is kept in the cycles of lost commands, too.
                fastest = limit.V_arm / (1.0 + lost)
                bridged = v * lost / (1.0 + lost)
                least = max(least, bridged - fastest)
                most = min(most, bridged + fastest)
            elif k == VELOCITY:  # |dq| <= V
                least = -V
                most = V
            elif limit.lower[end] > -np.inf or limit.upper[end] < np.inf:
                # -beta(q - q_min) <= dq <= beta(q_max - q)
                # Each command changes a velocity by A T. With one command in `gap` cycles a joint
                # stops within d from the speed from which it otherwise stops within d / gap.
                below = (q[i] - limit.lower[end]) / gap
                above = (limit.upper[end] - q[i]) / gap
                A = min(limit.A_stop[end], A_most)
                if J < np.inf:
                    least = -_largest_speed(below, -upper, -lower, -v, A, J, T, first)
                    most = _largest_speed(above, lower, upper, v, A, J, T, first)
                else:
                    least = -_speed_to_stop(below, A, T, first)
                    most = _speed_to_stop(above, A, T, first)
            boxes[k, 0, i] = least
            boxes[k, 1, i] = most
            is_apart = least > upper + _TOUCHING or most < lower - _TOUCHING
            if is_apart and k >= POSITION:
                A = limit.A_arm
                cycles = max(first, 1.0 + lost)
                slowest = -_speed_to_stop((q[i] - limit.lower[end]) / gap, A, T, cycles)
                fastest = _speed_to_stop((limit.upper[end] - q[i]) / gap, A, T, cycles)
                lower, upper = _widened(lower, upper, slowest, fastest, v, A, T)
                if least > most:  # braking before one end, at J, ends beyond the other one
                    least = slowest
                    most = fastest
            elif is_apart and k == VELOCITY and J < np.inf:
                lower = min(lower, max(v - T * limit.A_arm, bridged + fastest))
                upper = max(upper, min(v + T * limit.A_arm, bridged - fastest))
            lower, upper = _narrowed(lower, upper, least, most)
        boxes[BOXES, 0, i] = lower
        boxes[BOXES, 1, i] = upper
        if not lower <= dq[i] <= upper:
            inside = False
    return inside


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
    """Write the reference that a robot at p with the velocity v may get into `admitted`, and its
    velocity into dq, both (n,), for a proposed q_ref.

    A joint that is faster than V may not get faster; one outside its range may only come back.

    Returns:
        The first joint that is changed, or cannot stop within its range any more; -1 for none.
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
