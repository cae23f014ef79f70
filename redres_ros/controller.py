"""The controller of Fig. 1: joint positions and a task velocity in, the next position reference
out, once a cycle.
"""

from collections.abc import Iterable, Mapping
from dataclasses import replace
from numbers import Integral
from types import MappingProxyType
from typing import TYPE_CHECKING, Any, NamedTuple, NoReturn

import numpy as np

from redres_ros.command import Command
from redres_ros.errors import DivergedError, RangeError, RedresError
from redres_ros.kernels.tick import are_usable, differentiate, integrate
from redres_ros.laws import Law
from redres_ros.parameter import Parameter, check_value
from redres_ros.policy import SPEED_LIMIT, Crossfade, Motion, Policy, advanced, make_policy
from redres_ros.preferences import Preference
from redres_ros.resolution import Solution
from redres_ros.robot_model import RobotModel, RobotState, TickContext
from redres_ros.tasks import Task
from redres_ros.types import (
    JointAccelerations,
    JointPositions,
    JointVelocities,
    TaskVelocity,
    as_vector,
    check_finite,
)

if TYPE_CHECKING:
    from redres_ros.limits.limit import Limit

INTEGRATE_FROM = ('command', 'measurement')
# What a robot does in a cycle without a command: go on at the last velocity, at the last
# acceleration, or stay at the last command.
BRIDGING = ('extrapolate', 'extrapolate_acceleration', 'hold')
_DX_LIMIT = 1e9  # [m/s], [rad/s]; faster than light: squares of much more would overflow
_MOST_MISSED = 1_000_000  # cycles, which nobody bridges
_SAMPLING_TIME = Parameter('of the robot [s]', 1e-5, 1.0)
_SWITCH_TIME = Parameter('of changes [s]', 0.0, 60.0)
_INTEGRATE_FROM = Parameter('what a reference goes on from', choices=INTEGRATE_FROM)
_BRIDGING = Parameter('what a robot does without a command', choices=BRIDGING)
_TURN = 2.0 * np.pi  # [rad]


class _Ahead(NamedTuple):
    """The solution of a tick whose state has not come yet."""

    motion: Motion
    state: RobotState
    dx: bytes
    solution: Solution

    def is_of(self, motion: Motion, state: RobotState, dx: np.ndarray) -> bool:
        """Whether a tick has this solution; arrays of a state are never modified."""
        own = self.state
        return (
            motion is self.motion
            and state.q is own.q
            and state.dq_prev is own.dq_prev
            and state.ddq_prev is own.ddq_prev
            and state.tick.correction is None
            and state.tick == own.tick
            and dx.tobytes() == self.dx
        )


