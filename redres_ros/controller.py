"""The controller of Fig. 1: joint positions and a task velocity in, the next position reference
out, once a cycle.
"""

from collections.abc import Iterable, Mapping
from dataclasses import replace
from numbers import Integral
from types import MappingProxyType
from typing import TYPE_CHECKING, Any, NoReturn

import numpy as np

from redres_ros.command import Command
from redres_ros.errors import DivergedError, RangeError
from redres_ros.kernels.tick import are_usable, integrate
from redres_ros.laws import LAWS, Law
from redres_ros.parameter import Parameter, as_tuple, check_value, resolve_entry
from redres_ros.policy import HOLD, Motion, Policy, advanced, after, check_task
from redres_ros.preferences import PREFERENCES, Preference
from redres_ros.resolver import UNLIMITED, Changeover, Resolver, make_resolver
from redres_ros.robot_model import RobotModel, RobotState
from redres_ros.tasks import TASKS, Task
from redres_ros.vectors import as_vector, check_finite

if TYPE_CHECKING:
    from redres_ros.limits.limit import Limit

INTEGRATE_FROM = ('command', 'measurement')
DX_LIMIT = 1e9  # [m/s], [rad/s]; faster than light: squares of much more would overflow
MOST_MISSED = 1_000_000  # cycles, which nobody bridges
_SAMPLING_TIME = Parameter('of the robot [s]', 1e-5, 1.0)
_SWITCH_TIME = Parameter('of changes [s]', 0.0, 60.0)
_SCALING_RATE = Parameter('at which the share of the task velocity rises again [1/s]', 0.0, 1e3)
_INTEGRATE_FROM = Parameter('what a reference goes on from', choices=INTEGRATE_FROM)
TURN = 2.0 * np.pi  # [rad]
SPEED_LIMIT = 1e4  # [rad/s]; far beyond any arm: a loop that gets there has diverged


