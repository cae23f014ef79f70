"""Everything between two ticks of the controller: modes, the robot's clock and session, task
velocities and their age, an arm that does not follow, and the gate.
"""

import math
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from redres_ros.command import Command
from redres_ros.controller import Controller
from redres_ros.errors import RedresError
from redres_ros.kernels.boxes import stopping_speed
from redres_ros.loop.cycle_counter import NANOSECONDS, ClockError, CycleCounter
from redres_ros.loop.following import FollowingMonitor
from redres_ros.loop.gate import Gate
from redres_ros.loop.modes import Conditions, Mode, next_mode
from redres_ros.loop.session import RobotSession
from redres_ros.loop.settings import LoopSettings
from redres_ros.loop.twist_buffer import TwistBuffer, TwistBufferSettings

_LITTLE = 0.05  # scaling factor below which a task hardly goes on
_LONG = 1.0  # [s] after which that is reported
# A response that was sent so shortly before the robot published the next state came after that.
_TOGETHER = 0.001  # [s] that both transports take, of the state and of the response
_TOGETHER_FRACTION = 0.25  # of a cycle, if that is less
_AT_REST = 1e-4  # [rad/s]
_PAUSE = 0.5  # [s] without a request for motion, after which a new one clears a fault
_SETTLING_TIME = 5.0  # [s] in which null-space motion has to come to rest, if no task moves
_SETTLED = 0.02  # [rad/s] of a joint that counts as at rest then
_NO_TASK = 1e-3  # [m/s], [rad/s] of a task velocity that hardly asks for anything
_LEAPS = 3.0  # states in short succession that cannot be of this arm
_LEAP_DECAY = 0.1  # of these for each good one
_APPROACH = 0.1  # fraction of the joints' speed limits
_APPROACH_ACCELERATION = 1.0  # [rad/s^2] for an arm whose own is not known
_ARRIVED = 1e-6  # [rad]
_ROUNDING = 1e-9  # of a limit
# rclpy's EventsExecutor hands no source time over (it crashes on callbacks that ask for it), so
# what was queued while the process slept can only be told by when it comes.
_QUEUED = 0.05  # [s] after a gap of all input, in which messages without a stamp may be old
_GAP_TIME = 2.0  # [s] after which a gap between states counts for less


class LeapError(RedresError):
    """A state in which a joint is where it cannot have got to since the last one."""


class TwistSpeedError(RedresError):
    """A task velocity that is faster than allowed."""


class TwistAgeError(RedresError):
    """A task velocity whose stamp is too far from the robot's clock."""


class Response(NamedTuple):
    """What is published for a state.

    Attributes:
        stamp: Of the state [ns].
        command: The command.
        scaling: Fraction of the task velocity that is executed; 0 while none is, because the arm is
            held, stops or mirrors.
        q: Measured positions, (n,) [rad].
    """

    stamp: int
    command: Command
    scaling: float
    q: np.ndarray


class _State(NamedTuple):
    """A state that has no response yet.

    stamp: [ns]; arrived: when it came [s].
    """

    stamp: int
    cycle: int
    q: np.ndarray
    arrived: float


