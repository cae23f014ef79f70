"""What the arm is to do: a policy of law, tasks, preferences and limits, made here from names and
gains; the stop for which it is left; and the crossfade from one to another.
"""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from types import MappingProxyType
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np

from redres_ros.errors import RedresError
from redres_ros.geometry import quintic
from redres_ros.laws import LAWS, Law
from redres_ros.parameter import Parameter, as_tuple, check_kind, check_value
from redres_ros.preferences import PREFERENCES, Preference
from redres_ros.resolution import (
    Level,
    Solution,
    Weight,
    check_shapes,
    resolve_in_order,
    resolve_one,
    scaled,
)
from redres_ros.robot_model import RobotModel, RobotState
from redres_ros.singularity import brake_before_end, escape, locked
from redres_ros.tasks import TASKS, Configuration, Pose, Position, Task
from redres_ros.types import JointVelocities, Seconds, TaskVelocity

if TYPE_CHECKING:
    from redres_ros.limits import Limits
    from redres_ros.limits.limit import Limit

SCALING = ('task', 'components')  # what limits scale: the task velocity, or each component of it
SPEED_LIMIT = 1e4  # [rad/s]; far beyond any arm: a motion that gets there has diverged

_SCALING = Parameter('what limits scale', choices=SCALING)
_PATH_ROWS: dict[type[Task], int] = {Position: 3, Pose: 6}
_ROUNDING = 1e-9  # of dx; less counts as achieved