class Controller:
    """Turns task velocities into position references by the law in force."""

    def __init__(
        self,
        model: RobotModel,
        law: str | Law,
        T: float,
        *,
        task: str | Task = 'position',
        switch_time: float = 0.0,
        integrate_from: str = 'command',
        limits: Iterable['str | Limit'] = (),
        limit_scale: float = 1.0,
        torque_scale: float = 1.0,
        limit_gains: Mapping[str, Any] = MappingProxyType({}),
        task_scaling_rate: float = 0.0,
        preferences: Iterable[str | Preference] = (),
        secondary_tasks: Iterable[str | Task] = (),
    ) -> None:
        """A controller that stands still, for one arm and one sampling time.

        Args:
            model: The arm.
            law: The law to begin with: a name in LAWS, or a law.
            T: Sampling time [s].
            task: What dx is the velocity of: a name in TASKS, or a task.
            switch_time: Time over which changes, starting and stopping are blended [s]; 0: at once.
            integrate_from: q_ref = q + T dq (footnote 1) with q the last 'command', so that a
                servo's lag does not make the arm creep, or the last 'measurement'.
            limits: Names in LIMITS, or limits, that no command leaves.
            limit_scale: Factor on the arm's velocity and acceleration limits.
            torque_scale: Factor on its torque limits.
            limit_gains: Gains of limits given by name, as {'position.margin': 0.02}.
            task_scaling_rate: Once limits have left only a share of the task velocity, it rises
                again at this rate [1/s]: a lower speed leaves the spare joints to the law, which
                calms them. 0: the largest share in every tick.
            preferences: Names in PREFERENCES, or preferences; they add up.
            secondary_tasks: Names in TASKS, or tasks, in order of priority below `task`. A name
                stands for holding the value of the start of the motion.

        Raises:
            RangeError: For T, switch_time, a scale or the law's damping.
            UnknownNameError: For a name that is in no table, and for a frame or a joint of a task
                that the arm has not got.
            ArrayError: For limits that the arm has no figures for, and for a target that does not
                fit the arm.
        """
        for name, value, parameter in (
            ('T', T, _SAMPLING_TIME),
            ('switch_time', switch_time, _SWITCH_TIME),
            ('task_scaling_rate', task_scaling_rate, _SCALING_RATE),
            ('integrate_from', integrate_from, _INTEGRATE_FROM),
        ):
            check_value(name, value, parameter)
        law = _law(law)
        law.check_damping(T)
        self.model = model
        self.T = T
        self.task = _task(task)
        self.m = self.task.size
        self.switch_time = switch_time
        self.task_scaling_rate = task_scaling_rate
        self._integrate_from = integrate_from
        self._turning = np.flatnonzero(model.q_max - model.q_min > TURN)  # joints
        self._all_achieved = np.zeros(self.m)
        self._all_achieved.flags.writeable = False  # every command shares it
        self._asked = Policy(law, _preferences(preferences), _tasks(secondary_tasks))
        self._asked.check(model)
        check_task(self.task, model)
        self._begun = self._asked  # with targets that were left open filled in
        self._resolver: Resolver = UNLIMITED
        self._moving = True
        self.reset()
        self.set_limits(
            limits, limit_scale=limit_scale, torque_scale=torque_scale, limit_gains=limit_gains
        )

    @property
    def law(self) -> Law:
        """The law asked for last; a blend towards it may be under way."""
        return self._asked.law

    @property
    def preferences(self) -> tuple[Preference, ...]:
        """The preferences asked for last."""
        return self._asked.preferences

    @property
    def secondary_tasks(self) -> tuple[Task, ...]:
        """The tasks below the first one that were asked for last."""
        return self._asked.lower_tasks

    @property
    def moving(self) -> bool:
        """Whether the law is followed (or being blended in); False after hold()."""
        return self._moving

    def switch_law(self, law: str | Law) -> None:
        """Go over to another law, or to the same one with other gains; by name or as an object.

        Of several asked for during one blend the last one counts. Raises UnknownNameError, and
        RangeError for a damping outside [0, 1/T]; the law in force then stays.
        """
        law = _law(law)
        law.check_damping(self.T)
        self._asked = replace(self._asked, law=law)
        self._begun = replace(self._begun, law=law)

    def set_preferences(self, preferences: Iterable[str | Preference]) -> None:
        """Go over to other preferences; names or objects, as at construction.

        Raises RedresError for one that does not fit the arm; those in force then stay.
        """
        self._go_over_to(preferences=_preferences(preferences))

    def set_secondary_tasks(self, tasks: Iterable[str | Task]) -> None:
        """Go over to other tasks below the first one; names or objects, as at construction.

        Raises RedresError for one that does not fit the arm; those in force then stay.
        """
        self._go_over_to(lower_tasks=_tasks(tasks))

    def set_limits(
        self,
        limits: Iterable['str | Limit'],
        *,
        limit_scale: float = 1.0,
        torque_scale: float = 1.0,
        limit_gains: Mapping[str, Any] = MappingProxyType({}),
    ) -> None:
        """Go over to other limits.

        Limits on the acceleration act at once, because nothing can jump under them. Others are
        blended in.

        Args:
            limits: Names in LIMITS, or limits; none: no limits.
            limit_scale: Factor on the arm's velocity and acceleration limits.
            torque_scale: Factor on its torque limits.
            limit_gains: Gains of limits given by name, as {'position.margin': 0.02}.

        Raises:
            RedresError: A limit, a scale or a gain that cannot be used. Those in force then stay.
        """
        resolver = make_resolver(
            self.model, self.task, limits, limit_scale, torque_scale, limit_gains
        )
        if self._q_ref is None or resolver.bounds_acceleration:
            self._resolver = resolver
        else:
            self._resolver = Changeover(self._resolver, resolver)

    def hold(self) -> None:
        """Come to a standstill, beginning at once; the task is left."""
        self._moving = False

    def resume(self) -> None:
        """Follow the law again, beginning at once."""
        self._moving = True

    def reset(self) -> None:
        """Forget the last command: the next update starts at the measured position, at rest."""
        self._q_ref: np.ndarray | None = None
        self._start: np.ndarray | None = None  # from which it was integrated
        self._dq_prev = np.zeros(self.model.n)
        self._pace = 1.0  # the share of the task velocity that is asked for
        self._motion: Motion = HOLD
        self._begun = self._asked
        self._is_open = bool(self._asked.preferences or self._asked.lower_tasks)

    def reset_at_reference(self) -> None:
        """Begin anew at rest, as reset() does, but from the last reference: the arm is held there.

        A servo lets the arm sag by more than a joint may move in one cycle, so the measurement
        would be a leap.
        """
        q_ref = self._q_ref
        self.reset()
        self._q_ref = q_ref

    def rollback(self) -> None:
        """Have the next update start where the last one did: that reference came too late to be
        carried out in a cycle of its own.
        """
        if self._q_ref is not None:
            self._q_ref = self._start

    def lag(self, q: np.ndarray) -> float:
        """Distance of the joint furthest behind from the last reference, for q (n,) [rad]; 0 before
        the first.
        """
        if self._q_ref is None:
            return 0.0
        return max(map(abs, (self._q_ref - self.nearest_turn(q)).tolist()))

    def nearest_turn(self, q: np.ndarray) -> np.ndarray:
        """q (n,) [rad], where joints of more than a turn are at the one nearest to the last
        reference.

        Their drivers may tell angles of one turn alone. References go on from turn to turn: they
        never jump.
        """
        if not self._turning.size or self._q_ref is None:
            return q
        turns = np.zeros(len(q))
        turns[self._turning] = np.round((self._q_ref - q)[self._turning] / TURN)
        return q + TURN * turns

    def update(self, q: np.ndarray, dx: np.ndarray, missed: int = 0) -> Command:
        """The command that answers one state.

        Args:
            q: Measured joint positions, (n,) [rad].
            dx: Velocity of the task, (m,) [m/s], and [rad/s] below it.
            missed: Cycles since the last update that went without one; the arm is taken to have
                gone on with the last velocity.

        Raises:
            ArrayError: A wrong shape, NaN or infinity. The controller is as it was before.
            RangeError: For missed, or dx beyond DX_LIMIT. The controller is as it was before.
            DivergedError: The joints would exceed SPEED_LIMIT. Where dx is the reason,
                the controller is as it was before. Where its own memory is, it has forgotten it.
        """
        if missed and not (isinstance(missed, Integral) and 0 < missed <= MOST_MISSED):
            raise RangeError('missed', missed, 0, MOST_MISSED, 'a whole number of cycles')
        q = as_vector(q, self.model.n, 'q').copy()  # the command's state keeps it
        dx = as_vector(dx, self.m, 'dx')
        if not are_usable(q, dx, DX_LIMIT):
            check_finite(q, 'q')
            check_finite(dx, 'dx')
            raise RangeError('dx', float(np.abs(dx).max()), 0.0, DX_LIMIT)
        if self._turning.size:
            q = self.nearest_turn(q)
        if self._pace < 1.0:
            dx = self._pace * dx
        start = self._integrated(q, missed)
        resolver = self._resolver
        state = RobotState(self.model, q, self._dq_prev)
        begun = self._begun.with_initial_targets(state) if self._is_open else self._begun
        motion = self._motion
        wanted = begun if self._moving else HOLD
        if motion is not wanted:
            motion = advanced(motion, wanted, self._dq_prev, self.T, self.switch_time)
        answer = motion.answer(state, self.task, dx, self.T)
        if resolver is not UNLIMITED:
            resolver = resolver.advanced(self.T, self.switch_time)
            reference = state if start is q else RobotState(self.model, start, self._dq_prev)
            if not resolver.allows(answer, reference, self.T):
                if start is not q:
                    # Where limits act, joints are fast, and the arm is behind: a Jacobian from
                    # where it is would turn the path aside, by up to a millimetre.
                    answer = motion.answer(reference, self.task, dx, self.T)
                answer = resolver.resolve(answer, reference, self.T)
        dq = answer.dq
        q_ref = np.empty(self.model.n)
        if not integrate(start, self.T, dq, q_ref) <= SPEED_LIMIT:
            self._refuse(dq, dx, motion, state)
        self._q_ref = q_ref
        self._start = start
        self._dq_prev = dq
        self._motion = motion if motion is wanted else after(motion, answer)
        self._resolver = resolver
        self._begun = begun
        self._is_open = False
        s = answer.s
        if self.task_scaling_rate > 0.0 or self._pace < 1.0:
            s = self._paced(s)
        unachieved = self._all_achieved if answer.unachieved is None else answer.unachieved
        return tuple.__new__(  # in half the time of calling the class
            Command,
            (
                dq.copy(),
                q_ref.copy(),
                state,
                self.T,
                answer.J,
                answer.W,
                s,
                answer.active_limits,
                unachieved,
            ),
        )

    def _paced(self, s: float) -> float:
        """The share of the whole task velocity, where s is that of what was asked for."""
        s *= self._pace
        rise = self.task_scaling_rate * self.T if self.task_scaling_rate > 0.0 else 1.0
        self._pace = min(s + rise, 1.0)
        return s

    def _go_over_to(self, **changes: Any) -> None:
        """Ask for other preferences or lower tasks, unless they are in force; they must fit."""
        asked = replace(self._asked, **changes)
        if asked == self._asked:
            return
        asked.check(self.model)
        self._asked = asked
        self._begun = replace(self._begun, **changes)
        self._is_open = True

    def _integrated(self, q: np.ndarray, missed: int) -> np.ndarray:
        """The position from which the reference goes on, (n,) [rad]."""
        if self._q_ref is None or self._integrate_from == 'measurement':
            return q
        if missed:
            return self._q_ref + self.T * missed * self._dq_prev
        return self._q_ref

    def _refuse(
        self, dq: np.ndarray, dx: np.ndarray, motion: Motion, state: RobotState
    ) -> NoReturn:
        """Raise DivergedError for a speed beyond any arm.

        Where dx alone would not ask for it, from rest, the memory does, and is forgotten.
        """
        speed = float(np.linalg.norm(dq))
        at_rest = state.with_velocity(np.zeros(self.model.n))
        from_rest = motion.answer(at_rest, self.task, dx, self.T)
        reason = 'dx'
        if np.linalg.norm(from_rest.dq) <= SPEED_LIMIT:
            reason = 'its own motion'
            self.reset()
        raise DivergedError(speed, SPEED_LIMIT, reason)


def _law(law: str | Law) -> Law:
    return resolve_entry('law', LAWS, Law, law)


def _task(task: str | Task) -> Task:
    return resolve_entry('task', TASKS, Task, task)


def _tasks(tasks: str | Iterable[str | Task]) -> tuple[Task, ...]:
    return tuple(map(_task, as_tuple(tasks)))


def _preferences(preferences: str | Iterable[str | Preference]) -> tuple[Preference, ...]:
    return tuple(
        resolve_entry('preference', PREFERENCES, Preference, preference)
        for preference in as_tuple(preferences)
    )
