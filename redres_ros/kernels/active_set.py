"""One level of a search: |A z - a| becomes the least that the limits and the levels before leave.

The method is a primal active-set method (Nocedal and Wright, Numerical Optimization, 2006,
Algorithm 16.3): z keeps every limit after every step.
"""

import numpy as np

from redres_ros.kernels.arithmetic import dot
from redres_ros.kernels.basis import DEPENDENT, append, hold, release
from redres_ros.kernels.compiled import compiled, inlined
from redres_ros.kernels.search import (
    BEHIND,
    COUNT,
    FIXED,
    FREE,
    HELD,
    LOWER,
    ROUNDING,
    SIDE,
    STATE,
    UPPER,
    Q,
    R,
    Search,
)
from redres_ros.kernels.step import RANK, step

MAX_STEPS = 200  # of one level; ten are many
BY_INDEX = 60  # from this step on the lowest index decides, which cannot cycle (Bland)
WRONG = 1e-14  # a force of the wrong sign counts from this share of the gradient's terms on
TIGHT = 1e-10  # one of the right sign proves its limit tight from this share on


@inlined
def minimise(search: Search, A: np.ndarray, a: np.ndarray) -> tuple[np.ndarray, float, bool]:
    """Move z to the least |A z - a| within the limits.

    Returns:
        The forces of the rows (d,), the least that proves a limit tight, and whether z got there.
    """
    for count in range(MAX_STEPS):
        if advance(search, step(search, A, a)):
            continue
        force, largest = forces(search, A, a)
        k = most_wrong(search, force, WRONG * largest, count > BY_INDEX)
        if k < 0:
            return force, TIGHT * largest, True
        release(search, k)
    return np.zeros(len(search.z)), 1.0, False


@compiled()
def advance(search: Search, p: np.ndarray) -> bool:
    """Move z along p as far as the limits allow; hold the one that stops it, False for none."""
    z = search.z
    largest = 0.0
    for j in range(len(p)):
        largest = max(largest, abs(p[j]))
    share = 1.0
    first = -1
    along = 0.0
    for i in range(len(search.G)):
        if search.marks[STATE, i] != FREE:
            continue
        slope = 0.0
        value = 0.0
        noise = largest
        for j in range(len(z)):
            slope += search.G[i, j] * p[j]
            value += search.G[i, j] * z[j]
            noise += abs(search.G[i, j] * z[j])
        room = search.ends[UPPER, i] - value if slope > 0.0 else value - search.ends[LOWER, i]
        speed = abs(slope)
        if speed <= 10.0 * DEPENDENT * largest or speed <= room + ROUNDING * noise:
            continue
        if share * speed > room:
            share = max(room, 0.0) / speed
            first = i
            along = slope
    for j in range(len(z)):
        z[j] += share * p[j]
    if first >= 0:
        hold(search, first, along)
    return first >= 0


@compiled()
def forces(search: Search, A: np.ndarray, a: np.ndarray) -> tuple[np.ndarray, float]:
    """How hard each row resists the descent: A' (A z - a) + sum_k force_k row_k = 0 at the least.

    Returns:
        The forces (d,), and the largest term of the gradient, beside which rounding is judged.
    """
    d = len(search.z)
    g = np.zeros(d)
    fastest = 0.0
    for j in range(search.n):
        fastest = max(fastest, abs(search.z[j]))
    largest = 0.0
    for i in range(len(A)):
        rest = -a[i]
        size = abs(a[i])
        for j in range(d):
            rest += A[i, j] * search.z[j]
            # A slack variable is a difference of velocities.
            size += abs(A[i, j]) * (fastest if j > search.n else abs(search.z[j]))
        for j in range(d):
            g[j] += A[i, j] * rest
            largest = max(largest, abs(A[i, j]) * size)
    count = search.marks[COUNT, 1]
    force = np.zeros(d)
    for k in range(count - 1, -1, -1):
        total = -dot(search.basis[Q, k], g)
        for j in range(k + 1, count):
            total -= search.basis[R, j, k] * force[j]
        force[k] = total / search.basis[R, k, k]
    return force, largest


@compiled()
def most_wrong(search: Search, force: np.ndarray, least: float, by_index: bool) -> int:
    """The row that keeps z from where it wants to go inside the limits, -1 for none.

    Of several it is the one with the largest force, or that of the first limit.
    """
    marks = search.marks
    found = -1
    for k in range(marks[COUNT, 0], marks[COUNT, 1]):
        i = marks[BEHIND, k]
        pull = -force[k] * marks[SIDE, i]
        if by_index and found >= 0 and i > marks[BEHIND, found]:
            continue
        if pull > least:
            found = k
            if not by_index:
                least = pull
    return found


@inlined
def hardest_of(search: Search, force: np.ndarray, tight: float) -> int:
    """The limit with the largest force of those that are tight, but the share's; -1 for none."""
    marks = search.marks
    hardest = -1
    largest = tight
    for k in range(marks[COUNT, 0], marks[COUNT, 1]):
        i = marks[BEHIND, k]
        push = force[k] * marks[SIDE, i]
        if push > largest and i != search.n:
            largest = push
            hardest = i
    return hardest


@inlined
def fix_level(search: Search, A: np.ndarray, force: np.ndarray, tight: float) -> None:
    """Fix A z and the limits that are tight; other held limits stay held."""
    marks = search.marks
    fixed = marks[COUNT, 0]
    held = marks[BEHIND, fixed : marks[COUNT, 1]].copy()
    marks[COUNT, 1] = fixed
    for k in range(len(held)):
        i = held[k]
        if force[fixed + k] * marks[SIDE, i] > tight:
            hold(search, i, float(marks[SIDE, i]))
    square = 0.0
    for i in range(len(A)):
        square = max(square, dot(A[i], A[i]))
    for i in range(len(A)):
        append(search, A[i], RANK * np.sqrt(square))
    marks[COUNT, 0] = marks[COUNT, 1]
    for k in range(len(held)):
        i = held[k]
        if marks[STATE, i] == HELD:
            if force[fixed + k] * marks[SIDE, i] > tight:
                marks[STATE, i] = FIXED
            else:
                hold(search, i, float(marks[SIDE, i]))
