"""What stands between the wanted velocity and the commanded one: nothing, or the arm's limits."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np

from redres_ros.boundary_braking import BoundaryBraking
from redres_ros.interpolation import quintic
from redres_ros.parameter import as_tuple
from redres_ros.policy import Solution, scaled
from redres_ros.robot_model import RobotModel, RobotState
from redres_ros.tasks import Task

if TYPE_CHECKING:
    from redres_ros.limits import Limits
    from redres_ros.limits.limit import Limit


class Resolver(Protocol):
    """Makes the command of what a motion would do."""

    @property
    def bounds_acceleration(self) -> bool:
        """Whether no command can jump under it."""

    def advanced(self, T: float, switch_time: float) -> 'Resolver':
        """One cycle on.

        Args:
            T: Sampling time [s].
            switch_time: How long a change takes [s].
        """

    def allows(self, answer: Solution, start: RobotState, T: float) -> bool:
        """Whether the answer can be given as it is.

        Args:
            answer: The wanted one.
            start: State at the reference that is integrated.
            T: Sampling time [s].
        """

    def resolve(self, answer: Solution, start: RobotState, T: float) -> Solution:
        """The answer to give.

        Args:
            answer: The wanted one.
            start: State at the reference that is integrated.
            T: Sampling time [s].
        """


class Unlimited:
    """The closed form as it is."""

    bounds_acceleration = False

    def __reduce__(self) -> str:
        """By its name: a copy would no longer be UNLIMITED."""
        return 'UNLIMITED'

    def advanced(self, T: float, switch_time: float) -> Resolver:
        """Itself."""
        return self

    def allows(self, answer: Solution, start: RobotState, T: float) -> bool:
        """Always."""
        return True

    def resolve(self, answer: Solution, start: RobotState, T: float) -> Solution:
        """The wanted one."""
        return answer


UNLIMITED = Unlimited()


class Limited:
    """The same optimum within limits.

    Args:
        limits: What is kept.
        task: The first one.
        model: The arm.
    """

    def __init__(self, limits: 'Limits', task: Task, model: RobotModel) -> None:
        # compiled: loaded only where limits are wanted
        from redres_ros.constrained import solve_constrained
        from redres_ros.limits import limit_name
        from redres_ros.limits.joint import AccelerationLimit

        self._bound = solve_constrained
        self._limit_name = limit_name
        self._limits = limits
        self._scale = task.row_scale(model)
        self._reach: BoundaryBraking | None = None
        self.bounds_acceleration = False
        for limit in limits:
            if isinstance(limit, AccelerationLimit):
                self.bounds_acceleration = True
                if limit.reach > 0.0:
                    self._reach = BoundaryBraking(task, model, limit.A, limit.reach)
        first, *_ = limits
        self._active_set = np.zeros(first.model.n + 1, np.int64)  # by the search of the last tick

    def advanced(self, T: float, switch_time: float) -> Resolver:
        """Itself."""
        return self

    def allows(self, answer: Solution, start: RobotState, T: float) -> bool:
        """Whether it keeps the limits."""
        return self._limits.keep(answer.dq, start, T)

    def resolve(self, answer: Solution, start: RobotState, T: float) -> Solution:
        """The wanted one where it keeps the limits, otherwise what comes nearest to it."""
        lower = [(J, J.dot(answer.dq)) for J, _ in answer.levels[1:]]
        end = self._reach and self._reach.end(answer, start)
        if self._reach and end:
            answer = self._reach.slowed(answer, end)
            levels = self._reach.levels(answer, end)
        else:
            levels = [scaled(answer.J, answer.executed, self._scale)]
        bounds = self._limits.at(start, T)
        levels += lower
        bounded = self._bound(
            answer.dq, answer.W, levels, bounds.box, bounds.rows, self._active_set
        )
        if bounded.dq is answer.dq:
            return answer
        acting = bounds.acting_limit(bounded)
        active_limits = ''
        if acting is not None:
            limit, index = acting
            active_limits = f'{limit.place(start, index)}: {self._limit_name(limit)}'
        unachieved = answer.unachieved
        if self._reach and end:
            unachieved = self._reach.unachieved(answer, bounded.dq, end)
        return answer.within(bounded.dq, bounded.s, active_limits, unachieved)


@dataclass(frozen=True, eq=False)
class Changeover:
    """On the way from one resolver to another; share: of the switch time that is over."""

    old: Resolver
    new: Resolver
    share: float = 0.0
    bounds_acceleration = False

    def advanced(self, T: float, switch_time: float) -> Resolver:
        """One cycle on; the new one at the end."""
        step = T / switch_time if switch_time > 0.0 else 1.0
        if self.share + step >= 1.0:
            return self.new
        return replace(self, share=self.share + step)

    def allows(self, answer: Solution, start: RobotState, T: float) -> bool:
        """Whether both do."""
        return self.old.allows(answer, start, T) and self.new.allows(answer, start, T)

    def resolve(self, answer: Solution, start: RobotState, T: float) -> Solution:
        """The mixture of both, which executes the mixture of their shares of dx."""
        old = self.old.resolve(answer, start, T)
        new = self.new.resolve(answer, start, T)
        part, _ = quintic(self.share)
        return answer.within(
            (1.0 - part) * old.dq + part * new.dq,
            (1.0 - part) * old.s + part * new.s,
            new.active_limits or old.active_limits,
            answer.unachieved,
        )


def make_resolver(
    model: RobotModel,
    task: Task,
    limits: Iterable['str | Limit'],
    limit_scale: float,
    torque_scale: float,
    gains: Mapping[str, Any],
) -> Resolver:
    """The resolver that keeps these limits of an arm.

    Args:
        model: The arm.
        task: The first one.
        limits: Names in the table of limits, or objects; none: no limits.
        limit_scale: Factor on the arm's velocities and accelerations.
        torque_scale: Factor on its torques.
        gains: Of limits given by name, as {'position.margin': 0.02}.

    Raises:
        RedresError: A limit, a scale or a gain that cannot be used.
    """
    limits = as_tuple(limits)
    if not limits:
        return UNLIMITED
    from redres_ros.limits import make_limits

    made = make_limits(
        limits, model, limit_scale=limit_scale, torque_scale=torque_scale, gains=gains
    )
    return Limited(made, task, model)
