"""The policy of a tick: law, tasks, preferences and limits; and the stop for which it is left."""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import TYPE_CHECKING, Protocol

import numpy as np

from redres_ros.laws import Law
from redres_ros.parameter import Parameter, check_value
from redres_ros.preferences import Preference
from redres_ros.resolution import Level, Solution, Weight, resolve_in_order, resolve_one, scaled
from redres_ros.robot_model import RobotModel, RobotState
from redres_ros.singularity import escape_direction, locked
from redres_ros.tasks import Configuration, Task

if TYPE_CHECKING:
    from redres_ros.limits import Limits
    from redres_ros.limits.boundary_braking import BoundaryBraking

SCALING = ('task', 'components')  # what limits scale: the task velocity, or each component of it
SPEED_LIMIT = 1e4  # [rad/s]; far beyond any arm: a motion that gets there has diverged

_SCALING = Parameter('what limits scale', choices=SCALING)
_ROUNDING = 1e-9  # of dx; less counts as achieved


class Motion(Protocol):
    """A source of joint velocities: a policy, a stop, a crossfade."""

    def solve(self, state: RobotState, dx: np.ndarray, T: float) -> Solution:
        """The joint velocity of this tick, within limits.

        Args:
            state: State of the arm at this tick.
            dx: Velocity of the first task, (m,).
            T: Sampling time [s].
        """


@dataclass(frozen=True)
class Policy:
    """A law, the tasks in order of priority, preferences and limits.

    minimise 1/2 |dq - b|^2_W   subject to   J dq = s dx,   l <= C dq <= u

    With scaling 'components', translation and rotation have scaling factors of their own
    (limits/component_scaling.py).
    """

    law: Law
    task: Task
    preferences: tuple[Preference, ...] = ()
    secondary_tasks: tuple[Task, ...] = ()
    limits: 'Limits | None' = field(default=None, repr=False)
    scaling: str = 'task'

    def __post_init__(self) -> None:
        check_value('scaling', self.scaling, _SCALING)

    def solve(self, state: RobotState, dx: np.ndarray, T: float) -> Solution:
        """The optimum at this tick; arguments as of Motion.solve."""
        free = self.unconstrained(state, dx, T)
        if self.limits is None:
            return free
        return self.constrained(free, state, T)

    def unconstrained(self, state: RobotState, dx: np.ndarray, T: float) -> Solution:
        """The optimum without limits, Eq. (A.13), for several tasks Eq. (20).

        Args:
            state: State of the arm at this tick.
            dx: Velocity of the first task, (m,).
            T: Sampling time [s].
        """
        task = self.task
        J = task.jacobian(state)
        scale = task.row_scale(state.model)
        W = self.law.weight(state)
        b = self._bias(state, T) if self.preferences else self.law.bias(state, T)
        rows = J
        rates = dx
        if scale is not None:
            rows, rates = scaled(J, dx, scale)
        levels: Sequence[Level] = ()
        if self.secondary_tasks:
            levels = self._levels(rows, rates, state)
            dq, damped = resolve_in_order(levels, b, W)
        else:
            dq, damped = resolve_one(rows, rates, b, W)
        if not damped:
            return Solution(dq, J, dx, None, W, levels, scale)
        executed = J.dot(dq)
        if np.linalg.norm(dx - executed) > _ROUNDING * np.linalg.norm(dx):
            dq = dq + _escape(state, task, J, dx)
            if self.scaling == 'components':
                dq = self._unlocked(dq, b, W, [(rows, rates), *levels[1:]], state)
            executed = J.dot(dq)
        return Solution(dq, J, executed, dx - executed, W, levels, scale)

    def constrained(self, free: Solution, state: RobotState, T: float) -> Solution:
        """The velocity within the limits that is nearest to a given one; itself if it keeps them.

        Args:
            free: The given one.
            state: State of the arm at this tick.
            T: Sampling time [s].
        """
        if self.limits is None:
            return free
        bounds = self.limits.violated(free.dq, state, T)
        if bounds is None:
            return free
        level = scaled(free.J, free.executed, free.scale)
        components = () if self.scaling == 'task' else self._components(state)
        if self._boundary_braking:
            rows = slice(None)
            if components:
                first = self._first_component(_asked(free.wanted, state), state)
                # A held orientation gives way; a held position must not pull the arm past its end.
                rows = first if first.start == 0 else rows
            free, level = self._boundary_braking.applied(free, level, state, rows)
            if components:
                level = scaled(free.J, free.executed, free.scale)
        levels = [level]
        for J, _ in free.levels[1:]:
            levels.append((J, J.dot(free.dq)))
        solved, active = bounds.nearest(free.dq, free.W, levels, components)
        return Solution(
            solved.dq,
            free.J,
            free.executed,
            free.unachieved,
            free.W,
            free.levels,
            free.scale,
            solved.s,
            active,
            component_scaling=solved.component_scaling,
        )

    def with_initial_targets(self, state: RobotState) -> 'Policy':
        """A copy with unset targets taken from this state."""
        if not self.preferences and not self.secondary_tasks:
            return self
        return replace(
            self,
            preferences=tuple(
                preference.with_initial_targets(state) for preference in self.preferences
            ),
            secondary_tasks=tuple(
                task.with_initial_targets(state) for task in self.secondary_tasks
            ),
        )

    def check(self, model: RobotModel, T: float | None = None) -> None:
        """Refuse a policy that does not fit an arm.

        Args:
            model: The arm.
            T: Sampling time [s], which bounds the damping; None: any.

        Raises:
            RangeError: A damping outside [0, 1/T].
            RedresError: A frame or a joint that the arm does not have, or too few angles.
        """
        if T is not None:
            self.law.check_damping(T)
        zeros = np.zeros(model.n)
        state = model.unchecked_state(zeros, zeros)
        policy = self.with_initial_targets(state)
        for preference in policy.preferences:
            preference.acceleration(state)
        for task in (policy.task, *policy.secondary_tasks):
            task.jacobian(state)

    @cached_property
    def stop(self) -> 'Hold':
        """The standstill that this policy is left for."""
        return Hold(self.task, self.limits)

    @property
    def measurements(self) -> set[str]:
        """Names of the measurements that its preferences and limits use."""
        users = (*self.preferences, *(self.limits or ()))
        return {user.measurement for user in users} - {''}

    @cached_property
    def for_joints(self) -> 'Policy':
        """The same with all joints as the first task, which leaves no null space."""
        return Policy(self.law, Configuration(), limits=self.limits)

    @cached_property
    def _boundary_braking(self) -> 'BoundaryBraking | None':
        """What brakes the first task before the end of the reach; None if no limit asks for it."""
        limit = self.limits and self.limits.braking_limit
        if not limit:
            return None
        from redres_ros.limits.boundary_braking import BoundaryBraking  # compiled, as all limits

        return BoundaryBraking(self.task, limit.model, limit.A, limit.reach)

    def _components(self, state: RobotState) -> tuple[int, ...]:
        """Number of rows of each component that is scaled separately."""
        return self.task.components or (self.task.rows(state.model),)

    def _unlocked(
        self,
        dq: np.ndarray,
        b: np.ndarray,
        W: Weight,
        levels: Sequence[Level],
        state: RobotState,
    ) -> np.ndarray:
        """dq; or, if a singularity leaves little of the task velocity, a velocity (n,) [rad/s] that
        executes its first component, and the other one as far as possible.
        """
        J, dx = levels[0]
        asked = _asked(dx, state)
        first = self._first_component(asked, state)
        square = float(asked.dot(asked))
        weight = locked(float(J.dot(dq).dot(asked)) / square) if square else 0.0
        if weight == 0.0 or len(J[first]) == len(J):
            return dq
        parts = [(J[first], dx[first]), (np.delete(J, first, 0), np.delete(dx, first))]
        alone, _ = resolve_in_order([*parts, *levels[1:]], b, W)
        return dq + weight * (alone - dq)

    def _first_component(self, asked: np.ndarray, state: RobotState) -> slice:
        """The rows of the first component of the task that is asked for; all if none is."""
        begin = 0
        for size in self._components(state):
            if asked[begin : begin + size].any():
                return slice(begin, begin + size)
            begin += size
        return slice(None)

    def _bias(self, state: RobotState, T: float) -> np.ndarray:
        """b, (n,) [rad/s], with the sum of the preferences, Eq. (19), if the law takes them."""
        if not self.law.has_memory:
            return self.law.bias(state, T)
        accelerations = [preference.acceleration(state) for preference in self.preferences]
        return self.law.bias_with(state, T, np.add.reduce(accelerations))

    def _levels(self, J: np.ndarray, dx: np.ndarray, state: RobotState) -> list[Level]:
        """The tasks in order, with comparable rows; J and dx are those of the first one."""
        levels = [(J, dx)]
        for task in self.secondary_tasks:
            scale = task.row_scale(state.model)
            levels.append(scaled(task.jacobian(state), task.velocity(state), scale))
        return levels


