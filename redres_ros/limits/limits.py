"""Several limits together: one box and the other rows, in order of priority."""

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from redres_ros.kernels.boxes import GIVEN, fill_boxes, stopping_speed, within
from redres_ros.limits.component_scaling import executed_fractions, solve_components
from redres_ros.limits.joint import AccelerationLimit, JerkLimit, JointLimit
from redres_ros.limits.limit import BoxLimit, Limit, ReferenceState, RowLimit
from redres_ros.resolution import Level, Weight
from redres_ros.solver import Box, Constrained, Rows, solve_constrained

_AT_REST = 1e-12  # [rad/s]
_FASTEST = 100.0  # [rad/s] of a joint without a limit
_UPPER = 1  # the place of the upper bound in a box
_SHARES = (0.5, 0.25, 0.125, 0.0)  # of a velocity mixed with that of braking, tried in this order


@dataclass(slots=True)  # made in every tick
class Bounds:
    """The bounds of all limits at one state.

    Attributes:
        limits: Where they come from.
        state: The reference and the last command.
        T: Sampling time [s].
        boxes: (k + 1, 2, n) of each box limit, and last the one in all of them [rad/s].
        rows: Of each row limit.
        kept: False where a joint cannot keep every box, and goes as near to them as it may.
    """

    limits: 'Limits'
    state: ReferenceState
    T: float
    boxes: np.ndarray
    rows: list[Rows]
    kept: bool

    @property
    def box(self) -> np.ndarray:
        """The velocities that all box limits allow: lower, upper, (2, n) [rad/s]."""
        return self.boxes[-1]

    def allow(self, dq: np.ndarray) -> bool:
        """Whether a velocity (n,) [rad/s] keeps them."""
        lower, upper = self.box
        if not within(dq, lower, upper):
            return False
        rows_are_kept = all(within(C.dot(dq), low, high) for C, low, high in self.rows)
        return rows_are_kept and self._can_be_kept(dq)

    def nearest(
        self,
        dq: np.ndarray,
        W: Weight,
        levels: Sequence[Level],
        components: Sequence[int] = (),
    ) -> 'tuple[Constrained, ActiveLimit | None]':
        """The velocity within the bounds that is best for the tasks, and then nearest to dq.

        Args:
            dq: (n,) [rad/s] the optimum without limits, which the bounds do not allow.
            W: Its metric.
            levels: (J, dx) of each task, in order of priority.
            components: Number of rows of each component of the first task that gets a scaling
                factor of its own; empty: one factor for all.

        Returns:
            The solution; and the limit that resists hardest, None if none does.
        """
        problem = dq, W, levels, self.box, self.rows, self.limits.active_set
        if components:
            held = _held(components, self.state.tick.correction)
            steady_box = self._steady_box()
            solved = solve_components(*problem, components, held, steady_box, self.state.dq_prev)
        else:
            solved = solve_constrained(*problem)
        if self.rows and not self._can_be_kept(solved.dq):
            solved = self._nearer_to_braking(solved, levels, components)
        if solved.limiting < 0:
            return solved, None
        return solved, ActiveLimit(self, solved.limiting, solved.side)

    def _can_be_kept(self, dq: np.ndarray) -> bool:
        """Whether the joints can brake within the limits after this velocity (n,) [rad/s]."""
        return all(limit.can_be_kept(dq, self.state, self.T) for limit in self.limits.row_limits)

    def _nearer_to_braking(
        self, solved: Constrained, levels: Sequence[Level], components: Sequence[int]
    ) -> Constrained:
        """A solution between the one that keeps the rows and braking, for which the joints can
        still brake.

        Args:
            solved: The one that keeps the rows.
            levels: (J, dx) of each task.
            components: As of nearest().
        """
        braking = self.limits.slower(np.zeros(len(solved.dq)), self.box, self.state, self.T)
        for share in _SHARES:
            dq = braking + share * (solved.dq - braking)
            if self._can_be_kept(dq):
                break
        _, dx = levels[0]
        shares = executed_fractions(levels[0], components or (len(dx),), dq)
        return replace(solved, dq=dq, s=min(shares), component_scaling=shares if components else ())

    def _steady_box(self) -> Box:
        """The box without the limits on accelerations, in which a joint may also stand still."""
        lower = np.full(len(self.state.q), -_FASTEST)
        upper = np.full(len(self.state.q), _FASTEST)
        for limit, (low, high) in zip(self.limits.box_limits, self.boxes, strict=False):
            if not isinstance(limit, (AccelerationLimit, JerkLimit)):
                lower = np.clip(low, lower, 0.0)
                upper = np.clip(high, 0.0, upper)
        return lower, upper


