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
from collections.abc import Sequence
from dataclasses import replace
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
_NO_RATES = np.zeros(0)


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


class Component(NamedTuple):
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
) -> list[Component]:
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
        components.append(Component(rates, length, is_asked, spread, away))
        begin += size
    return components


def solve_components(
    dq_free: JointVelocities,
    W: Weight,
    tasks: Sequence[Level],
    box: Box,
    rows: Sequence[Rows],
    active_sets: np.ndarray,
    components: Sequence[Component],
    steady_box: Box,
    dq_prev: JointVelocities,
    yielding: Yielding,
) -> tuple[Constrained, float, float]:
    """As solve_constrained(), with a scaling factor for each component of the first task; and what
    Yielding.after() takes. The steady box is that without the limits on accelerations; each of the
    three searches has a row of `active_sets`.
    """
    asked = [component for component in components if component.is_asked]
    least = 0.0
    s = None
    if len(asked) == len(components) or not asked:
        whole = solve_constrained(dq_free, W, tasks, box, rows, active_sets[0])
        is_exact = whole.error <= _NOTICEABLE
        if (is_exact and whole.s >= 1.0) or not np.isfinite(whole.error) or not asked:
            return replace(whole, component_scaling=(whole.s,) * len(components)), 1.0, 1.0
        s = whole.s
        least = s if is_exact else 0.0
    leading = max(asked, key=lambda each: (1 + (_LEAD - 1) * each.fraction(dq_prev)) * each.length)
    following = [component for component in components if component is not leading]
    problem = _Problem(dq_free, W, tasks[1:], box, rows, leading, following)
    solved = problem.solved(yielding, least, active_sets[1])
    executed = leading.fraction(solved.dq) / _speed(yielding.sliding)
    steady = executed
    if executed < _LITTLE or yielding.weight or yielding.sliding:
        problem = problem._replace(W=None, tasks=(), box=steady_box)
        steady = leading.fraction(problem.solved(Yielding(), 0.0, active_sets[2]).dq)
    solved.component_scaling = tuple(component.fraction(solved.dq) for component in components)
    solved.s = min(solved.component_scaling) if s is None else s
    return solved, steady, executed


class _Problem(NamedTuple):
    """Limits and tasks, and what comes in place of the first one."""

    dq_free: JointVelocities
    W: Weight
    tasks: Sequence[Level]
    box: Box
    rows: Sequence[Rows]
    leading: Component
    following: Sequence[Component]

    def solved(self, yielding: Yielding, least: float, active_set: np.ndarray) -> Constrained:
        """The optimum, where no component that is asked for has less than a factor."""
        weight = yielding.weight
        stuck = weight * yielding.sliding
        rates = self.leading.rates
        most = _speed(yielding.sliding) * self.leading.length
        if weight or yielding.sliding:
            least = 0.0
        rows = list(self.rows)
        levels = [(rates[:0], _NO_RATES), (rates[:1], np.array((most,)))]
        for each in self.following:
            spread = weight * each.spread / math.sqrt(len(each.rates))  # a cube
            low = [-spread] * len(each.rates)
            low[0] = min(each.length - spread, least * each.length if each.is_asked else 0.0)
            if weight:
                low[0] = max(low[0], -each.away)
            if stuck:
                low[0] = min(low[0], -_CREEP[1] * stuck * each.spread)
            high = [spread] * len(each.rates)
            high[0] += each.length
            rows.append((each.rates, np.array(low), np.array(high)))
            count = len(low) if weight else 1
            levels.append((each.rates[:count], np.array((each.length, 0.0, 0.0))[:count]))
        count = len(rates) - 1
        slope = math.tan(_tolerance(yielding.sliding)) / math.sqrt(max(count, 1))
        along = slope * rates[0]
        cone = np.concatenate((rates[:1], rates[1:] - along, -rates[1:] - along))  # a pyramid
        creep = _CREEP[0] * stuck * self.leading.length
        low = [least * self.leading.length - creep, *(-np.inf,) * (2 * count)]
        rows.append((cone, np.array(low), np.array((most, *(creep,) * (2 * count)))))
        levels += [(rates[1:], np.zeros(count)), *self.tasks]
        return solve_constrained(self.dq_free, self.W, levels, self.box, rows, active_set)


def _tolerance(sliding: float) -> float:
    return DIRECTION_TOLERANCE + sliding * (_SLIDING_TOLERANCE - DIRECTION_TOLERANCE)


def _speed(sliding: float) -> float:
    """As a fraction of the velocity: with what goes across, the tip is no faster than asked."""
    return math.cos(_tolerance(sliding)) / math.cos(DIRECTION_TOLERANCE)