@dataclass(frozen=True)
class Hold:
    """The arm stands still, or brakes until it does; the task is left."""

    task: Task
    limits: 'Limits | None' = field(default=None, repr=False)

    def solve(self, state: RobotState, dx: np.ndarray, T: float) -> Solution:
        """No velocity, or as little as the limits allow; arguments as of Motion.solve."""
        return self.constrained(self.unconstrained(state, dx, T), state, T)

    def unconstrained(self, state: RobotState, dx: np.ndarray, T: float) -> Solution:
        """No velocity.

        Args:
            state: State of the arm at this tick.
            dx: Ignored, (m,).
            T: Sampling time [s].
        """
        zeros = np.zeros(len(state.q))
        return Solution(zeros, self.task.jacobian(state), np.zeros(len(dx)))

    def constrained(self, free: Solution, state: RobotState, T: float) -> Solution:
        """Braking: no joint gets faster, none turns round, each keeps its box.

        A stop must not be refused by a torque limit or diverted by an obstacle: of the other limits
        only a collision makes the arm brake harder.

        Args:
            free: The solution without limits.
            state: State of the arm at this tick.
            T: Sampling time [s].
        """
        if self.limits is None:
            return free
        return Solution(self.limits.braked(free.dq, state, T), free.J, free.executed)


def _asked(dx: np.ndarray, state: RobotState) -> np.ndarray:
    """dx (m,) without what only holds a component that nobody asks to move."""
    correction = state.tick.correction
    return dx if correction is None else np.where(correction, 0.0, dx)


def _escape(state: RobotState, task: Task, J: np.ndarray, dx: np.ndarray) -> np.ndarray | float:
    """The self-motion (n,) [rad/s] that leads out of a singularity; 0 if none is needed."""
    dJ = task.derivatives(state)
    if dJ is None:
        return 0.0
    scale = task.row_scale(state.model)
    if scale is None:
        scale = np.full(len(dx), 1.0 / state.model.reach)
    z = escape_direction(scale[:, None] * J, scale[:, None] * dJ, scale * dx, state.dq_prev)
    return 0.0 if z is None else z
