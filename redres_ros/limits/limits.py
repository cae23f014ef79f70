"""Several limits together: one box and the other rows, in order of priority."""

from collections.abc import Iterable, Iterator, Sequence
from typing import NamedTuple

import numpy as np

from redres_ros.constrained import Box, Constrained, Rows, keeps_rows, solve_constrained
from redres_ros.kernels.boxes import GIVEN, POSITION, fill_boxes, keeps_boxes
from redres_ros.limits.joint import AccelerationLimit, JointLimit
from redres_ros.limits.limit import BoxLimit, Limit, ReferenceState, RowLimit
from redres_ros.resolution import Level, Weight

UPPER = 1  # the place of the upper bound in a box


class Bounds(NamedTuple):
    """The bounds at one state."""

    box: Box  # lower, upper, (n,) [rad/s]
    rows: list[Rows]  # in order of priority
    kept: bool  # False where a joint cannot keep every box, and goes as near to them as it may
    box_limits: tuple[BoxLimit, ...]  # what the box comes from, in order
    boxes: np.ndarray  # (k, 2, n)
    row_limits: tuple[RowLimit, ...]  # what the rows come from, in order

    def acting_limit(self, bounded: Constrained) -> tuple[Limit, int] | None:
        """The limit that resists hardest, and its joint or row; None where none does."""
        index = bounded.limiting
        n = len(self.box[0])
        if index < 0:
            return None
        if index < n:
            return self._nearest(index, bounded.side), index
        index -= n
        for limit, (C, _, _) in zip(self.row_limits, self.rows, strict=True):
            if index < len(C):
                return limit, index
            index -= len(C)
        return None

    def _nearest(self, joint: int, side: int) -> BoxLimit:
        """The limit to which a joint's bound is due."""
        end = UPPER if side > 0 else 0
        bound = float(self.box[end][joint])
        distances = [abs(value - bound) for value in self.boxes[:, end, joint].tolist()]
        return self.box_limits[distances.index(min(distances))]


