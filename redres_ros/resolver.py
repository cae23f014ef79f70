"""What stands between the wanted velocity and the commanded one: nothing, or the arm's limits."""

from collections.abc import Iterable
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, NamedTuple, Protocol

import numpy as np

from redres_ros.motion import Aim, Answer, scaled
from redres_ros.planner import quintic
from redres_ros.robot_model import RobotModel, RobotState

if TYPE_CHECKING:
    from redres_ros.limits import Limits
    from redres_ros.limits.limit import Limit


class Resolved(NamedTuple):
    """dq (n,) [rad/s] with J dq = s dx; limiting: 'joint: limit' that acts most, or ''."""

    dq: np.ndarray
    s: float
    limiting: str


class Resolver(Protocol):
    """Makes the command of what a motion would do."""

    @property
    def bounds_acceleration(self) -> bool:
        """Whether no command can jump under it."""

    def advanced(self, T: float, switch_time: float) -> 'Resolver':
        """One cycle on."""

    def resolve(self, answer: Answer, aim: Aim, state: RobotState, T: float) -> Resolved:
        """The velocity to command; state: at the reference that is integrated."""


class Unlimited:
    """The closed form as it is."""

    bounds_acceleration = False

    def advanced(self, T: float, switch_time: float) -> Resolver:
        """Itself."""
        return self

    def resolve(self, answer: Answer, aim: Aim, state: RobotState, T: float) -> Resolved:
        """The wanted velocity."""
        return Resolved(answer.dq, 1.0, '')


UNLIMITED = Unlimited()


class Limited:
    """The same optimum within limits."""

    def __init__(self, limits: 'Limits', joint_names: tuple[str, ...]) -> None:
        # compiled: loaded only where limits are wanted
        from redres_ros.bounded import bound
        from redres_ros.limits.joint import AccelerationLimit

        self._bound = bound
        self._limits = limits
        self._joint_names = joint_names
        self.bounds_acceleration = any(isinstance(limit, AccelerationLimit) for limit in limits)

    def advanced(self, T: float, switch_time: float) -> Resolver:
        """Itself."""
        return self

    def resolve(self, answer: Answer, aim: Aim, state: RobotState, T: float) -> Resolved:
        """The wanted velocity where it keeps the limits, otherwise what comes nearest to it."""
        bounds = self._limits.at(state, T)
        levels = [scaled(aim.J, answer.executed, aim.scale), *answer.lower]
        bounded = self._bound(answer.dq, answer.W, levels, bounds.box, bounds.rows)
        acting = bounds.limiting(bounded)
        if acting is None:
            return Resolved(bounded.dq, bounded.s, '')
        limit, index = acting
        return Resolved(bounded.dq, bounded.s, self._told(limit, index))

    def _told(self, limit: 'Limit', index: int) -> str:
        from redres_ros.limits import limit_name

        return f'{self._joint_names[index]}: {limit_name(limit)}'


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

    def resolve(self, answer: Answer, aim: Aim, state: RobotState, T: float) -> Resolved:
        """The mixture of both, which executes the mixture of their shares of dx."""
        old = self.old.resolve(answer, aim, state, T)
        new = self.new.resolve(answer, aim, state, T)
        part, _ = quintic(self.share)
        dq = (1.0 - part) * old.dq + part * new.dq
        s = (1.0 - part) * old.s + part * new.s
        return Resolved(dq, s, new.limiting or old.limiting)


def make_resolver(
    model: RobotModel,
    limits: Iterable['str | Limit'],
    limit_scale: float,
    torque_scale: float,
) -> Resolver:
    """The resolver that keeps these limits of an arm.

    Args:
        model: The arm.
        limits: Names in the table of limits, or objects; none: no limits.
        limit_scale: Factor on the arm's velocities and accelerations.
        torque_scale: Factor on its torques.

    Raises:
        RedresError: A limit or a scale that cannot be used.
    """
    limits = tuple(limits)
    if not limits:
        return UNLIMITED
    from redres_ros.limits import make_limits

    made = make_limits(limits, model, limit_scale=limit_scale, torque_scale=torque_scale)
    return Limited(made, model.joint_names)
