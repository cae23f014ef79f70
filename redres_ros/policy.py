"""How the arm is to move: a law with its preferences and lower tasks, and going from one such
motion to another without a jump.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Protocol

import numpy as np

from redres_ros.interpolation import quintic
from redres_ros.laws import Law
from redres_ros.preferences import Preference
from redres_ros.resolution import Level, Weight, resolve_in_order, resolve_one
from redres_ros.robot_model import RobotModel, RobotState
from redres_ros.singularity import escape_direction
from redres_ros.tasks import Task

_ROUNDING = 1e-9  # of dx; less is rounding


@dataclass(slots=True)  # made in every tick: in two thirds of the time of a NamedTuple
class Solution:
    """What a motion would do at one tick.

    Attributes:
        dq: (n,) [rad/s].
        J: (m, n), of the first task.
        executed: (m,), the part of dx that dq is meant to execute.
        unachieved: (m,), the part that a singularity does not let through; None if there is none.
        W: The metric.
        levels: All tasks in order, with comparable rows, where there are several.
        s: The share of `executed` that limits allow.
        active_limits: 'joint: limit' that acts most, or ''.
        dq_old: Of a blend, (n,) [rad/s], what the old motion would do; else None.
    """

    dq: np.ndarray
    J: np.ndarray
    executed: np.ndarray
    unachieved: np.ndarray | None
    W: Weight
    levels: Sequence[Level] = ()
    s: float = 1.0
    active_limits: str = ''
    dq_old: np.ndarray | None = None

    def within(
        self, dq: np.ndarray, s: float, active_limits: str, unachieved: np.ndarray | None
    ) -> 'Solution':
        """The same within limits; dataclasses.replace would take 1 us longer.

        Args:
            dq: (n,) [rad/s] what they allow.
            s: The share of dx that it executes.
            active_limits: What acts most.
            unachieved: (m,) the part of dx that cannot be executed.
        """
        return Solution(
            dq,
            self.J,
            self.executed,
            unachieved,
            self.W,
            self.levels,
            s,
            active_limits,
            self.dq_old,
        )


class Motion(Protocol):
    """Something that moves the arm."""

    def answer(self, state: RobotState, task: Task, dx: np.ndarray, T: float) -> Solution:
        """What it would do at this state.

        Args:
            state: Of the arm at this tick.
            task: The first one.
            dx: What it wants, (m,).
            T: Sampling time [s].
        """


@dataclass(frozen=True)
class Policy:
    """The first task is followed, by a law with preferences, and lower tasks in order."""

    law: Law
    preferences: tuple[Preference, ...] = ()
    lower_tasks: tuple[Task, ...] = ()

    def with_initial_targets(self, state: RobotState) -> 'Policy':
        """The same; targets that were left open are what they are at this state."""
        return replace(
            self,
            preferences=tuple(
                preference.with_initial_targets(state) for preference in self.preferences
            ),
            lower_tasks=tuple(task.with_initial_targets(state) for task in self.lower_tasks),
        )

    def check(self, model: RobotModel) -> None:
        """Raise what a preference or a task raises that does not fit the arm, as for the name of a
        frame that it has not got, or too few angles.
        """
        state = _any_state(model)
        begun = self.with_initial_targets(state)
        for preference in begun.preferences:
            preference.acceleration(state)
        for task in begun.lower_tasks:
            task.jacobian(state)

    def answer(self, state: RobotState, task: Task, dx: np.ndarray, T: float) -> Solution:
        """Eq. (A.13), for several tasks Eq. (20)."""
        J = task.jacobian(state)
        scale = task.row_scale(state.model)
        W = self.law.weight(state)
        if self.preferences:
            b = self.law.bias_with(state, T, self._preferred(state))
        else:
            b = self.law.bias(state, T)
        rows = J
        rates = dx
        if scale is not None:
            rows, rates = scaled(J, dx, scale)
        levels: Sequence[Level] = ()
        if self.lower_tasks:
            levels = self._levels(rows, rates, state)
            dq, damped = resolve_in_order(levels, b, W)
        else:
            dq, damped = resolve_one(rows, rates, b, W)
        if not damped:
            return Solution(dq, J, dx, None, W, levels)
        executed = J.dot(dq)
        if np.linalg.norm(dx - executed) > _ROUNDING * np.linalg.norm(dx):
            dq = dq + _escape_velocity(state, task, J, dx)
            executed = J.dot(dq)
        return Solution(dq, J, executed, dx - executed, W, levels)

    def _levels(self, J: np.ndarray, dx: np.ndarray, state: RobotState) -> list[Level]:
        """The tasks in order, with comparable rows; J and dx are those of the first one."""
        levels = [(J, dx)]
        for task in self.lower_tasks:
            scale = task.row_scale(state.model)
            levels.append(scaled(task.jacobian(state), task.velocity(state), scale))
        return levels

    def _preferred(self, state: RobotState) -> np.ndarray | None:
        """The sum of the preferences' ddq_N, (n,) [rad/s^2], Eq. (19); None for a law without
        memory, which has no use for it.
        """
        if not self.law.has_memory:
            return None
        accelerations = [preference.acceleration(state) for preference in self.preferences]
        return np.add.reduce(accelerations)


def check_task(task: Task, model: RobotModel) -> None:
    """Refuse a first task that does not fit the arm.

    Args:
        task: A first task.
        model: Of the arm.

    Raises:
        RedresError: The task does not fit the arm.
    """
    task.jacobian(_any_state(model))


def _any_state(model: RobotModel) -> RobotState:
    zeros = np.zeros(model.n)
    return model.unchecked_state(zeros, zeros)


class Hold:
    """The arm stands still, and the task is left."""

    def __reduce__(self) -> str:
        """By its name: a copy would no longer be STANDING."""
        return 'HOLD'

    def answer(self, state: RobotState, task: Task, dx: np.ndarray, T: float) -> Solution:
        """No velocity."""
        J = task.jacobian(state)
        return Solution(np.zeros(len(state.q)), J, np.zeros(len(dx)), None, None)


HOLD = Hold()


@dataclass(frozen=True, eq=False)
class ConstantVelocity:
    """The joints go on with one velocity dq (n,) [rad/s]."""

    dq: np.ndarray

    def answer(self, state: RobotState, task: Task, dx: np.ndarray, T: float) -> Solution:
        """That velocity."""
        J = task.jacobian(state)
        return Solution(self.dq, J, J.dot(self.dq), None, None)


@dataclass(frozen=True, eq=False)
class Blend:
    """On the way from one motion to another.

    dq_old: (n,) [rad/s], the last velocity the *old motion* would have commanded. It must not see
    the blended velocity, or its self-motion would shrink every cycle. The new motion sees the
    blended one, which is what it takes over. share: of the switch time that is over.
    """

    old: Motion
    new: Motion
    dq_old: np.ndarray
    share: float = 0.0

    def answer(self, state: RobotState, task: Task, dx: np.ndarray, T: float) -> Solution:
        """dq = (1 - s) dq_old + s dq_new.

        Where both execute the task, J dq = dx, so does every mixture.
        """
        new = self.new.answer(state, task, dx, T)
        old = self.old.answer(state.with_velocity(self.dq_old), task, dx, T)
        s, _ = quintic(self.share)
        return Solution(
            (1.0 - s) * old.dq + s * new.dq,
            new.J,
            (1.0 - s) * old.executed + s * new.executed,
            _mixed_unachieved(old.unachieved, new.unachieved, s),
            new.W,
            new.levels,
            dq_old=old.dq,
        )


def advanced(
    motion: Motion, wanted: Motion, dq_prev: np.ndarray, T: float, switch_time: float
) -> Motion:
    """One cycle on, from the motion in force towards the wanted one.

    Standing still, and moving again, begin at once, from the present velocity. Any other change
    waits for the end of the blend under way.

    Args:
        motion: The one in force, which may be a blend.
        wanted: Where to go.
        dq_prev: (n,) [rad/s] the last command.
        T: Sampling time [s].
        switch_time: Time that a blend takes [s].
    """
    if isinstance(motion, Blend):
        blend = motion
        if wanted != blend.new and HOLD in (wanted, blend.new):
            blend = Blend(ConstantVelocity(dq_prev), wanted, dq_prev)
    elif motion == wanted:
        return wanted
    else:
        blend = Blend(motion, wanted, dq_prev)
    step = T / switch_time if switch_time > 0.0 else 1.0
    if blend.share + step >= 1.0:
        return blend.new
    return replace(blend, share=blend.share + step)


def after(motion: Motion, answer: Solution) -> Motion:
    """The motion once its answer has been carried out: a blend remembers what the old one wanted.

    Args:
        motion: The one in force.
        answer: Its answer.
    """
    if isinstance(motion, Blend) and answer.dq_old is not None:
        return replace(motion, dq_old=answer.dq_old)
    return motion


def _escape_velocity(
    state: RobotState, task: Task, J: np.ndarray, dx: np.ndarray
) -> np.ndarray | float:
    """The self-motion (n,) [rad/s] that leads out of a singularity; 0 where none is needed."""
    dJ = task.derivatives(state)
    if dJ is None:
        return 0.0
    scale = task.row_scale(state.model)
    if scale is None:
        z = escape_direction(J, dJ, dx, state.dq_prev)
        return 0.0 if z is None else z / state.model.reach
    J, dx = scaled(J, dx, scale)
    z = escape_direction(J, scale[:, None] * dJ, dx, state.dq_prev)
    return 0.0 if z is None else z


def scaled(J: np.ndarray, dx: np.ndarray, scale: np.ndarray | None) -> Level:
    """J and dx with comparable rows.

    Args:
        J: (m, n).
        dx: (m,).
        scale: What each row is multiplied by, (m,); None for all by one.
    """
    if scale is None:
        return J, dx
    return scale[:, None] * J, scale * dx


def _mixed_unachieved(
    old: np.ndarray | None, new: np.ndarray | None, s: float
) -> np.ndarray | None:
    """(1 - s) old + s new, where None stands for nothing."""
    if old is not None and new is not None:
        return (1.0 - s) * old + s * new
    if new is not None:
        return s * new
    if old is not None:
        return (1.0 - s) * old
    return None