class Motion(Protocol):
    """A source of joint velocities: a policy, a stop, a crossfade."""

    def solve(self, state: RobotState, dx: TaskVelocity, T: Seconds) -> Solution:
        """The joint velocity of this tick, within limits, for the velocity of the first task."""

    def within(self, limits: 'Limits') -> 'Motion':
        """The same within other limits."""


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

    def solve(self, state: RobotState, dx: TaskVelocity, T: Seconds) -> Solution:
        """The optimum at this tick."""
        free = self.unconstrained(state, dx, T)
        return free if self.limits is None else self.constrained(free, state, T)

    def unconstrained(self, state: RobotState, dx: TaskVelocity, T: Seconds) -> Solution:
        """The optimum without limits, Eq. (A.13), for several tasks Eq. (20)."""
        task = self.task
        J = task.jacobian(state)
        scale = task.row_scale(state.model)
        W, b, plan = self.law.objective(state, T)
        if self.preferences and self.law.has_memory:
            given = [preference.acceleration_in(state, W) for preference in self.preferences]
            b = b + T * np.add.reduce(given)  # Eq. (19)
        rows = J
        rates = dx
        if scale is not None:
            rows, rates = scaled(J, dx, scale)
        levels: Sequence[Level] = ()
        if self.secondary_tasks:
            levels = [(rows, rates), *(each.level(state) for each in self.secondary_tasks)]
            dq, damped = resolve_in_order(levels, b, W)
        else:
            dq, damped = resolve_one(rows, rates, b, W)
        if not damped:
            return Solution(dq, J, dx, None, W, levels, scale, plan)
        executed = J.dot(dq)
        if np.linalg.norm(dx - executed) > _ROUNDING * np.linalg.norm(dx):
            dq = dq + escape(state, task, J, dx)
            if self.scaling == 'components':
                dq = self._unlocked(dq, b, W, [(rows, rates), *levels[1:]], state)
            executed = J.dot(dq)
        return Solution(dq, J, executed, dx - executed, W, levels, scale, plan)

    def constrained(self, free: Solution, state: RobotState, T: Seconds) -> Solution:
        """The velocity within limits that is nearest to a given one; itself if it keeps them."""
        if self.limits is None:
            return free
        bounds = self.limits.violated(free.dq, state, T)
        if bounds is None:
            return free
        level = scaled(free.J, free.executed, free.scale)
        components = () if self.scaling == 'task' else self._components(state)
        braking = self.limits.braking_limit
        if braking is not None:
            rows = slice(None)
            if components and (state.tick.correction is None or self.limits.yielding.weight > 0.0):
                # A held orientation gives way; a held position must not pull the arm past its end.
                rows = self._first_component(_asked(free.desired, state), state)
            free, level = brake_before_end(
                free, level, self.task, state, braking.A, braking.reach, rows
            )
            if components:
                level = scaled(free.J, free.executed, free.scale)
        levels = [level]
        for J, _ in free.levels[1:]:
            levels.append((J, J.dot(free.dq)))
        solved, active = bounds.nearest(free.dq, free.W, levels, components, free.scale)
        return Solution(
            solved.dq,
            free.J,
            free.executed,
            free.unachieved,
            free.W,
            free.levels,
            free.scale,
            free.plan,
            solved.s,
            active,
            component_scaling=solved.component_scaling,
        )

    def within(self, limits: 'Limits') -> 'Policy':
        """The same within other limits."""
        return replace(self, limits=limits)

    def with_initial_targets(self, state: RobotState) -> 'Policy':
        """A copy with unset targets taken from this state."""
        if not self.preferences and not self.secondary_tasks:
            return self
        preferences = tuple(each.with_initial_targets(state) for each in self.preferences)
        secondary_tasks = tuple(each.with_initial_targets(state) for each in self.secondary_tasks)
        return replace(self, preferences=preferences, secondary_tasks=secondary_tasks)

    def check(self, model: RobotModel, T: Seconds | None = None) -> None:
        """Raise RedresError for a policy that does not fit an arm, or T; None: any."""
        if T is not None:
            self.law.check_damping(T)
        zeros = np.zeros(model.n)
        state = RobotState(model, zeros, zeros)
        policy = self.with_initial_targets(state)
        for preference in policy.preferences:
            preference.acceleration(state)
        b = self.law.bias(state, T or 1.0)
        W = self.law.weight(state)
        for task in (policy.task, *policy.secondary_tasks):
            check_shapes(task.jacobian(state), np.zeros(task.rows(model)), b, W)

    @cached_property
    def stop(self) -> 'Hold':
        """The standstill that this policy is left for."""
        return Hold(self.task, self.limits)

    @property
    def path_rows(self) -> int:
        """How many rows of the tip's path are its first task: 3, 6 with the orientation, or 0."""
        return 0 if getattr(self.task, 'frame', '') else _PATH_ROWS.get(type(self.task), 0)

    @property
    def measurements(self) -> set[str]:
        """Names of the measurements that its preferences and limits use."""
        return {user.measurement for user in (*self.preferences, *(self.limits or ()))} - {''}

    @cached_property
    def for_joints(self) -> 'Policy':
        """The same with all joints as the first task, which leaves no null space."""
        return Policy(self.law, Configuration(), limits=self.limits)

    def _components(self, state: RobotState) -> tuple[int, ...]:
        """Number of rows of each component that is scaled separately."""
        return self.task.components or (self.task.rows(state.model),)

    def _first_component(self, asked: TaskVelocity, state: RobotState) -> slice:
        """The rows of the task's first component, if it is asked for; else all."""
        size = self._components(state)[0]
        return slice(size) if asked[:size].any() else slice(None)

    def _unlocked(
        self,
        dq: JointVelocities,
        b: JointVelocities,
        W: Weight,
        levels: Sequence[Level],
        state: RobotState,
    ) -> JointVelocities:
        """dq; or, if a singularity leaves little of the task velocity, a velocity that executes its
        first component, and the other one as far as possible.
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


@dataclass(frozen=True)
class Hold:
    """The arm stands still, or brakes until it does; the task is left."""

    task: Task
    limits: 'Limits | None' = field(default=None, repr=False)

    def solve(self, state: RobotState, dx: TaskVelocity, T: Seconds) -> Solution:
        """No velocity, or as little as the limits allow."""
        return self.constrained(self.unconstrained(state, dx, T), state, T)

    def unconstrained(self, state: RobotState, dx: TaskVelocity, T: Seconds) -> Solution:
        """No velocity."""
        return Solution(np.zeros(len(state.q)), self.task.jacobian(state), np.zeros(len(dx)))

    def constrained(self, free: Solution, state: RobotState, T: Seconds) -> Solution:
        """Braking: no joint gets faster, none turns round, each keeps its box.

        A stop must not be refused by a torque limit or diverted by an obstacle: of the other limits
        only a collision makes the arm brake harder.
        """
        if self.limits is None:
            return free
        return Solution(self.limits.braked(free.dq, state, T), free.J, free.executed)

    def within(self, limits: 'Limits') -> 'Hold':
        """The same within other limits."""
        return replace(self, limits=limits)


@dataclass(frozen=True, eq=False)
class Crossfade:
    """Any change of motion: law, preferences, tasks, a start, a stop; without a jump.

    Limits are faded only without one on the acceleration, old or new.
    """

    old: Motion | None  # None: the joints continue at dq_old
    new: Policy | Hold  # its velocity history is the mixed velocity
    # The last velocity that `old` alone would have commanded, within its own limits. With the mixed
    # velocity its null-space motion would shrink every cycle.
    dq_old: JointVelocities
    plan_old: Any = None  # what its law has planned from there
    progress: float = 0.0  # elapsed fraction of the switch time

    def solve(self, state: RobotState, dx: TaskVelocity, T: Seconds) -> Solution:
        """dq = (1 - c) dq_old + c dq_new, within the limits of the new motion.

        If both execute the task, J dq = dx, so does every mixture. An old motion that has no
        solution, or has diverged, is dropped.
        """
        old = self._old_solution(state, dx, T)
        if old is None:
            return self.new.solve(state, dx, T)
        limits = self.new.limits
        # Limits on the acceleration act at once, on the mixture: nothing can jump under them.
        at_once = limits is not None and limits.bounds_acceleration
        new = (self.new.unconstrained if at_once else self.new.solve)(state, dx, T)
        c, _ = quintic(self.progress)
        mixed = replace(
            new,
            dq=(1.0 - c) * old.dq + c * new.dq,
            executed=(1.0 - c) * old.executed + c * new.executed,
            unachieved=_mixed(old.unachieved, new.unachieved, c),
            s=(1.0 - c) * old.s + c * new.s,
            active_limit=new.active_limit or old.active_limit,
        )
        if at_once:
            mixed = self.new.constrained(mixed, state, T)
        mixed.old = old
        return mixed

    def within(self, limits: 'Limits') -> 'Crossfade':
        """The same within other limits."""
        old = None if self.old is None else self.old.within(limits)
        return replace(self, old=old, new=self.new.within(limits))

    def after(self, solution: Solution) -> Motion:
        """The motion once its solution has been commanded: it keeps its old motion's velocity."""
        old = solution.old
        if old is None:
            return self.new
        return replace(self, dq_old=old.dq, plan_old=old.plan)

    def _old_solution(self, state: RobotState, dx: TaskVelocity, T: Seconds) -> Solution | None:
        if self.old is None:
            J = self.new.task.jacobian(state)
            return Solution(self.dq_old, J, J.dot(self.dq_old))
        try:
            old = self.old.solve(state.with_velocity(self.dq_old, self.plan_old), dx, T)
        except RedresError:
            return None
        return old if float(np.abs(old.dq).max()) <= SPEED_LIMIT else None


