"""A task velocity whose components, translation and rotation, have scaling factors of their own.

A path must keep its direction: one factor s for all of dx (solver.py). An operator prefers an arm
that continues with what is possible. The larger component that is asked for leads. The other one
follows: it is asked for, too, or held (loop/pose_hold.py). With c its velocity, in order of
priority, each level as well as the higher ones allow:

1. J_f dq = beta c of the one that follows, with 0 <= beta <= 1;
2. the direction of the leading one, to DIRECTION_TOLERANCE;
3. its largest velocity along that, a |dx| with a <= 1;
4. the largest beta;
5. the least velocity across the direction;
6. the other tasks, and the law.

If both are asked for, neither a nor beta is less than the factor s of the whole. The following one
comes first because joints move: in the tick in which it would have to give way, that is nearly
always necessary already. It gives way if level 3 leaves little for a while (Yielding), judged
without the limits on accelerations. Level 1 then becomes

    |J_f dq - c| <= SPREAD,   -c' J_f dq / |c| <= the speed that still ends within its cone,

and level 4 the least |J_f dq - c|. If that leaves little, too, the leading one slides along what
stops it, and at last both creep out of these bounds, so that an arm whose joints are at their ends
does not lock. All this is blended in: bounds widen. A component that the arm executes already
counts _LEAD times as much: else the two might come to rest where both are of one size, each undoing
what the other does.
"""

import math
from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np

from redres_ros.kernels.closed_form import fill_rates
from redres_ros.resolution import Level, Weight
from redres_ros.robot_model import Correction
from redres_ros.solver import Box, Constrained, Rows, solve_constrained
from redres_ros.types import Jacobian, JointVelocities, Seconds

DIRECTION_TOLERANCE = float(np.radians(10.0))  # [rad] of what is left of a component
_SLIDING_TOLERANCE = float(np.radians(85.0))  # [rad], if it leaves nothing
SPREAD = 0.7  # [rad/s] by which a component that gives way may differ from its velocity
RADIUS = 0.25  # [m] at which a turn counts as a speed
_LEAD = 4.0  # by which another component must be larger to take over from the one that goes on

_LITTLE = 0.3  # of the leading component; with less left, the other one gives way
_HARDLY = 0.2  # the same for sliding
_DELAY = 0.1  # [s] for which little must be left
# Beside a singularity the joints would have to be quick: with so much of the time waited if the
# limits on accelerations alone leave little, and taken back if they do not
_SLOW = 0.2
_BACK = 0.1
_BLEND = 0.15  # [s]
_CREEP = 0.05, 0.02  # of its velocity the leading one, of its spread the other one

_NOTICEABLE = 1e-9  # an error [m/s] or an excess from which on a level counts as not fully kept
_NOTHING = 1e-9  # of dx; a component with less is not asked for


class Yielding(NamedTuple):
    """How far the component that follows gives way, and the leading one slides."""

    waited: Seconds = 0.0  # for which the leading one has been left little
    weight: float = 0.0  # of giving way: 0 not at all, 1 as far as it may
    sliding: float = 0.0  # the same of the direction

    def after(self, steady: float, executed: float, T: Seconds) -> 'Yielding':
        """In the next tick, by what is left of the leading component: by the steady box if nothing
        gives way, and as it is.
        """
        rate = -_BACK
        if steady < _LITTLE:
            rate = 1.0
        elif executed < _LITTLE:
            rate = _SLOW
        waited = min(max(self.waited + rate * T, 0.0), _DELAY)
        step = T / _BLEND
        weight = self.weight + (step if waited >= _DELAY else -step)
        sliding = self.sliding
        if steady >= _HARDLY or executed > _LITTLE:
            sliding -= step
        elif executed < _HARDLY:
            sliding += step
        return Yielding(waited, min(max(weight, 0.0), 1.0), min(max(sliding, 0.0), 1.0))


class _Component(NamedTuple):
    """The rows of one component."""

    rates: Jacobian  # of the tip along its velocity, and in the directions across it
    length: float  # of its velocity
    is_asked: bool
    spread: float
    away: float

    def fraction(self, dq: JointVelocities) -> float:
        """That is executed along it; 1 if it is not asked for."""
        if not self.is_asked:
            return 1.0
        return min(max(float(self.rates[0].dot(dq)) / self.length, 0.0), 1.0)


def split_components(
    task: Level,
    sizes: Sequence[int],
    correction: Correction | None,
    scale: np.ndarray | None = None,
) -> list[_Component]:
    """The components of a task, of so many rows, which are scaled."""
    noise = _NOTHING * math.sqrt(task[1].dot(task[1]))
    components = []
    begin = 0
    for size in sizes:
        rows = slice(begin, begin + size)
        J = task[0][rows]
        velocity = task[1][rows]
        factor = 1.0 if scale is None else float(scale[begin])
        spread = SPREAD * factor * (RADIUS if len(sizes) > 1 and not begin else 1.0)
        away = np.inf
        is_held = correction is not None and bool(correction.is_held[begin])
        if correction is not None and is_held:
            velocity = factor * correction.velocity[rows]
            away = factor * float(correction.away[begin])
        rates = np.empty(J.shape)
        length = fill_rates(J, velocity, rates)
        is_asked = not is_held and length > noise
        components.append(_Component(rates, length, is_asked, spread, away))
        begin += size
    return components


