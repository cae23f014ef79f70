"""Several limits together: one box and the other rows, in order of priority."""

from collections.abc import Iterable, Iterator
from typing import NamedTuple

import numpy as np

from redres_ros.constrained import Box, Constrained, Rows, keeps_rows
from redres_ros.kernels.boxes import GIVEN, TOUCHING, fill_boxes, keeps_boxes
from redres_ros.limits.joint import JointLimit
from redres_ros.limits.limit import BoxLimit, Limit, ReferenceState, RowLimit

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

    def broken(self) -> list[tuple[Limit, int]]:
        """Each limit and joint for which no velocity in the box is enough: the arm is outside."""
        lower, upper = self.box
        found: list[tuple[Limit, int]] = []
        for limit, (least, most) in zip(self.box_limits, self.boxes, strict=True):
            joints = np.flatnonzero((least > upper + TOUCHING) | (most < lower - TOUCHING))
            found.extend((limit, joint) for joint in joints.tolist())
        return found

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
        if self._given:
            self._fill_in(state, T)
        if not keeps_boxes(dq, state.q, state.dq_prev, T, self._kinds, self._figures):
            return False
        return not self._rows or keeps_rows(dq, [limit.rows(state, T) for limit in self._rows])

    def at(self, state: ReferenceState, T: float) -> Bounds:
        """Their bounds at a state.

        Args:
            state: Of the reference at this tick.
            T: Sampling time [s].
        """
        self._fill_in(state, T)
        n = len(state.q)
        box = np.empty((2, n))
        boxes = np.empty((len(self._boxes), 2, n))
        kept = fill_boxes(state.q, state.dq_prev, T, self._kinds, self._figures, box, boxes)
        rows = [limit.rows(state, T) for limit in self._rows]
        return Bounds((box[0], box[1]), rows, kept, self._boxes, boxes, self._rows)

    def _fill_in(self, state: ReferenceState, T: float) -> None:
        """Ask the limits that say themselves what their box is."""
        for k, limit in self._given:
            self._figures[k, :2] = limit.box(state, T)


def _kind(limit: BoxLimit) -> int:
    return limit.kind if isinstance(limit, JointLimit) else GIVEN