class Limits:
    """Limits that are kept together.

    The boxes are intersected in their order, acceleration, velocity, position. A joint for which
    one has nothing in common with those before it goes as near to it as they allow. So a joint that
    is too fast or outside its range brakes, or comes back, as hard as its acceleration allows.

    Args:
        limits: in any order.
    """

    def __init__(self, limits: Iterable[Limit] = ()) -> None:
        in_order = sorted(limits, key=lambda limit: limit.order)
        self._boxes = tuple(limit for limit in in_order if isinstance(limit, BoxLimit))
        self._rows = tuple(limit for limit in in_order if isinstance(limit, RowLimit))
        self._given = [
            (k, limit) for k, limit in enumerate(self._boxes) if not isinstance(limit, JointLimit)
        ]
        self._kinds = np.array([_kind(limit) for limit in self._boxes], np.int64)
        n = in_order[0].model.n if in_order else 0
        self._figures = np.zeros((len(self._boxes), 3, n))
        for figures, limit in zip(self._figures, self._boxes, strict=True):
            if isinstance(limit, JointLimit):
                figures[:] = limit.figures
        self.acceleration: np.ndarray | None = None  # that no scale lowers, (n,) [rad/s^2]
        self.braking_limit: AccelerationLimit | None = None  # of the end of the reach
        for limit in self._boxes:
            if isinstance(limit, AccelerationLimit):
                self.acceleration = limit.A / limit.scale
                self.braking_limit = limit if limit.reach > 0.0 else None
        self.bounds_acceleration = self.acceleration is not None
        self._active_set = np.zeros(n + 1, np.int64)  # of the last tick's search

    def __iter__(self) -> Iterator[Limit]:
        yield from self._boxes
        yield from self._rows

    def __len__(self) -> int:
        return len(self._boxes) + len(self._rows)

    def keep(self, dq: np.ndarray, state: ReferenceState, T: float) -> bool:
        """Whether a velocity keeps all of them.

        Args:
            dq: (n,) [rad/s].
            state: The reference and the last command.
            T: Sampling time [s].
        """
        figures = self._figures_at(state, T)
        if not keeps_boxes(dq, state.q, state.dq_prev, T, self._kinds, figures):
            return False
        return not self._rows or keeps_rows(dq, [limit.rows(state, T) for limit in self._rows])

    def at(self, state: ReferenceState, T: float) -> Bounds:
        """Their bounds at a state.

        Args:
            state: Of the reference at this tick.
            T: Sampling time [s].
        """
        figures = self._figures_at(state, T)
        n = len(state.q)
        box = np.empty((2, n))
        boxes = np.empty((len(self._boxes), 2, n))
        kept = fill_boxes(state.q, state.dq_prev, T, self._kinds, figures, box, boxes)
        rows = [limit.rows(state, T) for limit in self._rows]
        return Bounds((box[0], box[1]), rows, kept, self._boxes, boxes, self._rows)

    def nearest(
        self,
        dq: np.ndarray,
        W: Weight,
        levels: Sequence[Level],
        state: ReferenceState,
        T: float,
    ) -> tuple[np.ndarray, float, str]:
        """The velocity within all limits that is best for the tasks, and then nearest to dq.

        Args:
            dq: (n,) [rad/s] the optimum without limits.
            W: Its metric.
            levels: (J, dx) of each task, in order of priority.
            state: The reference and the last command.
            T: Sampling time [s].

        Returns:
            The velocity, dq itself if it keeps all limits; the scaling factor s of the first task;
            and what limits most, as 'joint: limit', or ''.
        """
        bounds = self.at(state, T)
        solved = solve_constrained(dq, W, levels, bounds.box, bounds.rows, self._active_set)
        acting = bounds.acting_limit(solved)
        if solved.dq is dq or acting is None:
            return solved.dq, solved.s, ''
        from redres_ros.limits import limit_name  # whose table is made of what this package has

        limit, index = acting
        return solved.dq, solved.s, f'{limit.place(state, index, T)}: {limit_name(limit)}'

    def braked(self, dq: np.ndarray, state: ReferenceState, T: float) -> np.ndarray:
        """A velocity of an arm that is being stopped, (n,) [rad/s].

        Every joint keeps its box, and none gets faster or turns round. An obstacle that comes near
        makes all joints brake as hard as they may.

        Args:
            dq: (n,) [rad/s] the one that a soft stop asks for.
            state: The reference and the last command.
            T: Sampling time [s].
        """
        bounds = self.at(state, T)
        lower, upper = bounds.box
        slower = _towards_zero(np.clip(dq, lower, upper), state.dq_prev)
        for limit, (C, _, high) in zip(self._rows, bounds.rows, strict=True):
            if limit.holds_in_a_stop and not (C.dot(slower) <= high).all():
                return _towards_zero(np.clip(np.zeros(len(dq)), lower, upper), state.dq_prev)
        return slower

    def _figures_at(self, state: ReferenceState, T: float) -> np.ndarray:
        """What the boxes are computed from, (k, 3, n)."""
        figures = self._figures
        for k, limit in self._given:
            figures[k, :2] = limit.box(state, T)
        if state.gap == 1:
            return figures
        # Each command changes a velocity by A T. With one command in `gap` cycles a joint stops
        # within d from the speed from which it otherwise stops within d / gap.
        figures = figures.copy()
        for k in np.flatnonzero(self._kinds == POSITION).tolist():
            figures[k, :2] = state.q + (figures[k, :2] - state.q) / state.gap
        return figures


def _towards_zero(dq: np.ndarray, dq_prev: np.ndarray) -> np.ndarray:
    """dq where it lies between zero and the last velocity, else the nearer of these two, (n,)."""
    return np.clip(dq, np.minimum(dq_prev, 0.0), np.maximum(dq_prev, 0.0))


def _kind(limit: BoxLimit) -> int:
    return limit.kind if isinstance(limit, JointLimit) else GIVEN