class Controller:
    """Turns task velocities into position references by the active policy."""

    def __init__(
        self,
        model: RobotModel,
        law: str | Law,
        T: float,
        *,
        task: str | Task = 'position',
        switch_time: float = 0.0,
        integrate_from: str = 'command',
        bridging: str = 'extrapolate',
        limits: Iterable['str | Limit'] = (),
        limit_scale: float = 1.0,
        torque_scale: float = 1.0,
        limit_gains: Mapping[str, Any] = MappingProxyType({}),
        preferences: Iterable[str | Preference] = (),
        secondary_tasks: Iterable[str | Task] = (),
        scaling: str = 'task',
    ) -> None:
        """A controller at rest, for one arm and one sampling time.

        Args:
            model: The arm.
            law: The law to begin with: a name in LAWS, or a law.
            T: Sampling time [s].
            task: What dx is the velocity of: a name in TASKS, or a task.
            switch_time: Duration of the crossfade of changes, starts and stops [s]; 0: at once.
            integrate_from: q_ref = q + T dq (footnote 1) with q the last 'command', so that a
                servo's lag does not make the arm creep, or the last 'measurement'.
            bridging: What the robot does in a cycle without a command: 'extrapolate' the last ones
                at constant velocity, 'extrapolate_acceleration', or 'hold' the last one.
            limits: Names in LIMITS, or limits, that every command keeps.
            limit_scale: Factor on the arm's velocity and acceleration limits.
            torque_scale: Factor on its torque limits.
            limit_gains: Gains of limits given by name, such as {'position.margin': 0.02}.
            preferences: Names in PREFERENCES, or preferences; they add up.
            secondary_tasks: Names in TASKS, or tasks, in order of priority below `task`. A name
                stands for holding the value at the start of the motion.
            scaling: What limits scale: the 'task' velocity as a whole, which keeps its direction,
                or its 'components', translation and rotation, for teleoperation.

        Raises:
            RangeError: For T, switch_time, a scale or the law's damping.
            UnknownNameError: For a name that is in no table, and for a frame or a joint of a task
                that the arm does not have.
            ArrayError: For limits that the arm has no figures for, and for a target that does not
                fit the arm.
        """
        for name, value, parameter in (
            ('T', T, _SAMPLING_TIME),
            ('switch_time', switch_time, _SWITCH_TIME),
            ('integrate_from', integrate_from, _INTEGRATE_FROM),
            ('bridging', bridging, _BRIDGING),
        ):
            check_value(name, value, parameter)
        self.model = model
        self.T = T
        self.switch_time = switch_time
        self._integrate_from = integrate_from
        self.bridging = bridging
        self.measurements: Mapping[str, np.ndarray] = {}  # by name, for preferences and limits
        self.gap = 1  # cycles between two commands, at most: joints still stop in time
        self.longest_gap = 1  # the same, once on the way to the end of a range
        self.moving = True  # whether the policy is followed, or being faded in; not after hold()
        self._multi_turn = np.flatnonzero(model.q_max - model.q_min > _TURN)  # joints
        policy = make_policy(
            model,
            law,
            task=task,
            limits=limits,
            limit_scale=limit_scale,
            torque_scale=torque_scale,
            preferences=preferences,
            secondary_tasks=secondary_tasks,
            scaling=scaling,
            gains=limit_gains,
        )
        self.policy = policy  # the requested one: a crossfade towards it may be under way
        self._motion: Motion = policy.stop
        self._targeted = policy  # with all targets
        self._follows_joints = False
        self._ahead: _Ahead | None = None
        self.restart()
        self.set_policy(policy)

    @property
    def law(self) -> Law:
        """The requested law."""
        return self.policy.law

    @property
    def at_rest(self) -> bool:
        """Whether the last reference has no velocity."""
        return not self.dq.any()

    @property
    def reference(self) -> np.ndarray:
        """The last position reference, (n,) [rad]. Raises RedresError before the first."""
        if self._q_ref is None:
            raise RedresError('there is no reference yet; expected an update() or a place() first')
        return self._q_ref

    def set_policy(self, policy: Policy) -> None:
        """Switch to another policy; of several during one crossfade the last one counts.

        Raises RedresError for one that does not fit the arm or T; the one in force then stays.
        """
        policy.check(self.model, self.T)
        kept = {}  # what has its targets keeps them
        for name in ('preferences', 'secondary_tasks'):
            if getattr(policy, name) == getattr(self.policy, name):
                kept[name] = getattr(self._targeted, name)
        self.policy = policy
        self._targeted = replace(policy, **kept)
        self._has_open_targets = True
        self.follow_joints(self._follows_joints)

    def follow_joints(self, follows: bool) -> None:
        """Whether dx is the velocity of all joints, (n,) [rad/s], instead of that of the task."""
        self._follows_joints = follows
        self.m = self.model.n if follows else self.policy.task.rows(self.model)

    def switch_law(self, law: str | Law) -> None:
        """Switch to another law, or to other gains; by name or as an object.

        Raises UnknownNameError, and RangeError for a damping outside [0, 1/T]; the law in force
        then stays.
        """
        self._replace('law', law=law)

    def set_preferences(self, preferences: Iterable[str | Preference]) -> None:
        """Switch to other preferences; names or objects, as at construction.

        Raises RedresError for one that does not fit the arm; those in force then stay.
        """
        self._replace('preferences', preferences=preferences)

    def set_secondary_tasks(self, tasks: Iterable[str | Task]) -> None:
        """Switch to other secondary tasks; names or objects, as at construction.

        Raises RedresError for one that does not fit the arm; those in force then stay.
        """
        self._replace('secondary_tasks', secondary_tasks=tasks)

    def set_limits(
        self,
        limits: Iterable['str | Limit'],
        *,
        limit_scale: float = 1.0,
        torque_scale: float = 1.0,
        limit_gains: Mapping[str, Any] = MappingProxyType({}),
    ) -> None:
        """Switch to other limits; arguments as at construction.

        With a limit on the acceleration they act at once, because nothing can jump under it. Others
        are faded in.

        Args:
            limits: Names in LIMITS, or limits; none: no limits.
            limit_scale: Factor on the arm's velocity and acceleration limits.
            torque_scale: Factor on its torque limits.
            limit_gains: Gains of limits given by name.

        Raises:
            RedresError: A limit, a scale or a gain that cannot be used. Those in force then stay.
        """
        scales = {'limit_scale': limit_scale, 'torque_scale': torque_scale}
        self._replace('limits', limits=limits, gains=limit_gains, **scales)

    def set_scaling(self, scaling: str) -> None:
        """Have limits scale the 'task' velocity as a whole, or its 'components'."""
        if scaling != self.policy.scaling:
            self._replace('scaling', scaling=scaling)

    def hold(self) -> None:
        """Decelerate to rest, from now on; the task is dropped."""
        self.moving = False

    def resume(self) -> None:
        """Follow the policy again, from now on."""
        self.moving = True

    def reset(self) -> None:
        """Restart at the measured position, at rest.

        With a limit on the acceleration an arm in motion brakes first, and starts again where its
        reference is by then, without velocity history: nothing steps.
        """
        limits = self.policy.limits
        self._begins_anew = bool(limits and limits.bounds_acceleration and not self.at_rest)
        if not self._begins_anew:
            self.restart()

    def restart(self) -> None:
        """Restart at the next measured position: nothing was published."""
        self._q_ref: np.ndarray | None = None
        self.before = np.zeros(self.model.n), np.zeros(self.model.n)  # from where and with which
        # velocity it was computed, (n,) [rad], [rad/s]
        self._forget_motion()

    def place(self, q_ref: np.ndarray) -> None:
        """Be at rest with a reference (n,) [rad], where the next motion begins."""
        self._q_ref = q_ref
        self._forget_motion()
        self.before = q_ref, self.dq

    def correct(self, q_ref: np.ndarray, dq: np.ndarray) -> None:
        """Continue from what was published instead of the last command.

        Args:
            q_ref: (n,) [rad].
            dq: Its velocity, (n,) [rad/s].
        """
        self._q_ref = q_ref
        self._ddq_prev = (dq - self.before[1]) / self.T
        self._dq_prev = dq
        self.dq = dq

    def bridged(self, missed: int) -> tuple[np.ndarray, np.ndarray]:
        """Position (n,) [rad] and velocity (n,) [rad/s] of the robot, `missed` cycles after the
        last reference. One that extrapolates stops at the ends of its range.
        """
        q_ref = self.reference
        if not missed:
            return q_ref, self.dq
        if self.bridging == 'hold':
            return q_ref, np.zeros(self.model.n)
        ddq = self._bridging_acceleration
        ahead = q_ref + self.T * missed * (self.dq + self.T * (missed + 1) / 2.0 * ddq)
        lower = np.minimum(self.model.q_min, q_ref)
        upper = np.maximum(self.model.q_max, q_ref)
        stopped = np.clip(ahead, lower, upper)
        return stopped, np.where(stopped == ahead, self.dq + self.T * missed * ddq, 0.0)

    @property
    def _bridging_acceleration(self) -> np.ndarray:
        """Of the robot in cycles without a command, (n,) [rad/s^2]."""
        if self.bridging == 'extrapolate_acceleration' and not self.at_rest:
            return self._ddq_prev
        return np.zeros(self.model.n)

    def nearest_turn(self, q: np.ndarray) -> np.ndarray:
        """q (n,) [rad]; joints of more than one turn at that nearest to the last reference.

        Their drivers may report angles within one turn only. References continue across turns.
        """
        if self._q_ref is None or not self._multi_turn.size:
            return q
        turns = np.zeros(len(q))
        turns[self._multi_turn] = np.round((self._q_ref - q)[self._multi_turn] / _TURN)
        return q + _TURN * turns

    def update(
        self,
        q: np.ndarray,
        dx: np.ndarray,
        missed: int = 0,
        correction: np.ndarray | None = None,
    ) -> Command:
        """The command for one state.

        Args:
            q: Measured joint positions, (n,) [rad].
            dx: Velocity of the task, (m,) [m/s], and [rad/s] below it.
            missed: Cycles since the last update that went without one; the robot has bridged them.
            correction: The part of dx, (m,), that only holds what nobody asks to move. With scaling
                by components it yields to the rest.

        Raises:
            ArrayError: A wrong shape, NaN or infinity. The controller is as it was before.
            RangeError: For missed, or dx beyond 1e9. The controller is as it was before.
            DivergedError: The joints would exceed SPEED_LIMIT. Where dx is the reason,
                the controller is as it was before. Where its own velocity history is, it begins
                anew.
        """
        q, dx = self._checked(q, dx, missed)
        # Where the robot is by now, and with which velocity.
        before = (q if self._q_ref is None else self._q_ref, self.dq)
        if missed and self._q_ref is not None:
            before = self.bridged(missed)
        start, dq_prev = before
        if self._integrate_from == 'measurement':
            start = q
            dq_prev = self._dq_prev
        ddq_prev = self._bridging_acceleration if missed else self._ddq_prev
        at = q if self.policy.limits is None else start
        state = self._state(at, dq_prev, ddq_prev, correction)

        motion = self._motion_at(state, (missed + 1) * self.T)
        if self._ahead is not None and self._ahead.is_of(motion, state, dx):
            state = self._ahead.state
            solution = self._ahead.solution
        else:
            solution = motion.solve(state, dx, self.T)
        dq = solution.dq
        q_ref = np.empty(self.model.n)
        ddq = np.empty(self.model.n)
        if not integrate(start, self.T, dq, dq_prev, q_ref, ddq) <= SPEED_LIMIT:
            self._refuse(dq, dx, motion, state)

        # From here the next tick goes on.
        self.before = before
        self._q_ref = q_ref
        self._dq_prev = dq
        self._ddq_prev = ddq
        self.dq = dq
        if start is not before[0]:
            self.dq = np.empty(self.model.n)
            differentiate(q_ref, before[0], self.T, self.dq)
        self._motion = motion.after(solution) if isinstance(motion, Crossfade) else motion
        self._has_open_targets = False
        if self._begins_anew and not dq.any():
            self.place(q_ref)
        solution.dq = dq.copy()
        return Command(solution, q_ref.copy(), state, self.T)

    def prepare(self, dx: np.ndarray) -> None:
        """Solve the next tick before its state comes, while nobody waits for the command.

        update() then takes the solution over, if it has the same dx and nothing else has changed.
        Only a tick that does not depend on what is measured can be solved ahead: one with limits,
        without other sensors, and integrated from the last command.

        Args:
            dx: Velocity of the task in the next tick, (m,), as for update().
        """
        is_known = self.policy.limits is not None and self._integrate_from == 'command'
        if self._q_ref is None or self._has_open_targets or self.measurements or not is_known:
            return
        state = self._state(self._q_ref, self.dq, self._ddq_prev)
        motion = self._motion_at(state, self.T)
        is_prepared = self._ahead is not None and self._ahead.is_of(motion, state, dx)
        if is_prepared or motion is not self._motion:
            return
        try:
            solution = motion.solve(state, dx, self.T)
        except RedresError:
            return  # update() will raise it
        self._ahead = _Ahead(motion, state, dx.tobytes(), solution)

    def standing(self) -> Command:
        """The command of an arm at rest: the last reference again, exactly.

        Raises:
            RedresError: There is no reference yet.
        """
        q_ref = self.reference
        zeros = np.zeros(self.model.n)
        state = RobotState(self.model, q_ref, zeros)
        policy = self.policy.for_joints if self._follows_joints else self.policy
        J = policy.task.jacobian(state)
        return Command(Solution(zeros, J, zeros[: self.m]), q_ref.copy(), state, self.T)

    def _state(
        self,
        q: JointPositions,
        dq_prev: JointVelocities,
        ddq_prev: JointAccelerations,
        correction: TaskVelocity | None = None,
    ) -> RobotState:
        """The state of a tick; arguments as of RobotState and TickContext."""
        tick = TickContext(self.measurements, self.gap, self.longest_gap, correction)
        return RobotState(self.model, q, dq_prev, ddq_prev, tick)

    def _motion_at(self, state: RobotState, elapsed: float) -> Motion:
        """The motion of this tick, `elapsed` [s] after the last one."""
        if self._has_open_targets:
            self._targeted = self._targeted.with_initial_targets(state)
        policy = self._targeted.for_joints if self._follows_joints else self._targeted
        desired = policy if self.moving and not self._begins_anew else policy.stop
        if self._motion is desired:
            return desired
        return advanced(self._motion, desired, state.dq_prev, elapsed, self.switch_time)

    def _forget_motion(self) -> None:
        """Reset to rest, with unset targets."""
        self.dq = np.zeros(self.model.n)  # the velocity of the last reference, (n,) [rad/s]
        self._dq_prev = self.dq  # the last command, which is another one from a measurement
        self._ddq_prev = np.zeros(self.model.n)  # its acceleration, (n,) [rad/s^2]
        self._motion = self.policy.stop
        self._targeted = self.policy
        self._has_open_targets = True
        self._begins_anew = False  # once the arm has come to rest

    def _checked(self, q: np.ndarray, dx: np.ndarray, missed: int) -> tuple[np.ndarray, np.ndarray]:
        """q (n,) [rad], of the nearest turn, and dx (m,); raises as update() says."""
        if missed and not (isinstance(missed, Integral) and 0 < missed <= _MOST_MISSED):
            raise RangeError('missed', missed, 0, _MOST_MISSED, 'a whole number of cycles')
        q = as_vector(q, self.model.n, 'q').copy()  # the command's state keeps it
        dx = as_vector(dx, self.m, 'dx')
        if not are_usable(q, dx, _DX_LIMIT):
            check_finite(q, 'q')
            check_finite(dx, 'dx')
            raise RangeError('dx', float(np.abs(dx).max()), 0.0, _DX_LIMIT)
        return self.nearest_turn(q) if self._multi_turn.size else q, dx

    def _replace(self, field: str, **given: Any) -> None:
        """Go over to the policy with another building block, unless it is in force.

        Args:
            field: Of the policy.
            **given: As of make_policy().
        """
        made = make_policy(self.model, **{'law': self.law, **given})
        policy = replace(self.policy, **{field: getattr(made, field)})
        if policy != self.policy:
            self.set_policy(policy)

    def _refuse(
        self, dq: np.ndarray, dx: np.ndarray, motion: Motion, state: RobotState
    ) -> NoReturn:
        """Raise DivergedError for a speed beyond that of any arm.

        If dx alone would not ask for it, from rest, the velocity history does, and is dropped.
        """
        speed = float(np.linalg.norm(dq))
        at_rest = state.with_velocity(np.zeros(self.model.n))
        from_rest = motion.solve(at_rest, dx, self.T)
        reason = 'dx'
        if np.linalg.norm(from_rest.dq) <= SPEED_LIMIT:
            reason = 'its own motion'
            self.restart()
        raise DivergedError(speed, SPEED_LIMIT, reason)