@dataclass(slots=True)  # made in every tick in which limits act
class ActiveLimit:
    """The limit that resists hardest. Which one it is, is found on request.

    Attributes:
        bounds: Of all limits.
        index: Number of the bound: joints first, then rows.
        side: +1 for its upper end, -1 for its lower one.
    """

    bounds: Bounds
    index: int
    side: int

    @property
    def limit(self) -> tuple[Limit, int]:
        """The limit, and the number of its joint or row."""
        limits = self.bounds.limits
        index = self.index
        n = len(self.bounds.state.q)
        if index < n:
            *ends, end = self.bounds.boxes[:, _UPPER if self.side > 0 else 0, index].tolist()
            distances = [abs(each - end) for each in ends]
            return limits.box_limits[distances.index(min(distances))], index
        index -= n
        which = 0
        while index >= len(self.bounds.rows[which][0]):
            index -= len(self.bounds.rows[which][0])
            which += 1
        return limits.row_limits[which], index

    @property
    def name(self) -> str:
        """'joint: limit'."""
        limit, index = self.limit
        place = limit.place(self.bounds.state, index, self.bounds.T)
        return f'{place}: {self.bounds.limits.names[limit]}'

    @property
    def escape(self) -> np.ndarray:
        """The direction (n,) that leads away from it."""
        n = len(self.bounds.state.q)
        rows = np.concatenate((np.eye(n), *(C for C, _, _ in self.bounds.rows)))
        return -self.side * rows[self.index]