class CommandLoop:
    """Turns states and task velocities into responses, at most one for each state.

    All times are given by the caller: stamps [ns], and arrivals by a monotonic clock [s].

    Args:
        controller: It is updated here and nowhere else.
        settings: Can be replaced at any time.
        twists: How task velocities are buffered; in lock-step without lag.
    """

    def __init__(
        self,
        controller: Controller,
        settings: LoopSettings | None = None,
        twists: TwistBufferSettings | None = None,
    ) -> None:
        self.settings = settings or LoopSettings()
        self.responses = 0  # to states
        self.skipped = 0  # cycles whose state did not come
        twists = twists or TwistBufferSettings()
        if self.settings.lockstep:
            twists = replace(twists, twist_lag=0)
        self.twist_buffer = TwistBuffer(controller.m, controller.T, twists)
        A = np.array(controller.model.arm.acceleration_limit or [math.inf] * controller.model.n)
        self._joint_buffer = TwistBuffer(controller.model.n, controller.T, twists, A)
        self._buffer = self.twist_buffer  # the one in use
        controller.bridging = self.settings.bridging
        self.mode = Mode.HOLDING
        self.gate = Gate(controller)
        self.gate_action = ''  # what the gate did at the last state
        self.fault = ''  # what stopped the arm, until motion is asked for anew
        self.silence = ''  # after which the arm began anew at the last state
        self._active = True
        self._held = False  # by request
        self._executing = True  # False for an arm that does not move at all
        self._released = False  # nobody asks any more for the motion that a fault stopped
        self._A = A
        self._controller = controller
        self._cycles = CycleCounter(round(NANOSECONDS * controller.T))
        self._slowdown = _Slowdown()
        self._session = RobotSession(self.settings.lockstep)
        self._monitor = FollowingMonitor(controller.T, controller.model.n)
        self._twist_arrival = _TwistArrival()
        self._expecting = self.settings.lockstep  # that task velocities go on to come
        self._waiting: _State | None = None
        self.q: np.ndarray | None = None  # of the newest state, (n,) [rad]
        self._response: Response | None = None  # to the newest state
        self._response_cycle = 0  # of the newest state with a response
        self._state_cycle = 0  # of the newest state that was believed
        self._state_arrived = 0.0  # when that came [s]
        self._sent = -math.inf  # when the newest response was on its way [s]
        self._together = min(_TOGETHER, _TOGETHER_FRACTION * controller.T)  # [s]
        self._last_input = 0.0  # when any input came last [s]
        self._woke = -math.inf  # when input came again after a gap [s]
        self._leaps = 0.0
        self._pause = 0.0  # [s] for which no motion was asked for
        self._settling = 0.0  # [s] for which the arm has moved without a task
        self._gap = 1  # cycles between two responses, at most, of late
        self._gap_cycle = 0  # when that was
        self._target: np.ndarray | None = None  # of an approach to where the arm is, (n,) [rad]

    # --- what others ask for ----------------------------------------------------------------------

    @property
    def commanding(self) -> bool:
        """Whether the robot takes commands, as far as is known."""
        return self._executing and self._session.commanding_at(self._cycles.newest)

    @property
    def held(self) -> bool:
        """Whether a hold was asked for."""
        return self._held

    @property
    def limit_warning(self) -> str:
        """What has slowed the task down for a second or more; empty if nothing has."""
        return self._slowdown.warning(self._controller.T)

    @property
    def error(self) -> str:
        """What keeps the arm from moving, and what to do about it; empty if nothing does."""
        if self.fault:
            return f'{self.fault}; controller/hold with false, or a new motion, lets it go on'
        return self._cycles.rate_error or self._position_error()

    @property
    def warning(self) -> str:
        """What happened at the last state that should not; empty in the ordinary course."""
        if self.gate_action:
            return f'the gate has changed the reference: {self.gate_action}'
        return self.silence

    def _position_error(self) -> str:
        """Why the arm would have to leave the place at which it stands."""
        limits = self._controller.policy.limits
        if self.mode is not Mode.HOLDING or self.gate.is_open or limits is None:
            return ''
        standing = self._controller.standing()
        T = self._controller.T
        if limits.keep(standing.dq, standing.state, T):
            return ''
        _, _, active = limits.nearest(standing.dq, None, [], standing.state, T)
        return (
            f'held where a limit does not allow it ({active}): a task velocity moves it back '
            'within its limits, or change that limit'
        )

    def hold(self, held: bool) -> None:
        """Bring the arm to rest and hold it there, or let it go on; that clears a fault."""
        self._held = held
        if not held:
            self._clear_fault()

    def activate(self) -> None:
        """Publish from the next state on; clears a fault."""
        self._active = True
        if self.mode is Mode.INACTIVE:
            self.q = None  # meanwhile the arm may have been moved by others
        self._clear_fault()

    def deactivate(self) -> None:
        """Bring the arm to rest, and then publish nothing any more."""
        self._active = False
        if self.mode not in (Mode.MOVING, Mode.STOPPING):
            self.mode = Mode.INACTIVE
            self.gate.clear()

    def forget(self) -> None:
        """Know nothing of what came before; settings stay."""
        self._waiting = None
        self._response = None
        self.q = None
        self._held = False
        self._cycles = CycleCounter(round(NANOSECONDS * self._controller.T))
        self._begin_anew()

    def enter_session(self, word: str) -> None:
        """Take in the name of the robot's session state; a robot without one takes commands.

        One that begins to take commands executes them, whatever it did before.
        """
        self._session.enter(word)
        if not self._executing and self._session.commanding_at(self._cycles.newest):
            self._clear_fault()

    @property
    def rows(self) -> int:
        """m, rows of a task velocity."""
        return self._controller.policy.task.rows(self._controller.model)

    # --- states and task velocities ---------------------------------------------------------------

    def enter_state(self, stamp: int, q: np.ndarray, now: float) -> Response | None:
        """The response to a state; None if it waits for its task velocity, or nothing is published.

        Args:
            stamp: Of the state [ns].
            q: Measured joint positions, (n,) [rad].
            now: Its arrival [s].

        Raises:
            ClockError: The stamp is not that of a new cycle.
            LeapError: A joint has moved further than it can.
            RedresError: Positions that are not finite.
        """
        self._notice_sleep(now)
        if stamp and stamp == self._cycles.newest:
            return self._same_again(q, now)
        another_robot = self._cycles.newest > 0
        cycles = self._cycles.enter(stamp, now)
        q = self._controller.nearest_turn(q)
        if cycles == 0:
            if another_robot:
                self._session.begin(stamp)
            self._begin_anew()
        else:
            self._check_leap(q)
        if self._waiting:
            self._expecting = False  # the robot did not wait, so nobody else need
        self.q = q
        self._state_cycle = self._cycles.number
        self._state_arrived = now
        self._waiting = _State(stamp, self._cycles.number, q, now)
        return self.respond_if_due(now)

    def _notice_sleep(self, now: float) -> None:
        """Note the time [s] at which input comes again after a gap: the process may have slept."""
        if self._last_input and now - self._last_input > self.settings.command_timeout:
            self._woke = now
        self._last_input = now

    def note_sent(self, now: float) -> None:
        """The newest response is on its way at this time [s]."""
        self._sent = now

    def enter_twist(self, stamp: int, dx: np.ndarray, now: float) -> Response | None:
        """The response to the state that waited for this task velocity, if there is one.

        Args:
            stamp: Of the state that it belongs to, or another time on the robot's clock; 0 for now.
            dx: Task velocity, (m,) [m/s] and [rad/s].
            now: Its arrival [s].

        Raises:
            TwistSpeedError: It is too fast.
            TwistAgeError: It is too old, or stamped too far ahead.
        """
        self._check_speed(dx)
        return self._enter(self.twist_buffer, stamp, dx, now)

    def enter_joint_velocity(self, stamp: int, dq: np.ndarray, now: float) -> Response | None:
        """As enter_twist(), for velocities of all joints, (n,) [rad/s]; the newest kind counts."""
        excess = np.abs(dq) - self._controller.model.dq_max * (1.0 + _ROUNDING)
        if not (excess <= 0.0).all():
            joint = int(np.argmax(excess))
            name = self._controller.model.joint_names[joint]
            allowed = self._controller.model.dq_max[joint]
            raise TwistSpeedError(f'{name}: {dq[joint]:.6g} rad/s; allowed: {allowed:.6g}')
        return self._enter(self._joint_buffer, stamp, dq, now)

    def _enter(
        self, buffer: TwistBuffer, stamp: int, dx: np.ndarray, now: float
    ) -> Response | None:
        self._notice_sleep(now)
        if not self._cycles.newest:
            return None  # no state has come that it could belong to
        if not stamp and now - self._woke < _QUEUED:
            raise TwistAgeError(
                f'without a stamp, within {_QUEUED:g} s after a gap of all input: it may have been '
                'sent long before'
            )
        cycle = self._cycles.cycle(stamp) if stamp else self._cycles.number
        if not self._is_of_this_clock(cycle, now):
            return None
        of_a_state = stamp > 0 and self._cycles.is_of_a_state(stamp)
        self._twist_arrival = _TwistArrival(self._cycles.number, math.inf if of_a_state else now)
        self._expecting = self._expecting or of_a_state
        self._use(buffer)
        buffer.put(cycle, dx)
        return self.respond_if_due(now)

    def _use(self, buffer: TwistBuffer) -> None:
        """Go over to velocities of the task, or of the joints."""
        if buffer is not self._buffer:
            buffer.clear()
            self._buffer = buffer
            self._follow_joints(buffer is self._joint_buffer)

    def _follow_joints(self, follows: bool) -> None:
        self._target = None
        self._controller.follow_joints(follows)

    def respond_if_due(self, now: float) -> Response | None:
        """The response to the state that waits, once it need not wait any longer."""
        state = self._waiting
        if state is None or self._must_wait(state, now):
            return None
        self._waiting = None
        self._expecting = self._expecting and self._buffer.has(state.cycle)
        self._response = self._respond(state, now)
        if self._response is not None:
            self._response_cycle = state.cycle
            self.responses += 1
        return self._response

    # --- a tick -----------------------------------------------------------------------------------

    def _respond(self, state: _State, now: float) -> Response | None:
        missed = max(state.cycle - self._response_cycle - 1, 0) if self._response_cycle else 0
        self.skipped += missed
        missed = self._bridge(state, missed)
        stale = self._is_stale(state, now)
        dx = self._buffer.play(state.cycle)
        self._watch(state, dx, stale, missed)
        allowed = self._is_motion_allowed(stale)
        before = self.mode
        self.mode = next_mode(before, self._conditions(allowed, dx))
        if self.mode is not before:
            self._enter_mode(state)
        if self.mode is Mode.INACTIVE:
            return None
        if self.mode is Mode.HOLDING and stale:
            self._buffer.clear()
        command = self._command(state, dx, missed)
        follows = allowed and self._target is None and self._session.commanding_at(state.stamp)
        self._slowdown.enter(command, follows)
        return Response(state.stamp, command, command.s if follows else 0.0, state.q)

    def _conditions(self, allowed: bool, dx: np.ndarray) -> Conditions:
        """What decides on the mode, at this state."""
        asked = allowed and bool(dx.any())
        return Conditions(
            active=self._active,
            commandable=self.commanding,
            motion_allowed=allowed,
            motion_asked=asked,
            at_rest=not asked and float(np.abs(self.gate.dq).max()) <= _AT_REST,
        )

    def _enter_mode(self, state: _State) -> None:
        """Begin the mode that is in force from this state on."""
        controller = self._controller
        self._monitor.clear()
        self._settling = 0.0
        if self.mode is Mode.INACTIVE:
            self.gate.clear()
            controller.hold()
        elif self.mode is Mode.STOPPING:
            self._end_approach()
            controller.hold()
        elif self.mode is Mode.HOLDING:
            self._end_approach()
            self._stand_at(state.q if self.gate.is_open else self.gate.q_ref)
        elif self.mode is Mode.MOVING:
            if self.gate.is_open:
                self._stand_at(state.q)
            self._begin_approach(state.q)
            controller.resume()

    def _command(self, state: _State, dx: np.ndarray, missed: int) -> Command:
        """The command of the mode in force."""
        if self.mode is Mode.MIRRORING or self.gate.is_open:
            self._stand_at(state.q)
        if self.mode in (Mode.MIRRORING, Mode.HOLDING):
            return self._controller.standing()
        if self._target is not None:
            dx = self._approach_velocity(self._target)
        try:
            command = self._controller.update(state.q, dx, missed=missed)
        except RedresError as error:
            command = self._stop_for(str(error), state, missed)
        admitted = self.gate.admit(command.q_ref, missed)
        self.gate_action = admitted.reason
        if admitted.reason:
            self._controller.place(admitted.q_ref, admitted.dq)
            command = command._replace(q_ref=admitted.q_ref.copy(), dq=admitted.dq.copy())
        if self._target is not None and self._is_at(self._target):
            self._end_approach()
        return command

    def _stand_at(self, q: np.ndarray) -> None:
        """Be at rest with the reference q (n,) [rad]."""
        self._controller.place(q)
        self.gate.record(q)

    def _stop_for(self, reason: str, state: _State, missed: int) -> Command:
        """The first command of a stop, from what was published last, by an arm without a policy."""
        self.fault = reason
        self.mode = Mode.STOPPING
        self._controller.place(self.gate.q_ref, self.gate.dq)
        self._controller.hold()
        return self._controller.update(state.q, np.zeros(self._controller.m), missed=missed)

    def _bridge(self, state: _State, missed: int) -> int:
        """The cycles without a command that count; after a long silence the arm is at rest."""
        holds = self.settings.bridging == 'hold'
        if holds:
            self._rollback_if_late(state)
        elif missed <= self.settings.restart_after:
            self._count_gap(missed + 1, state.cycle)
        self.silence = ''
        if missed <= self.settings.restart_after or self.gate.is_open:
            return missed
        if self.mode in (Mode.MOVING, Mode.STOPPING):
            place = 'the last reference' if holds else 'the measured position'
            self.silence = (
                f'no state came in {missed} cycles, allowed {self.settings.restart_after}: the arm '
                f'goes on from {place}, at rest'
            )
            self._stand_at(self.gate.q_ref if holds else state.q)
            self.mode = Mode.HOLDING
        return 0

    def _count_gap(self, gap: int, cycle: int) -> None:
        """A joint has to stop in time also if the next states get lost as the last ones did."""
        if gap >= self._gap:
            self._gap = gap
            self._gap_cycle = cycle
        elif (cycle - self._gap_cycle) * self._controller.T > _GAP_TIME:
            self._gap -= 1
            self._gap_cycle = cycle
        self._controller.gap = self._gap

    def _rollback_if_late(self, state: _State) -> None:
        """Of two responses in one cycle, a robot that holds executes the second alone: the first
        must not count, or that would be a step of two cycles.

        Args:
            state: To be answered. The last response has come too late if this state was on its way
                already.
        """
        if self.mode not in (Mode.MOVING, Mode.STOPPING):
            return
        published = min(state.arrived, self._cycles.earliest_arrival)
        if published - self._sent < self._together:
            self._controller.rollback()
            self.gate.rollback()

    # --- faults -----------------------------------------------------------------------------------

    def _watch(self, state: _State, dx: np.ndarray, stale: bool, missed: int) -> None:
        """Notice an arm that does not follow or does not come to rest, and a fault that is over."""
        seconds = (missed + 1) * self._controller.T
        asks = not stale and float(np.abs(dx).max()) > _NO_TASK
        self._released = self._released or (stale and self._pause >= _PAUSE)
        if asks and self.fault and (self._released or self._pause >= _PAUSE):
            self._clear_fault()
        self._pause = 0.0 if asks else self._pause + seconds
        q_ref = self.gate.q_ref
        dq = self.gate.dq
        if self.fault or self.gate.is_open or self.mode not in (Mode.MOVING, Mode.STOPPING):
            return
        moves = self._monitor.enter(state.q, q_ref, dq, missed + 1)
        lag, joint = self._monitor.lag(state.q, q_ref)
        if lag > self.settings.following_tolerance:
            name = self._controller.model.joint_names[joint]
            self._set_fault(
                f'the arm does not follow: {name} is {lag:.3g} rad from its reference, allowed '
                f'{self.settings.following_tolerance:g}'
            )
        if not moves:
            self._executing = False
            self._set_fault('the arm does not move: the robot executes no commands')
        self._settling = 0.0 if asks else self._settling + seconds
        if self._settling > _SETTLING_TIME and float(np.abs(dq).max()) > _SETTLED:
            self._set_fault(
                f'the null-space motion has not come to rest within {_SETTLING_TIME:g} s'
            )

    def _is_motion_allowed(self, stale: bool) -> bool:
        """Whether nothing is against motion; a fault is not, once its motion was given up."""
        if not self._active or self._held or stale or self._cycles.rate_error:
            return False
        return not self.fault or self._released

    def _set_fault(self, reason: str) -> None:
        if not self.fault:
            self.fault = reason
            self._released = False
            self._pause = 0.0

    def _clear_fault(self) -> None:
        self.fault = ''
        self._executing = True
        self._released = False
        self._leaps = 0.0

    def _begin_anew(self) -> None:
        """Know nothing of what was published: the robot is another one, or was started again."""
        self._clear_fault()
        self._buffer.clear()
        self.gate.clear()
        self._monitor.clear()
        self._controller.restart()
        self._response_cycle = 0
        if self.mode is not Mode.INACTIVE:
            self.mode = Mode.HOLDING

    # --- an approach to where the arm is ----------------------------------------------------------

    def _begin_approach(self, q: np.ndarray) -> None:
        """Go to the measured position q (n,) [rad] first, if the arm is not at its reference."""
        if self._monitor.lag(q, self.gate.q_ref)[0] > self.settings.following_tolerance:
            self._follow_joints(True)
            self._target = q

    def _approach_velocity(self, target: np.ndarray) -> np.ndarray:
        """Velocity straight to a target (n,) [rad], from which all joints can stop, (n,)."""
        controller = self._controller
        rest = target - self.gate.q_ref
        A = np.minimum(self._A, _APPROACH_ACCELERATION)
        allowed = [
            min(stopping_speed(abs(d), a, controller.T), _APPROACH * V)
            for d, a, V in zip(
                rest.tolist(), A.tolist(), controller.model.dq_max.tolist(), strict=True
            )
        ]
        return rest * float(np.min(allowed / np.maximum(np.abs(rest), _ARRIVED)))

    def _is_at(self, target: np.ndarray) -> bool:
        return float(np.abs(target - self.gate.q_ref).max()) <= _ARRIVED

    def _end_approach(self) -> None:
        """Follow what is asked for again."""
        if self._target is not None:
            self._follow_joints(self._buffer is self._joint_buffer)

    # --- checks of what comes ---------------------------------------------------------------------

    def _check_leap(self, q: np.ndarray) -> None:
        """Refuse a state in which a joint has moved further than it can, q (n,) [rad].

        An encoder that fails for a moment is passed over. Several such states stop the arm: they
        may come from two robots with the same joint names. To an arm that is held none matters.
        """
        if self.q is None or self.mode in (Mode.HOLDING, Mode.INACTIVE):
            return
        leap = self._leap(q, self.q)
        tolerance = self.settings.following_tolerance
        if leap <= tolerance:
            self._leaps = max(self._leaps - _LEAP_DECAY, 0.0)
            return
        self._leaps += 1.0
        what = f'a joint has moved {leap:.3g} rad further than it can; allowed: {tolerance:g}'
        if self._leaps < _LEAPS:
            raise LeapError(f'{what} (parameter following_tolerance)')
        self._set_fault(f'{what}; does another robot publish joint_states, too?')

    def _leap(self, q: np.ndarray, before: np.ndarray) -> float:
        """By how much the joint that leapt furthest is further away than its speed allows [rad]."""
        seconds = self._controller.T * (self._cycles.number - self._state_cycle)
        reach = seconds * self._controller.model.dq_max  # (n,)
        return float((np.abs(q - before) - reach).max())

    def _same_again(self, q: np.ndarray, now: float) -> Response | None:
        """A robot that waits for its answer asks again, and gets the same one."""
        if not (self.q is not None and np.array_equal(q, self.q)):
            raise ClockError(
                'stamped as the last one, but with other positions; expected a later stamp'
            )
        return self.respond_if_due(now) if self._waiting else self._response

    def _must_wait(self, state: _State, now: float) -> bool:
        if self._buffer.has(state.cycle):
            return False
        if self.settings.lockstep:
            return True
        patience = self.settings.twist_patience
        return self._expecting and not self.held and now - state.arrived < patience

    def _is_stale(self, state: _State, now: float) -> bool:
        """By its stamp, and by its arrival on the robot's clock; on ours if it is of no state."""
        timeout = self.settings.command_timeout
        newest = max(self._buffer.age(state.cycle), state.cycle - self._twist_arrival.cycle)
        return newest * self._controller.T > timeout or now - self._twist_arrival.time > timeout

    def _check_speed(self, dx: np.ndarray) -> None:
        linear = math.hypot(*dx[:3].tolist())
        angular = math.hypot(*dx[3:].tolist())
        settings = self.settings
        if not linear <= settings.max_linear:
            raise TwistSpeedError(
                f'{linear:.6g} m/s; allowed: {settings.max_linear:g} (parameter max_linear)'
            )
        if not angular <= settings.max_angular:
            raise TwistSpeedError(
                f'{angular:.6g} rad/s; allowed: {settings.max_angular:g} (parameter max_angular)'
            )

    def _is_of_this_clock(self, cycle: int, now: float) -> bool:
        """Whether a task velocity of a cycle can be judged by the robot's clock.

        After a silence another robot may have begun, and its planner heard of it first. Raises
        TwistAgeError for one that is too old or stamped too far ahead while states come.
        """
        age = (self._cycles.number - cycle) * self._controller.T
        timeout = self.settings.command_timeout
        if abs(age) <= timeout:
            return True
        if now - self._state_arrived > timeout:
            return False
        side = 'behind' if age > 0.0 else 'ahead of'
        raise TwistAgeError(
            f"stamped {abs(age):.3g} s {side} the robot's clock; allowed: {timeout:g} "
            '(parameter command_timeout; a zero stamp means now)'
        )


class _TwistArrival(NamedTuple):
    """When a task velocity came: the cycle, and the time [s]; infinite if that does not matter."""

    cycle: int = 0
    time: float = math.inf


class _Slowdown:
    """Whether limits have left next to nothing of the task velocity for long."""

    def __init__(self) -> None:
        self._ticks = 0
        self._share = 1.0
        self._active_limits = ''

    def enter(self, command: Command, follows: bool) -> None:
        if not follows or command.s >= _LITTLE:
            self._ticks = 0
            return
        self._ticks += 1
        self._share = command.s
        self._active_limits = command.active_limits

    def warning(self, T: float) -> str:
        if self._ticks * T < _LONG:
            return ''
        return f'the limits leave {self._share:.1%} of the task velocity ({self._active_limits})'
