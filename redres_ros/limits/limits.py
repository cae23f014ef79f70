"""Several limits kept together: one box and the other rows, in order of priority."""

from collections.abc import Iterable, Iterator
from typing import NamedTuple

import numpy as np

from redres_ros.bounded import Bounded, Box, Rows
from redres_ros.limits.braking import TOUCHING, narrow
from redres_ros.limits.limit import BoxLimit, Limit, ReferenceState, RowLimit

UPPER = 1  # the place of the upper bound in a box


class Bounds(NamedTuple):
    """What the limits say at one state."""

    box: Box  # lower, upper, (n,) [rad/s]
    rows: list[Rows]  # in order of priority
    kept: bool  # False where a joint cannot keep every box, and goes as near to them as it may
    box_limits: tuple[BoxLimit, ...]  # what the box comes from, in order
    boxes: list[Box]
    row_limits: tuple[RowLimit, ...]  # what the rows come from, in order

    def limiting(self, bounded: Bounded) -> tuple[Limit, int] | None:
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
        distances = [abs(box[end][joint] - self.box[end][joint]) for box in self.boxes]
        return self.box_limits[int(np.argmin(distances))]


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

    def __iter__(self) -> Iterator[Limit]:
        yield from self._boxes
        yield from self._rows

    def __len__(self) -> int:
        return len(self._boxes) + len(self._rows)

    def at(self, state: ReferenceState, T: float) -> Bounds:
        """What they say at a state, for a sampling time T [s]."""
        boxes = [limit.box(state, T) for limit in self._boxes]
        rows = [limit.rows(state, T) for limit in self._rows]
        kept = True
        if boxes:
            lower = boxes[0][0].copy()
            upper = boxes[0][1].copy()
        else:
            lower = np.full(len(state.q), -np.inf)
            upper = -lower
        for least, most in boxes[1:]:
            kept = narrow(lower, upper, least, most) and kept
        return Bounds((lower, upper), rows, kept, self._boxes, boxes, self._rows)