class Limits:
    """Limits that are kept together.

    The boxes are intersected in their order, acceleration, velocity, position. A joint for which
    one has nothing in common with those before it goes as near to it as they allow. So a joint that
    is too fast or outside its range brakes, or comes back, as hard as its acceleration allows.

    Args:
        limits: in any order.
    """

    def __init__(self, limits: Iterable[Limit] = ()) -> None:
        from redres_ros.limits import limit_name  # whose table is made of what this package has

        in_order = sorted(limits, key=lambda limit: limit.order)
        self.box_limits = tuple(limit for limit in in_order if isinstance(limit, BoxLimit))
        self.row_limits = tuple(limit for limit in in_order if isinstance(limit, RowLimit))
        self.names = {limit: limit_name(limit) for limit in in_order}
        self._kinds = np.array([_kind(limit) for limit in self.box_limits], np.int64)
        self._given = np.flatnonzero(self._kinds == GIVEN).tolist()
        n = in_order[0].model.n if in_order else 0
        self._figures = np.zeros((len(self.box_limits), 3, n))
        self._boxes = np.empty((len(self.box_limits) + 1, 2, n))  # of the last state
        for figures, limit in zip(self._figures, self.box_limits, strict=True):
            if isinstance(limit, JointLimit):
                figures[:] = limit.figures
        self.acceleration: np.ndarray | None = None  # that no scale lowers, (n,) [rad/s^2]
        self.jerk: np.ndarray | None = None  # (n,) [rad/s^3]
        self.braking_limit: AccelerationLimit | None = None  # of the end of the reach
        for limit in self.box_limits:
            if isinstance(limit, AccelerationLimit):
                self.acceleration = limit.A / limit.scale
                self.braking_limit = limit if limit.reach > 0.0 else None
            if isinstance(limit, JerkLimit):
                self.jerk = limit.J
        self.bounds_acceleration = self.acceleration is not None or self.jerk is not None
        self.active_set = np.zeros(n + 1, np.int64)  # of the last tick's search

    def __iter__(self) -> Iterator[Limit]:
        yield from self.box_limits
        yield from self.row_limits

    def __len__(self) -> int:
        return len(self.names)

    def at(self, state: ReferenceState, T: float) -> Bounds:
        """Their bounds at a state.

        Args:
            state: The reference and the last command.
            T: Sampling time [s].
        """
        kept, _ = self._fill_boxes(state.dq_prev, state, T)
        return self._bounds(state, T, kept)

    def violated(self, dq: np.ndarray, state: ReferenceState, T: float) -> Bounds | None:
        """Their bounds at a state, if a velocity does not keep them all; None if it does.

        Args:
            dq: (n,) [rad/s].
            state: The reference and the last command.
            T: Sampling time [s].
        """
        kept, is_inside = self._fill_boxes(dq, state, T)
        if is_inside and self._are_rows_kept(dq, state, T):
            return None
        bounds = self._bounds(state, T, kept)
        return None if is_inside and bounds.allow(dq) else bounds

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
        slower = self.slower(dq, bounds.box, state, T)
        for limit, (C, _, high) in zip(self.row_limits, bounds.rows, strict=True):
            if limit.holds_in_a_stop and not (
                (C.dot(slower) <= high).all() and limit.can_be_kept(slower, state, T)
            ):
                return self.slower(np.zeros(len(dq)), bounds.box, state, T)
        return slower

    def slower(self, dq: np.ndarray, box: Box, state: ReferenceState, T: float) -> np.ndarray:
        """dq (n,) [rad/s] in the box, with no joint faster than before, or turning round.

        Under a limit on the jerk it may be, until its acceleration has come to zero.

        Args:
            dq: (n,) [rad/s].
            box: That of all box limits at this state.
            state: The reference and the last command.
            T: Sampling time [s].
        """
        v = state.dq_prev
        if self.jerk is None:
            return _between(np.clip(dq, *box), np.zeros(len(v)), v)
        slowest = np.array(
            [dq - T * stopping_speed(dq, J, T) for dq, J in zip(v, self.jerk, strict=True)]
        )
        slowest[np.abs(slowest) < _AT_REST] = 0.0
        return np.clip(_between(dq, slowest, v), *box)

    def _are_rows_kept(self, dq: np.ndarray, state: ReferenceState, T: float) -> bool:
        """Whether a velocity keeps all limits that are rows, as far as they can say it quickly."""
        for limit in self.row_limits:  # noqa: SIM110 (a generator takes as long as what it asks)
            if not limit.is_kept(dq, state, T):
                return False
        return True

    def _bounds(self, state: ReferenceState, T: float, kept: bool) -> Bounds:
        rows = [limit.rows(state, T) for limit in self.row_limits]
        return Bounds(self, state, T, self._boxes.copy(), rows, kept)

    def _fill_boxes(self, dq: np.ndarray, state: ReferenceState, T: float) -> tuple[bool, bool]:
        """Write the box of each limit, and last the one in all of them, into _boxes; whether every
        joint can keep all of them, and whether dq does.
        """
        if not self.names:  # of no arm, so with any number of joints
            self._boxes = np.empty((1, 2, len(dq)))
        figures = self._figures
        for k in self._given:
            figures[k, :2] = self.box_limits[k].box(state, T)
        return fill_boxes(
            dq,
            state.q,
            state.dq_prev,
            state.ddq_prev,
            T,
            self._kinds,
            figures,
            self._boxes,
            state.tick.gap,
            state.tick.longest_gap,
        )


def _between(dq: np.ndarray, a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """dq where it lies between a and b, else the nearer of these two, (n,)."""
    return np.clip(dq, np.minimum(a, b), np.maximum(a, b))


def _held(components: Sequence[int], correction: np.ndarray | None) -> list[bool]:
    """Whether each component of a task velocity is only to hold it."""
    if correction is None:
        return [False] * len(components)
    return [bool(part.any()) for part in np.split(correction, np.cumsum(components)[:-1])]


def _kind(limit: BoxLimit) -> int:
    return limit.kind if isinstance(limit, JointLimit) else GIVEN