def solve_components(
    dq_free: JointVelocities,
    W: Weight,
    tasks: Sequence[Level],
    box: Box,
    rows: Sequence[Rows],
    active_sets: np.ndarray,
    components: Sequence[_Component],
    steady_box: Callable[[], Box],
    dq_prev: JointVelocities,
    yielding: Yielding,
) -> tuple[Constrained, float, float]:
    """As solve_constrained(), with a scaling factor for each component of the first task; and what
    Yielding.after() takes. The steady box is that without the limits on accelerations; each of the
    first two searches has a row of `active_sets`.
    """
    asked = [component for component in components if component.is_asked]
    least = 0.0
    s = None
    if len(asked) == len(components) or not asked:
        whole = solve_constrained(dq_free, W, tasks, box, rows, active_sets[0])
        is_exact = whole.error <= _NOTICEABLE
        if (is_exact and whole.s >= 1.0) or not np.isfinite(whole.error) or not asked:
            whole.component_scaling = (whole.s,) * len(components)
            return whole, 1.0, 1.0
        s = whole.s
        least = s if is_exact and not any(yielding[1:]) else 0.0
    leading = max(asked, key=lambda each: (1 + (_LEAD - 1) * each.fraction(dq_prev)) * each.length)
    following = [component for component in components if component is not leading]
    counts = [len(low) for _, low, _ in rows]
    own, level, groups, sizes = _searched(leading, following, yielding, least)
    how = [*rows, own], active_sets[1], sizes + [len(dx) for _, dx in tasks[1:]], counts + groups
    solved = solve_constrained(dq_free, W, [level, *tasks[1:]], box, *how)
    solved.component_scaling = tuple(component.fraction(solved.dq) for component in components)
    solved.s = min(solved.component_scaling) if s is None else s
    executed = leading.fraction(solved.dq) / _speed(yielding.sliding)
    if executed >= _LITTLE and not any(yielding[1:]):
        return solved, executed, executed
    own, (A, a), groups, _ = _searched(leading, following, Yielding(), 0.0)
    # Level 3 alone, and then what is nearest to where the search begins: that is found soonest
    problem = solved.dq, None, [(A[:1], a[:1])], steady_box(), [*rows, own]
    steady = solve_constrained(*problem, None, (0, 1), counts + groups)
    return solved, leading.fraction(steady.dq), executed


def _searched(
    leading: _Component, following: Sequence[_Component], yielding: Yielding, least: float
) -> tuple[Rows, Level, list[int], list[int]]:
    """Rows and levels, where no component that is asked for has less than a factor; how many rows
    each group has, and each level.
    """
    weight = yielding.weight
    stuck = weight * yielding.sliding
    rates = leading.rates
    most = _speed(yielding.sliding) * leading.length
    C = []
    low = []
    high = []
    A = [rates[:1]]
    a = [most]
    sizes = [0, 1]
    for each in following:
        size = len(each.rates)
        spread = weight * each.spread / math.sqrt(size)  # a cube
        lowest = min(each.length - spread, least * each.length if each.is_asked else 0.0)
        if weight:
            lowest = max(lowest, -each.away)
        if stuck:
            lowest = min(lowest, -_CREEP[1] * stuck * each.spread)
        C.append(each.rates)
        low += [lowest, *(-spread,) * (size - 1)]
        high += [each.length + spread, *(spread,) * (size - 1)]
        sizes.append(size if weight else 1)
        A.append(each.rates[: sizes[-1]])
        a += [each.length, *(0.0,) * (sizes[-1] - 1)]
    groups = [*map(len, C), 2 * len(rates) - 1]
    across = rates[1:]
    count = len(across)
    along = math.tan(_tolerance(yielding.sliding)) / math.sqrt(max(count, 1)) * rates[0]
    C += [rates[:1], across - along, -across - along]  # a pyramid
    creep = _CREEP[0] * stuck * leading.length
    low += [least * leading.length - creep, *(-np.inf,) * (2 * count)]
    high += [most, *(creep,) * (2 * count)]
    level = np.concatenate((*A, across)), np.array((*a, *(0.0,) * count))
    return (np.concatenate(C), np.array(low), np.array(high)), level, groups, [*sizes, count]


def _tolerance(sliding: float) -> float:
    return DIRECTION_TOLERANCE + sliding * (_SLIDING_TOLERANCE - DIRECTION_TOLERANCE)


def _speed(sliding: float) -> float:
    """As a fraction of the velocity: with what goes across, the tip is no faster than asked."""
    return math.cos(_tolerance(sliding)) / math.cos(DIRECTION_TOLERANCE)
