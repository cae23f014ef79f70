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
counts four times as much: else the two might come to rest, each undoing what the other does.
"""

from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np

from redres_ros.resolution import Level, Weight
from redres_ros.robot_model import Correction
from redres_ros.solver import Box, Constrained, Rows, solve_constrained
from redres_ros.types import JointVelocities, Seconds

_LITTLE = 0.3  # of the leading component; with less left, the other one gives way
_HARDLY = 0.2  # the same for sliding
_DELAY = 0.1  # [s] for which little must be left
# Beside a singularity the joints would have to be quick: with so much of the time waited if the
# limits on accelerations alone leave little, and taken back if they do not
_SLOW = 0.2
_BACK = 0.1
_BLEND = 0.15  # [s]
_NOTHING_HELD = Correction(np.zeros(0), np.zeros(1000, bool), np.zeros(0))  # of any task's rows
_UNSCALED = np.ones(1000)
_NOTICEABLE = 1e-9  # an error [m/s] from which on the whole counts as not fully kept

# The first six arguments of solve_constrained()
_Problem = tuple[JointVelocities, Weight, Sequence[Level], Box, Sequence[Rows], np.ndarray | None]


class Yielding(NamedTuple):
    """How far the component that follows gives way, and the leading one slides."""

    waited: Seconds = 0.0  # for which the leading one has been left little
    weight: float = 0.0  # of giving way: 0 not at all, 1 as far as it may
    sliding: float = 0.0  # the same of the direction

    def after(self, steady: float, executed: float, T: Seconds) -> 'Yielding':
        """In the next tick, by what is left of the leading one if nothing yields, and as it is."""
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


def solve_components(
    problem: _Problem,
    components: tuple[Sequence[int], Correction | None, np.ndarray | None],
    steady_box: Callable[[], Box],
    dq_prev: JointVelocities,
    yielding: Yielding,
    least: float = np.nan,
) -> tuple[Constrained, float, float]:
    """As solve_constrained() of a problem, with a scaling factor for each component of the first
    task, none below `least` (NaN: that of the whole); and what Yielding.after() takes. Components:
    rows of each, what holds them, scale of rows. The steady box has no limits on accelerations.
    """
    sizes, correction, scale = components
    executed = np.empty(len(sizes) + 1)
    rows = *(correction or _NOTHING_HELD), _UNSCALED if scale is None else scale
    parts = np.array(sizes, np.int64), dq_prev, *rows, executed
    s = None
    solved = solve_constrained(*problem, parts=(*parts, *yielding[1:], least))
    *fractions, most = executed.tolist()
    if fractions[0] != fractions[0]:  # the whole has been searched for
        s = solved.s
        is_exact = solved.error <= _NOTICEABLE
        if (is_exact and s >= 1.0) or not solved.error < np.inf or most == 0.0:
            solved.component_scaling = (s,) * len(sizes)
            return solved, 1.0, 1.0
        least = s if is_exact and not any(yielding[1:]) else 0.0
        solved = solve_constrained(*problem, parts=(*parts, *yielding[1:], least))
        *fractions, most = executed.tolist()
    solved.component_scaling = tuple(fractions)
    solved.s = min(fractions) if s is None else s
    if most >= _LITTLE and not any(yielding[1:]):
        return solved, most, most
    _, _, tasks, _, limits, _ = problem
    steady = solved.dq, None, tasks[:1], steady_box(), limits
    solve_constrained(*steady, parts=(*parts, 0.0, 0.0, 0.0))
    return solved, float(executed[-1]), most
