"""A task velocity whose components, translation and rotation, have scaling factors of their own.

One factor s for all of dx keeps a path (solver.py). An operator prefers an arm that continues with
what is possible. The larger component that is asked for leads. The other one follows: it is asked
for, too, or held (loop/holding.py). With c its velocity, in order of priority:

1. J_f dq = beta c of the one that follows, with 0 <= beta <= 1;
2. the direction of the leading one, to DIRECTION_TOLERANCE;
3. its largest velocity along that, a |dx| with a <= 1;
4. the largest beta;
5. the least velocity across the direction;
6. the other tasks, and the law.

If both are asked for, neither a nor beta is less than the factor s of the whole. The following one
comes first because joints move: in the tick in which it would have to give way, that is nearly
always necessary already. If it is only held, the leading one slides first, up to 60 degrees off. It
gives way if level 3 leaves little for a while, without the limits on accelerations. Level 1 becomes

    |J_f dq - c| <= SPREAD,   -c' J_f dq / |c| <= the speed that still ends within its cone,

and level 4 the least |J_f dq - c|. If that leaves little, too, the leading one slides up to 85
degrees off, and both creep out of these bounds, so that joints at their ends do not lock the arm.
All this is blended in. The one that is executed already counts four times as much when it is
decided which one leads: else the two might come to rest, each undoing what the other does.
"""

import math
from collections.abc import Callable, Sequence
from functools import lru_cache
from typing import NamedTuple

import numpy as np

from redres_ros.kernels.active_set import Parts
from redres_ros.resolution import Level, Weight
from redres_ros.robot_model import Correction
from redres_ros.solver import Box, Constrained, Rows, solve_constrained
from redres_ros.types import JointVelocities, Seconds

_LITTLE = 0.3  # of the leading component; with less left, the other one gives way
_HARDLY = 0.2  # the same for sliding
_NEARLY_ALL = 0.8  # the same if the other one is only held: then the leading one slides first
_SLIDING = 2.0 / 3.0  # at most until the other one gives way: 60 degrees, cos 0.5
_DELAY = 0.1  # [s] for which little must be left
# Beside a singularity the joints would have to be quick: with so much of the time waited if the
# limits on accelerations alone leave little, and taken back if they do not
_SLOW = 0.2
_BACK = 0.1
_BLEND = 0.15  # [s]
_NOTHING_HELD = Correction(np.zeros(0), np.zeros(1000, bool), np.zeros(0))  # of any task's rows
_UNSCALED = np.ones(1000)
_as_array = lru_cache(np.array)  # of int64, once for the same sizes
_NOTICEABLE = 1e-9  # an error [m/s] from which on the whole counts as not fully kept

# The first six arguments of solve_constrained()
_Problem = tuple[JointVelocities, Weight, Sequence[Level], Box, Sequence[Rows], np.ndarray | None]


class Yielding(NamedTuple):
    """How far the component that follows gives way, and the leading one slides."""

    waited: Seconds = 0.0  # for which the leading one has been left little
    weight: float = 0.0  # of giving way: 0 not at all, 1 as far as it may
    sliding: float = 0.0  # the same of the direction

    def after(self, T: Seconds, steady: float, executed: float, slides_first: bool) -> 'Yielding':
        """In the next tick, by what is left of the leading one if nothing yields, and as it is."""
        rate = -_BACK
        if steady < _LITTLE:
            rate = 1.0
        elif executed < _LITTLE:
            rate = _SLOW
        waited = min(max(self.waited + rate * T, 0.0), _DELAY)
        step = T / _BLEND
        weight = min(max(self.weight + (step if waited >= _DELAY else -step), 0.0), 1.0)
        left = executed / _NEARLY_ALL if slides_first else max(steady, executed) / _HARDLY
        sliding = self.sliding + step * max(1.0 - left, -1.0)
        most = max(_SLIDING + (1.0 - _SLIDING) * weight, self.sliding - step)
        return Yielding(waited, weight, min(max(sliding, 0.0), most))


def solve_components(
    problem: _Problem,
    components: tuple[tuple[int, ...], Correction | None, np.ndarray | None],
    steady_box: Callable[[], Box],
    dq_prev: JointVelocities,
    yielding: Yielding,
    least: float = np.nan,
) -> tuple[Constrained, tuple[float, float, bool]]:
    """As solve_constrained() of a problem, with a scaling factor for each component of the first
    task, none below `least` (NaN: that of the whole); and what Yielding.after() takes. Components:
    rows of each, what holds them, scale of rows. The steady box has no limits on accelerations.
    """
    sizes, correction, scale = components
    held = correction or _NOTHING_HELD
    executed = np.empty(len(sizes) + 1)
    row_scale = _UNSCALED if scale is None else scale
    given = _as_array(sizes), dq_prev, *held, row_scale, executed
    s = None
    solved = solve_constrained(*problem, parts=Parts(*given, *yielding[1:], least))
    *fractions, most = executed.tolist()
    if math.isnan(fractions[0]):  # the whole has been searched for
        s = solved.s
        is_exact = solved.error <= _NOTICEABLE
        if (is_exact and s >= 1.0) or not solved.error < np.inf or most == 0.0:
            solved.component_scaling = (s,) * len(sizes)
            return solved, (1.0, 1.0, False)
        least = s if is_exact and not any(yielding[1:]) else 0.0
        solved = solve_constrained(*problem, parts=Parts(*given, *yielding[1:], least))
        *fractions, most = executed.tolist()
    solved.component_scaling = tuple(fractions)
    solved.s = min(fractions) if s is None else s
    slides_first = len(sizes) == 1 or bool(held.is_held[-1])  # the orientation
    left = min(fractions) if slides_first else most
    if left >= _LITTLE and not (yielding.weight if slides_first else any(yielding[1:])):
        return solved, (left, most, slides_first)
    _, _, tasks, _, limits, _ = problem
    steady = solved.dq, None, tasks[:1], steady_box(), limits
    solve_constrained(*steady, parts=Parts(*given, 0.0, slides_first * _SLIDING, 0.0))
    return solved, (float(executed[-1]) * (0.5 if slides_first else 1.0), most, slides_first)
