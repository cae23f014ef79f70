"""Several limits together: one box and the other rows, in order of priority."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from redres_ros.kernels.boxes import (
    BOXES,
    NO_LIMITS,
    VELOCITY,
    are_far,
    fill_boxes,
    stopping_speed,
    within,
)
from redres_ros.limits.component_scaling import Yielding, solve_components
from redres_ros.limits.joint import AccelerationLimit, JerkLimit
from redres_ros.limits.limit import JointLimit, Limit, ReferenceState
from redres_ros.parameter import check_once
from redres_ros.resolution import Level, Weight
from redres_ros.robot_model import RobotModel
from redres_ros.solver import Box, Constrained, Rows, solve_constrained
from redres_ros.types import JointAccelerations, JointVelocities, Seconds

_AT_REST = 1e-12  # [rad/s]
_FASTEST = 100.0  # [rad/s] of a joint without a limit
_FRACTIONS = (0.5, 0.25, 0.125, 0.0)  # of a velocity mixed with that of braking, in this order


@dataclass(slots=True)  # made in every tick
class Bounds:
    """The bounds of all limits at one state."""

    limits: 'Limits'  # where they come from
    state: ReferenceState
    T: Seconds
    boxes: np.ndarray  # (BOXES + 1, 2, n), of each joint limit, and last the one in all of them
    rows: list[Rows]  # of each other limit

    @property
    def box(self) -> np.ndarray:
        """The velocities that all joint limits allow: lower, upper, (2, n) [rad/s]."""
        return self.boxes[BOXES]

    def allow(self, dq: JointVelocities) -> bool:
        """Whether a velocity keeps them."""
        lower, upper = self.box
        if not within(dq, lower, upper):
            return False
        rows_are_kept = all(within(C.dot(dq), low, high) for C, low, high in self.rows)
        return rows_are_kept and self._can_be_kept(dq)

    def nearest(
        self,
        dq: JointVelocities,
        W: Weight,
        levels: Sequence[Level],
        components: tuple[int, ...] = (),
        scale: np.ndarray | None = None,
    ) -> tuple[Constrained, Callable[[], str] | None]:
        """The velocity within the bounds that is best for the tasks, and then nearest to dq, the
        optimum without limits; and the name of the limit that resists hardest, None if none does.

        `components` has the number of rows of each component of the first task that gets a scaling
        factor of its own; empty: one factor for all. Its rows are scaled by `scale`.
        """
        limits = self.limits
        problem = dq, W, levels, self.box, self.rows, limits.active_set
        if components:
            parts = components, self.state.tick.correction, scale
            how = self._steady_box, self.state.dq_prev, limits.yielding
            solved, left = solve_components(problem, parts, *how)
            limits.yielding = limits.yielding.after(self.T, *left)
        else:
            solved = solve_constrained(*problem)
        if self.rows and not self._can_be_kept(solved.dq):
            solved = self._nearer_to_braking(solved, levels, components)
        if solved.limiting < 0:
            return solved, None
        return solved, partial(self._name, solved.limiting, solved.side)

    def _can_be_kept(self, dq: JointVelocities) -> bool:
        """Whether the joints can brake within the limits after this velocity."""
        return all(limit.can_be_kept(dq, self.state, self.T) for limit in self.limits.row_limits)

    def _nearer_to_braking(
        self, solved: Constrained, levels: Sequence[Level], components: tuple[int, ...]
    ) -> Constrained:
        """Between a solution that keeps the rows and braking, one that can still be braked."""
        braking = self.limits.slower(np.zeros(len(solved.dq)), self.box, self.state, self.T)
        for fraction in _FRACTIONS:
            dq = braking + fraction * (solved.dq - braking)
            if self._can_be_kept(dq):
                break
        parts = components or (len(levels[0][1]),), self.state.tick.correction, None
        at_dq = dq, None, levels[:1], (dq, dq), (), None
        found, _ = solve_components(at_dq, parts, self._steady_box, dq, Yielding(), 0.0)
        scales = found.component_scaling
        return replace(solved, dq=dq, s=min(scales), component_scaling=scales if components else ())

    def _steady_box(self) -> Box:
        """The box without the limits on accelerations, in which a joint may also stand still."""
        lower = np.maximum(np.maximum.reduce(self.boxes[VELOCITY:BOXES, 0]), -_FASTEST)
        upper = np.minimum(np.minimum.reduce(self.boxes[VELOCITY:BOXES, 1]), _FASTEST)
        return np.minimum(lower, 0.0), np.maximum(upper, 0.0)

    def _name(self, index: int, side: int) -> str:
        """'joint: limit' of an upper (side 1) or lower (-1) bound: joints first, then rows."""
        limits = self.limits
        if index < limits.model.n:
            ends = self.boxes[:, (side + 1) // 2, index]
            limit: Limit = min(limits.joint_limits, key=lambda each: abs(ends[each.box] - ends[-1]))
            row = index
        else:
            starts = np.cumsum([limits.model.n, *(len(C) for C, _, _ in self.rows)])
            owner = int(np.searchsorted(starts, index, side='right')) - 1
            limit = limits.row_limits[owner]
            row = index - int(starts[owner])
        return f'{limit.name(row, self.state, self.T)}: {limits.names[limit]}'


class Limits:
    """Limits of an arm that are kept together, with the name of each.

    The boxes are intersected in their order: jerk, acceleration, velocity, position. A joint for
    which one has nothing in common with those before it goes as near to it as they allow. So a
    joint that is too fast or outside its range brakes, or comes back, as hard as it may.
    """

    def __init__(self, model: RobotModel, names: Mapping[Limit, str]) -> None:
        joint_limits = [limit for limit in names if isinstance(limit, JointLimit)]
        row_limits = [limit for limit in names if not isinstance(limit, JointLimit)]
        check_once('limit', [names[limit] for limit in joint_limits])
        self.model = model
        self.names = names
        self.joint_limits = sorted(joint_limits, key=lambda limit: limit.box)
        self.row_limits = sorted(row_limits, key=lambda limit: limit.order)
        self._joints = np.full(model.n, NO_LIMITS)
        for limit in joint_limits:
            limit._enter(self._joints)
        self._boxes = np.empty((BOXES + 1, 2, model.n))  # of the last state
        self.acceleration: JointAccelerations | None = None  # that the arm is able to
        self.allowed_acceleration: JointAccelerations | None = None
        self.jerk: np.ndarray | None = None  # that is allowed
        self.braking_limit: AccelerationLimit | None = None  # of the end of the reach
        for limit in joint_limits:
            if isinstance(limit, AccelerationLimit):
                self.acceleration = limit.A / limit.scale
                self.allowed_acceleration = limit.A
                self.acceleration.setflags(write=False)
                self.braking_limit = limit if limit.reach > 0.0 else None
            if isinstance(limit, JerkLimit):
                self.jerk = self._joints['J'].copy()
        self.bounds_acceleration = self.acceleration is not None or self.jerk is not None
        self.active_set = np.zeros(4 * model.n + 3, np.int64)  # of its searches
        self.yielding = Yielding()  # of components, after the last tick

    def __iter__(self) -> Iterator[Limit]:
        yield from self.joint_limits
        yield from self.row_limits

    def __len__(self) -> int:
        return len(self.names)

    def at(self, state: ReferenceState, T: Seconds) -> Bounds:
        """Their bounds at a state."""
        self._fill_boxes(state.dq_prev, state, T)
        return self._bounds(state, T)

    def violated(self, dq: JointVelocities, state: ReferenceState, T: Seconds) -> Bounds | None:
        """Their bounds at a state, if a velocity does not keep them all; None if it does."""
        is_far = not self.row_limits and are_far(
            dq, state.q, state.dq_prev, T, self._joints, state.tick.gap, state.tick.longest_gap
        )
        is_inside = is_far or self._fill_boxes(dq, state, T)
        if is_inside and not self.row_limits:
            if self.yielding != (0.0, 0.0, 0.0):  # any() takes twice as long
                self.yielding = self.yielding.after(T, 1.0, 1.0, False)
            return None
        bounds = self._bounds(state, T)
        return None if is_inside and bounds.allow(dq) else bounds

    def braked(self, dq: JointVelocities, state: ReferenceState, T: Seconds) -> JointVelocities:
        """A velocity of an arm that is being stopped, for the one that a soft stop asks for.

        Every joint keeps its box, and none gets faster or turns round. An obstacle that comes near
        makes all joints brake as hard as they may.
        """
        bounds = self.at(state, T)
        slower = self.slower(dq, bounds.box, state, T)
        for limit, (C, _, high) in zip(self.row_limits, bounds.rows, strict=True):
            if limit.still_brakes and not (
                (C.dot(slower) <= high).all() and limit.can_be_kept(slower, state, T)
            ):
                return self.slower(np.zeros(len(dq)), bounds.box, state, T)
        return slower

    def slower(
        self, dq: JointVelocities, box: Box, state: ReferenceState, T: Seconds
    ) -> JointVelocities:
        """dq in the box of a state, with no joint faster than before, or turning round.

        Under a limit on the jerk it may be, until its acceleration has come to zero.
        """
        v = state.dq_prev
        if self.jerk is None:
            return _between(np.clip(dq, *box), np.zeros(len(v)), v)
        jerk = self.jerk / ((3.0 ** (state.tick.lost + 1) - 1.0) / 2.0)  # as fill_boxes lowers it
        slowest = np.array(
            [dq - T * stopping_speed(dq, J, T) for dq, J in zip(v, jerk, strict=True)]
        )
        slowest[np.abs(slowest) < _AT_REST] = 0.0
        return np.clip(_between(dq, slowest, v), *box)

    def _bounds(self, state: ReferenceState, T: Seconds) -> Bounds:
        rows = [limit.rows(state, T) for limit in self.row_limits]
        return Bounds(self, state, T, self._boxes.copy(), rows)

    def _fill_boxes(self, dq: JointVelocities, state: ReferenceState, T: Seconds) -> bool:
        """Write the boxes of a state into _boxes; whether dq is in all of them."""
        motion = dq, state.q, state.dq_prev, state.ddq_prev, T
        tick = state.tick
        gaps = tick.gap, tick.longest_gap, tick.lost
        return fill_boxes(*motion, self._joints, self._boxes, *gaps)


def _between(dq: np.ndarray, a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """dq where it lies between a and b, else the nearer of these two, (n,)."""
    return np.clip(dq, np.minimum(a, b), np.maximum(a, b))
