"""The controller of Fig. 1: joint positions and a task velocity in, a position reference out."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from numbers import Integral
from types import MappingProxyType
from typing import TYPE_CHECKING, Any

import numpy as np

from redres_ros.command import ROBOT_INTERFACES, Command, Published, RobotInterface
from redres_ros.errors import ArrayError, DivergedError, RangeError, RedresError, quoted
from redres_ros.kernels.tick import are_usable, integrate
from redres_ros.laws import Law
from redres_ros.parameter import Parameter, check_kind, check_value
from redres_ros.policy import SPEED_LIMIT, Crossfade, Hold, Motion, Policy, advanced, make_policy
from redres_ros.preferences import Preference
from redres_ros.preview import Ahead, Preview
from redres_ros.resolution import Solution
from redres_ros.robot_model import Correction, RobotModel, RobotState, TickContext
from redres_ros.tasks import Task
from redres_ros.types import (
    FLOAT64,
    Cycles,
    JointPositions,
    Seconds,
    TaskVelocity,
    as_vector,
    check_finite,
    finite_vector,
)

if TYPE_CHECKING:
    from redres_ros.limits.limit import Limit

INTEGRATE_FROM = ('command', 'measurement')
_DX_LIMIT = 1e9  # [m/s], [rad/s]; faster than light: squares of much more would overflow
_MOST_MISSED = 1_000_000  # cycles, which nobody bridges
SAMPLING_TIME = Parameter('of the robot [s]', 1e-5, 1.0)
_SWITCH_TIME = Parameter('of changes [s]', 0.0, 60.0)
_INTEGRATE_FROM = Parameter('what a reference goes on from', choices=INTEGRATE_FROM)
_ROBOT_INTERFACE = Parameter('the kind of robot', choices=tuple(ROBOT_INTERFACES))
_TURN = 2.0 * np.pi  # [rad]
_NOTHING = np.empty(0)


@dataclass(slots=True, repr=False)  # made in every tick
class Plan(Command):
    """A command before it is published.

    Attributes:
        base: Where the robot is by now, and its motion.
        reference: What the tick after this one continues from.
    """

    motion: Motion
    base: Published
    reference: Published


def _of_tick(name: str) -> Any:
    """An attribute of a controller that its states have, too, in their `tick`."""

    def _assign(controller: 'Controller', value: Any) -> None:
        controller._tick = replace(controller._tick, **{name: value})

    return property(lambda controller: getattr(controller._tick, name), _assign)


class Controller:
    """Turns task velocities into position references by the active policy.

    Attributes:
        published: The last reference; None before the first.
        policy: The requested one; a crossfade towards it may be under way.
        has_turns: Joints have more than one turn.
    """

    measurements = _of_tick('measurements')  # by name, for preferences and limits
    gap = _of_tick('gap')  # cycles between two commands, at most: joints still stop in time
    longest_gap = _of_tick('longest_gap')  # the same, once on the way to the end of a range

    def __init__(
        self,
        model: RobotModel,
        law: str | Law,
        T: Seconds,
        *,
        task: str | Task = 'position',
        switch_time: Seconds = 0.0,
        integrate_from: str = 'command',
        robot_interface: str | RobotInterface = 'fri',
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
            task: What dx is the velocity of.
            switch_time: Duration of the crossfade of changes, starts and stops; 0: at once.
            integrate_from: q_ref = q + T dq (footnote 1) with q the last 'command', so that a
                servo's lag does not make the arm creep, or the last 'measurement'.
            robot_interface: What the robot does without a command: a name in ROBOT_INTERFACES.
            limit_scale: Factor on the arm's velocity and acceleration limits.
            torque_scale: Factor on its torque limits.
            limit_gains: Gains of limits given by name, such as {'position.margin': 0.02}.
            preferences: They add up.
            secondary_tasks: By priority, below `task`. A name holds the value at the start.
            scaling: What limits scale: the 'task' velocity as a whole, which keeps its direction,
                or its 'components', translation and rotation, for teleoperation.

        Raises RedresError for a value out of range, an unknown name, and what does not fit the arm.
        """
        check_value('T', T, SAMPLING_TIME)
        check_value('switch_time', switch_time, _SWITCH_TIME)
        check_value('integrate_from', integrate_from, _INTEGRATE_FROM)
        if not isinstance(robot_interface, RobotInterface):
            check_value('robot_interface', robot_interface, _ROBOT_INTERFACE)
            robot_interface = ROBOT_INTERFACES[robot_interface]
        self.model = model
        self.T = T
        self.switch_time = switch_time
        self.robot_interface = robot_interface
        self._integrate_from = integrate_from
        self._q_shape = (model.n,)
        self._multi_turn = np.flatnonzero(model.q_max - model.q_min > _TURN)  # joints
        self.has_turns = bool(self._multi_turn.size)
        self._tick = TickContext(lost=robot_interface.lost)
        self._holds = False  # after hold()
        self._brakes = False  # without a crossfade
        self.follows_joints = False
        self.published: Published | None = None
        self.policy = make_policy(
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
        self._targeted = self.policy  # with all targets, once it is in force
        self._desired: Policy | Hold = self.policy
        self._motion: Motion = self.policy.stop
        self.restart()
        self.set_policy(self.policy)

    @property
    def law(self) -> Law:
        """The requested law."""
        return self.policy.law

    @property
    def horizon(self) -> Seconds:
        """How long a path its law wants to know ahead; 0 for none."""
        return self.policy.law.horizon

    @property
    def reference(self) -> JointPositions:
        """The last position reference. Raises RedresError before the first."""
        if self.published is None:
            raise RedresError('there is no reference yet; expected an update() or hold_at() first')
        return self.published.q.copy()

    def set_policy(self, policy: Policy) -> None:
        """Switch to another policy; of several during one crossfade the last one counts.

        Raises RedresError for one that does not fit the arm or T; the one in force then stays.
        """
        check_kind('policy', policy, Policy, 'a Policy, as make_policy() makes them')
        policy.check(self.model, self.T)
        kept = {}  # what has its targets keeps them
        for name in ('preferences', 'secondary_tasks'):
            if getattr(policy, name) == getattr(self.policy, name):
                kept[name] = getattr(self._targeted, name)
        if policy.limits is not None and policy.limits.bounds_acceleration:
            self._motion = self._motion.within(policy.limits)  # nothing can jump under them
        self.policy = policy
        self._targeted = replace(policy, **kept)
        self._has_open_targets = True
        self.follow_joints(self.follows_joints)

    def follow_joints(self, follows: bool, *, at_once: bool = False) -> None:
        """Whether dx is that of all joints, (n,) [rad/s]; at once: if A is limited, unfaded."""
        limits = self.policy.limits
        self._brakes = at_once and bool(limits and limits.bounds_acceleration)
        self.follows_joints = follows
        self._choose()
        self.m = self.model.n if follows else self.policy.task.rows(self.model)
        self._dx_shape = (self.m,)

    def switch_law(self, law: str | Law) -> None:
        """Switch to another law, or to other gains; by name or as an object.

        Raises UnknownNameError, and RangeError for a damping outside [0, 1/T]; the law then stays.
        """
        self._replace('law', law=law)

    def set_limits(
        self,
        limits: Iterable['str | Limit'],
        *,
        limit_scale: float = 1.0,
        torque_scale: float = 1.0,
        limit_gains: Mapping[str, Any] = MappingProxyType({}),
    ) -> None:
        """Switch to other limits; arguments as at construction.

        With a limit on the acceleration they act at once, also on a crossfade under way, because
        nothing can jump under it. Others are faded in. Raises RedresError for what cannot be used;
        those in force then stay.
        """
        scales = {'limit_scale': limit_scale, 'torque_scale': torque_scale}
        self._replace('limits', limits=limits, gains=limit_gains, **scales)

    def set_scaling(self, scaling: str) -> None:
        """Have limits scale the 'task' velocity as a whole, or its 'components'."""
        if scaling != self.policy.scaling:
            self._replace('scaling', scaling=scaling)

    def _replace(self, field: str, **given: Any) -> None:
        """Switch to the policy with another building block, made of `given` as by make_policy()."""
        made = make_policy(self.model, **{'law': self.law, **given})
        policy = replace(self.policy, **{field: getattr(made, field)})
        if policy != self.policy:
            self.set_policy(policy)

    def hold(self, *, at_once: bool = False) -> None:
        """Decelerate to rest, without a task; at once: without a crossfade, if A is limited."""
        limits = self.policy.limits
        self._brakes = at_once and bool(limits and limits.bounds_acceleration)
        self._holds = True
        self._choose()

    def resume(self) -> None:
        """Follow the policy again, from now on."""
        self._holds = False
        self._brakes = False
        self._choose()

    def reset(self) -> None:
        """Restart at the measured position, at rest.

        With a limit on the acceleration an arm in motion brakes first, and starts again where its
        reference is by then, without velocity history: nothing steps.
        """
        limits = self.policy.limits
        moves = self.published is not None and bool(self.published.dq.any())
        self._restarts = bool(limits and limits.bounds_acceleration and moves)
        self._choose()
        if not self._restarts:
            self.restart()

    def restart(self) -> None:
        """Restart at the next measured position: nothing was published."""
        self.published = None
        self._motion = self.policy.stop
        self._targeted = self.policy
        self._has_open_targets = True
        self._restarts = False  # once the arm has come to rest
        self._choose()

    def hold_at(self, q_ref: JointPositions) -> None:
        """Be at rest with a reference, where the next motion begins.

        Raises ArrayError for a wrong shape, NaN or infinity; the controller is as it was before.
        """
        q_ref = as_vector(q_ref, self.model.n, 'q_ref').copy()
        check_finite(q_ref, 'q_ref')
        self.restart()
        self.published = Published.at_rest(q_ref)

    def bridged(self, published: Published, missed: Cycles) -> Published:
        """Where the robot is, `missed` cycles after a reference, as if that was published."""
        q_range = self.model.q_min, self.model.q_max
        return self.robot_interface.bridged(published, missed, q_range, self.T)

    def nearest_turn(self, q: JointPositions) -> JointPositions:
        """q, with joints of more than one turn at the turn nearest to the last reference.

        Their drivers may report angles within one turn only. References continue across turns.
        """
        if self.published is None:
            return q
        turns = np.zeros(len(q))
        turns[self._multi_turn] = np.round((self.published.q - q)[self._multi_turn] / _TURN)
        return q + _TURN * turns

    def update(
        self,
        q: JointPositions,
        dx: TaskVelocity,
        missed: Cycles = 0,
        correction: Correction | None = None,
        ahead: Preview | None = None,
    ) -> Command:
        """The command for one state, which counts as published.

        Args:
            q: Measured.
            missed: Cycles since the last update that went without one; the robot has bridged them.
            correction: The part of dx that only holds what nobody asks to move. With scaling by
                components it yields where the rest could not go on.
            ahead: The tip's path from this tick on, for a law with a horizon. It decides the motion
                in the null space alone. An old one, or one that begins elsewhere, counts as none.

        Raises:
            ArrayError: A wrong shape, NaN or infinity. The controller is as it was before.
            RangeError: For missed, or dx beyond 1e9. The controller is as it was before.
            DivergedError: The joints would exceed SPEED_LIMIT. Where dx is the reason, the
                controller is as it was before. Where its own velocity history is, it restarts.
        """
        return self.commit(self.plan(q, dx, missed, correction, ahead))

    def plan(
        self,
        q: JointPositions,
        dx: TaskVelocity,
        missed: Cycles = 0,
        correction: Correction | None = None,
        ahead: Preview | None = None,
    ) -> Plan:
        """The next reference, for commit(); arguments as for update(). Raises RedresError."""
        if missed != 0 and not (isinstance(missed, Integral) and 0 < missed <= _MOST_MISSED):
            raise RangeError('missed', missed, 0, _MOST_MISSED, 'a whole number of cycles')
        are_arrays = type(q) is type(dx) is np.ndarray and q.dtype is dx.dtype is FLOAT64
        if not are_arrays or q.shape != self._q_shape or dx.shape != self._dx_shape:
            q = as_vector(q, self.model.n, 'q')
            dx = as_vector(dx, self.m, 'dx')
        if not are_usable(q, dx, _DX_LIMIT):
            check_finite(q, 'q')
            check_finite(dx, 'dx')
            raise RangeError('dx', float(np.abs(dx).max()), 0.0, _DX_LIMIT)
        tick = self._tick
        if correction is not None:
            tick = replace(tick, correction=_checked(correction, self.m))
        base = self.published or Published.at_rest(q)
        if missed:
            base = self.bridged(base, missed)
        start = base.q
        dq_prev = base.dq
        if self._integrate_from == 'measurement':
            start = q
            dq_prev = base.command
        at = start
        if at is q or self.policy.limits is None:
            at = q.copy()  # the command's state keeps it
        known = None
        if ahead is not None:
            check_kind('ahead', ahead, Preview, 'a Preview or None')
            path = ahead.of_rows(self.m)
            if path and ahead.times[-1] > 0.0 and self.m == self.policy.path_rows:
                known = Ahead(path, (missed + 1) * self.T, base.plan)
        state = RobotState(self.model, at, dq_prev, base.ddq, tick, known)
        if self._has_open_targets:
            self._targeted = self._targeted.with_initial_targets(state)
            self._choose()
        motion: Motion = self._desired
        if self._motion is not motion:
            elapsed = (missed + 1) * self.T
            time = 0.0 if self._brakes else self.switch_time
            motion = advanced(self._motion, self._desired, dq_prev, elapsed, time, base.plan)
        solution = motion.solve(state, dx, self.T)
        dq = solution.dq
        q_ref = start.copy()
        ddq = dq_prev.copy()
        command = dq_ref = dq.copy()  # whatever is done to the solution's own
        last = _NOTHING
        if start is not base.q:
            last = dq_ref = base.q.copy()
        speed = integrate(dq, self.T, q_ref, ddq, last)
        if not speed <= SPEED_LIMIT:
            raise self._diverged(motion, state, dx, speed)
        reference = Published(q_ref, dq_ref, ddq, command, solution.plan)
        return Plan(solution, q_ref.copy(), state, self.T, motion, base, reference)

    def commit(self, plan: Plan) -> Command:
        """The command of a plan, from which the next tick continues."""
        motion = plan.motion
        if isinstance(motion, Crossfade):
            motion = motion.after(plan.solution)
        self._motion = motion
        self._has_open_targets = False
        self.published = plan.reference
        if self._restarts and not plan.dq.any():
            self.hold_at(plan.q_ref)
        return plan

    def hold_command(self) -> Command:
        """The command of an arm at rest: the last reference again, exactly."""
        q_ref = self.reference
        zeros = np.zeros(self.model.n)
        state = RobotState(self.model, q_ref, zeros)
        policy = self.policy.for_joints if self.follows_joints else self.policy
        solution = Solution(zeros, policy.task.jacobian(state), np.zeros(self.m))
        return Command(solution, q_ref.copy(), state, self.T)

    def _choose(self) -> None:
        """Decide what the arm is to do, once no crossfade is under way."""
        policy = self._targeted.for_joints if self.follows_joints else self._targeted
        self._desired = policy.stop if self._holds or self._restarts else policy

    def _diverged(
        self, motion: Motion, state: RobotState, dx: TaskVelocity, speed: float
    ) -> DivergedError:
        """The error of a speed beyond that of any arm.

        If dx alone would not ask for it, from rest, the velocity history does, and is dropped.
        """
        from_rest = motion.solve(state.with_velocity(np.zeros(self.model.n)), dx, self.T)
        if np.linalg.norm(from_rest.dq) > SPEED_LIMIT:
            return DivergedError(speed, SPEED_LIMIT, 'dx')
        self.restart()
        return DivergedError(speed, SPEED_LIMIT, 'its own motion')


def _checked(correction: Correction, m: int) -> Correction:
    """The same with arrays of float64. Raises ArrayError for those of another task, or NaN."""
    check_kind('correction', correction, Correction, 'a Correction or None')
    is_held = np.asarray(correction.is_held)
    if is_held.dtype != bool or is_held.shape != (m,):
        raise ArrayError(f'is_held of a correction is {quoted(is_held)}; expected {m} bools')
    velocity = finite_vector(correction.velocity, m, 'velocity of a correction')
    return Correction(velocity, is_held, finite_vector(correction.away, m, 'away of a correction'))