def advanced(
    motion: Motion,
    desired: Policy | Hold,
    dq_prev: JointVelocities,
    T: Seconds,
    switch_time: Seconds,
    plan: Any = None,
) -> Motion:
    """The motion of the next cycle, T after the last, from the one in force to the desired one.

    A stop, a start and another first task begin at once, from the last command. Any other
    change waits for the end of the current crossfade.
    """
    if motion == desired:
        return desired
    fade = motion if isinstance(motion, Crossfade) else Crossfade(motion, desired, dq_prev, plan)
    before = fade.new if fade is motion else fade.old
    knows_task = isinstance(before, Policy) and before.task == desired.task
    if desired is not before and (isinstance(desired, Hold) or not knows_task):
        fade = Crossfade(None, desired, dq_prev)
    step = T / switch_time if switch_time > 0.0 else 1.0
    if fade.progress + step >= 1.0:
        return fade.new
    return replace(fade, progress=fade.progress + step)


def make_policy(
    model: RobotModel,
    law: str | Law,
    *,
    task: str | Task = 'position',
    limits: 'Iterable[str | Limit]' = (),
    limit_scale: float = 1.0,
    torque_scale: float = 1.0,
    preferences: Iterable[str | Preference] = (),
    secondary_tasks: Iterable[str | Task] = (),
    scaling: str = 'task',
    gains: Mapping[str, Any] = MappingProxyType({}),
) -> Policy:
    """A policy from names in the tables, or objects, and from gains by their keys.

    Scales are factors on the arm's velocity and acceleration limits, and on its torque limits.
    Gains are of what is given by name: 'damping', 'posture.gain', 'position.margin'. Those of
    building blocks that are not in use do nothing.

    Raises RedresError for a value out of range, an unknown or repeated name, and what does not fit.
    """
    check_kind('gains', gains, Mapping, 'a mapping from their keys')
    policy = Policy(
        LAWS.resolve(law, gains),
        TASKS.resolve(task),
        PREFERENCES.resolve_all(preferences, gains),
        TASKS.resolve_all(secondary_tasks, gains),
        _limits(as_tuple('limits', limits), model, gains, limit_scale, torque_scale),
        scaling,
    )
    policy.check(model)
    return policy


def _limits(
    limits: 'tuple[str | Limit, ...]',
    model: RobotModel,
    gains: Mapping[str, Any],
    limit_scale: float,
    torque_scale: float,
) -> 'Limits | None':
    others = gains.keys() - {*LAWS.gain_keys, *PREFERENCES.gain_keys, *TASKS.gain_keys}
    if not limits and not others:
        return None
    from redres_ros.limits import make_limits  # compiled: loaded only if in use

    own = {key: gains[key] for key in others}
    made = make_limits(  # refuses gains of nothing
        limits, model, limit_scale=limit_scale, torque_scale=torque_scale, gains=own
    )
    return made if limits else None


def _mixed(old: TaskVelocity | None, new: TaskVelocity | None, c: float) -> TaskVelocity | None:
    """(1 - c) old + c new; None stands for zero."""
    if old is None:
        return None if new is None else c * new
    return (1.0 - c) * old + (0.0 if new is None else c * new)


def _asked(dx: TaskVelocity, state: RobotState) -> TaskVelocity:
    """dx without what only holds a component that nobody asks to move."""
    correction = state.tick.correction
    return dx if correction is None else np.where(correction.is_held, 0.0, dx)
