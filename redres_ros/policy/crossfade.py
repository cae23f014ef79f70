"""The crossfade from one policy to another, without a jump."""

from dataclasses import dataclass, replace

import numpy as np

from redres_ros.errors import RedresError
from redres_ros.interpolation import quintic
from redres_ros.policy.policy import SPEED_LIMIT, Hold, Motion, Policy
from redres_ros.resolution import Solution
from redres_ros.robot_model import RobotState


@dataclass(frozen=True, eq=False)
class Crossfade:
    """Any change of motion: law, preferences, tasks, limits, a start, a stop.

    Attributes:
        old: The motion before; None: the joints continue at dq_old.
        new: The motion after. Its velocity history is the mixed velocity.
        dq_old: (n,) [rad/s], the last velocity that `old` alone would have commanded, within its
            own limits. With the mixed velocity its null-space motion would shrink every cycle.
        progress: Elapsed fraction of the switch time.
    """

    old: Motion | None
    new: 'Policy | Hold'
    dq_old: np.ndarray
    progress: float = 0.0

    def solve(self, state: RobotState, dx: np.ndarray, T: float) -> Solution:
        """dq = (1 - c) dq_old + c dq_new, within the limits of the new motion.

        If both execute the task, J dq = dx, so does every mixture. An old motion that has no
        solution, or has diverged, is dropped.

        Args:
            state: State of the arm at this tick.
            dx: Velocity of the first task, (m,).
            T: Sampling time [s].
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
        mixed.dq_old = old.dq
        return mixed

    def after(self, solution: Solution) -> Motion:
        """The motion once its solution has been commanded: it keeps its old motion's velocity."""
        if solution.dq_old is None:
            return self.new
        return replace(self, dq_old=solution.dq_old)

    def _old_solution(self, state: RobotState, dx: np.ndarray, T: float) -> Solution | None:
        if self.old is None:
            J = self.new.task.jacobian(state)
            return Solution(self.dq_old, J, J.dot(self.dq_old))
        try:
            old = self.old.solve(state.with_velocity(self.dq_old), dx, T)
        except RedresError:
            return None
        return old if float(np.abs(old.dq).max()) <= SPEED_LIMIT else None


def advanced(
    motion: Motion, desired: Policy | Hold, dq_prev: np.ndarray, T: float, switch_time: float
) -> Motion:
    """The motion of the next cycle, on the way from the one in force to the desired one.

    A stop, a start and another first task begin at once, from the present velocity. Any other
    change waits for the end of the current crossfade.

    Args:
        motion: The one in force, which may be a crossfade.
        desired: Where to go.
        dq_prev: (n,) [rad/s] the last command.
        T: Time since the last tick [s].
        switch_time: Duration of a crossfade [s].
    """
    if motion == desired:
        return desired
    fade = motion if isinstance(motion, Crossfade) else Crossfade(motion, desired, dq_prev)
    before = fade.new if fade is motion else fade.old
    if desired is not before and _is_sudden(before, desired):
        fade = Crossfade(None, desired, dq_prev)
    step = T / switch_time if switch_time > 0.0 else 1.0
    if fade.progress + step >= 1.0:
        return fade.new
    return replace(fade, progress=fade.progress + step)


def _is_sudden(old: Motion | None, new: Policy | Hold) -> bool:
    """Whether a change must not wait, or the old motion knows nothing of the new task."""
    return not isinstance(old, Policy) or isinstance(new, Hold) or old.task != new.task


def _mixed(old: np.ndarray | None, new: np.ndarray | None, c: float) -> np.ndarray | None:
    """(1 - c) old + c new; None stands for zero."""
    if old is None:
        return None if new is None else c * new
    return (1.0 - c) * old + (0.0 if new is None else c * new)
