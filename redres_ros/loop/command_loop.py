"""Everything between two ticks of the controller: modes, the robot's clock and session, input
velocities, faults, and the gate.
"""

from typing import NamedTuple

import numpy as np

from redres_ros.command import Command
from redres_ros.contact.contact_control import ContactControl
from redres_ros.contact.force_sensor import TareError
from redres_ros.contact.settings import AdmittanceSettings
from redres_ros.controller import Controller
from redres_ros.errors import RedresError
from redres_ros.kernels.tick import largest
from redres_ros.loop.approach import Probe
from redres_ros.loop.cycle_counter import NANOSECONDS, ClockError, CycleCounter
from redres_ros.loop.faults import FaultMonitor
from redres_ros.loop.measurements import Measurements
from redres_ros.loop.modes import Conditions, Mode, next_mode
from redres_ros.loop.published_reference import MissedCycles, PublishedReference
from redres_ros.loop.session import RobotSession
from redres_ros.loop.settings import LoopSettings
from redres_ros.loop.twist_buffer import TwistBuffer, TwistBufferSettings
from redres_ros.loop.velocity_input import VelocityInput
from redres_ros.types import check_finite

_LITTLE = 0.05  # scaling factor below which a task hardly goes on
_LONG = 1.0  # [s] after which that is reported
_AT_REST = 1e-4  # [rad/s]
_NO_TASK = 1e-3  # [m/s], [rad/s] of a velocity that hardly asks for anything
_CLOCK_STEP = 0.1  # [s] at which a robot has another clock than before


class Response(NamedTuple):
    """The published response to a state.

    Attributes:
        stamp: Stamp of the state [ns].
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
        contact: How the arm yields to wrenches; None: not at all.
    """

    def __init__(
        self,
        controller: Controller,
        settings: LoopSettings | None = None,
        twists: TwistBufferSettings | None = None,
        contact: ContactControl | None = None,
    ) -> None:
        settings = settings or LoopSettings()
        twists = twists or TwistBufferSettings()
        contact = contact or ContactControl(AdmittanceSettings.of_rows(3), controller.T)
        controller.bridging = settings.bridging
        controller.longest_gap = settings.longest_gap
        self._controller = controller
        self._cycles = CycleCounter(round(NANOSECONDS * controller.T))
        self._missed = MissedCycles(controller)
        self._session = RobotSession(settings.lockstep)
        self.input = VelocityInput(controller, self._cycles, settings, twists)
        self.measurements = Measurements(controller, contact, self._cycles)
        self.faults = FaultMonitor(controller, settings.following_tolerance)
        self._reference = PublishedReference(
            controller, self.faults, self.input, self.measurements, twists
        )
        self.gate = self._reference.gate
        self.mode = Mode.HOLDING
        self.silence = ''  # after which the arm started again from the last state
        self.responses = 0  # to states
        self.skipped = 0  # cycles whose state did not come
        self.newest_response: Response | None = None
        self._response_cycle = 0  # of the newest state with a response
        self._newest: _State | None = None  # that was believed
        self._waiting: _State | None = None
        self._expecting = settings.lockstep  # that velocities go on to come
        self._active = True
        self._held = False  # by request
        self._blocked = False  # something is against any motion
        self._yields = False  # moves because a measurement asked for it, not a task velocity
        self._slow_since = 0  # cycle from which on limits have all but stopped the task; 0: none

    # --- what others ask for ----------------------------------------------------------------------

    @property
    def q(self) -> np.ndarray | None:
        """Measured positions of the newest state, (n,) [rad]; None before the first."""
        return self._newest.q if self._newest else None

    @property
    def commanding(self) -> bool:
        """Whether the robot takes commands, as far as is known."""
        return self.faults.executes and self._session.commanding_at(self._cycles.newest)

    @property
    def limit_warning(self) -> str:
        """What has slowed the task down for a second or more; empty if nothing has."""
        slow = self._slow_since and (self._response_cycle - self._slow_since) * self._controller.T
        if not self.newest_response or slow < _LONG:
            return ''
        _, command, scaling, _ = self.newest_response
        return f'the limits leave {scaling:.1%} of the task velocity ({command.active_limits})'

    @property
    def error(self) -> str:
        """What blocks motion, and the remedy; empty if nothing does."""
        if self.faults.reason:
            return (
                f'{self.faults.reason}; controller/hold with false, or a new motion, lets it go on'
            )
        if self._cycles.rate_error:
            return self._cycles.rate_error
        if self.mode is not Mode.HOLDING or not self._reference.exists or self._newest is None:
            return ''
        return self._reference.problem(self._newest.q)

    @property
    def warning(self) -> str:
        """The irregularity at the last state; empty if there was none."""
        if self.gate.reason:
            return f'the gate acts: {self.gate.reason}'
        return self.silence or self.measurements.problem

    def hold(self, held: bool) -> None:
        """Decelerate to rest and hold, or resume, which clears a fault."""
        self._held = held
        if not held:
            self.faults.clear()

    def activate(self) -> None:
        """Publish from the next state on; clears a fault."""
        self._active = True
        if self.mode is Mode.INACTIVE:
            self._newest = None  # meanwhile the arm may have been moved by others
        self.faults.clear()

    def deactivate(self) -> None:
        """Decelerate to rest, and then publish nothing."""
        self._active = False
        if self.mode not in (Mode.MOVING, Mode.STOPPING):
            self.mode = Mode.INACTIVE
            self._reference.exists = False

    def forget(self) -> None:
        """Reset all but the settings."""
        self._waiting = None
        self.newest_response = None
        self._newest = None
        self._held = False
        self._cycles.restart()
        self._begin_anew()

    def enter_session(self, word: str) -> None:
        """Record the name of the robot's session state; a robot without one takes commands.

        One that begins to take commands executes them, whatever it did before.
        """
        self._session.enter(word)
        if not self.faults.executes and self._session.commanding_at(self._cycles.newest):
            self.faults.clear()

    def set_connected(self, connected: bool) -> None:
        """Whether commands may reach the robot at all; a moving arm is not let go of."""
        if self.mode not in (Mode.MOVING, Mode.STOPPING):
            self._session.is_connected = connected

    # --- states and task velocities ---------------------------------------------------------------

    def enter_state(self, stamp: int, q: np.ndarray, now: float) -> Response | None:
        """The response to a state; None if it waits for its task velocity, or nothing is published.

        Args:
            stamp: Stamp of the state [ns].
            q: Measured joint positions, (n,) [rad].
            now: Its arrival [s].

        Raises:
            ClockError: The stamp is not that of a new cycle.
            LeapError: A joint has moved further than it can.
            ArrayError: Positions that are not finite.
        """
        check_finite(q, 'q')
        self.input.note_input(now)
        if stamp and stamp == self._cycles.newest:
            return self._same_again(q, now)
        stamp_before = self._cycles.newest
        clock_step = (stamp - stamp_before) / NANOSECONDS - now + self._cycles.arrived
        cycles = self._cycles.enter(stamp, now)
        q = self._controller.nearest_turn(q)
        if cycles == 0:
            if stamp_before:
                self._session.begin(stamp)
            q_ref = self._controller.reference if self._has_stayed(q, clock_step) else None
            self._begin_anew()
            if q_ref is not None:
                self._reference.place(q_ref)
        elif self._newest and self.mode not in (Mode.HOLDING, Mode.INACTIVE):
            seconds = (self._cycles.number - self._newest.cycle) * self._controller.T
            self.faults.check_leap(q, self._newest.q, seconds)
        if self._waiting:
            self._expecting = False  # the robot did not wait, so nothing else need
        self._newest = _State(stamp, self._cycles.number, q, now)
        self._waiting = self._newest
        return self.respond_if_due(now)

    def _has_stayed(self, q: np.ndarray, clock_step: float) -> bool:
        """Whether an arm was silent for long, but is where its last reference holds it.

        Args:
            q: Measured, (n,) [rad].
            clock_step: Step of the robot's clock against this computer's; large for another robot
                [s].
        """
        holds = self.mode is Mode.HOLDING or self.input.settings.bridging == 'hold'
        if not holds or not self._reference.exists or self.mode is Mode.MIRRORING:
            return False
        return abs(clock_step) < _CLOCK_STEP and not self.faults.is_away(q)

    def note_sent(self, now: float) -> None:
        """The newest response is on its way at this time [s]."""
        self._missed.sent = now

    def enter_twist(
        self, stamp: int, dx: np.ndarray, now: float, time_of_day: int = 0
    ) -> Response | None:
        """The response to the state that waited for this task velocity, if there is one.

        Args:
            stamp: Stamp of the state that it belongs to, or another time on the robot's clock [ns];
                0 for now.
            dx: Task velocity, (m,) [m/s] and [rad/s].
            now: Its arrival [s].
            time_of_day: The same by the computer's clock [ns]; 0: not known.

        Raises:
            TwistSpeedError: It is too fast.
            TwistAgeError: It is too old, or stamped too far ahead.
        """
        self.input.check_twist(dx)
        return self._enter(self.input.of_task, stamp, dx, now, time_of_day)

    def enter_joint_velocity(
        self, stamp: int, dq: np.ndarray, now: float, time_of_day: int = 0
    ) -> Response | None:
        """As enter_twist(), for velocities of all joints; the newest kind counts.

        Args:
            stamp: See enter_twist().
            dq: Joint velocities, (n,) [rad/s].
            now: Their arrival [s].
            time_of_day: See enter_twist().

        Raises:
            TwistSpeedError: A joint is faster than its limit.
        """
        self.input.check_joint_velocity(dq)
        return self._enter(self.input.of_joints, stamp, dq, now, time_of_day)

    def _enter(
        self, buffer: TwistBuffer, stamp: int, dx: np.ndarray, now: float, time_of_day: int
    ) -> Response | None:
        kind = self.input.buffer
        of_a_state = self.input.enter(buffer, stamp, dx, now, time_of_day)
        if self.input.buffer is not kind:
            self._reference.approach = None
        self._expecting = self._expecting or of_a_state
        response = self.respond_if_due(now)
        if of_a_state and self._waiting is None:
            self._prepare(buffer)
        return response

    def _prepare(self, buffer: TwistBuffer) -> None:
        """Compute ahead what the next response needs, while nobody waits for it."""
        if self.mode is not Mode.MOVING or self.measurements.yields:
            return
        dx = buffer.prepare(self._cycles.number + 1)
        if dx is not None:
            self._controller.prepare(dx)

    def tare(self) -> None:
        """Take the measured wrench for the sensor's bias.

        Raises TareError while the arm moves or yields, or for a wrench that cannot be used.
        """
        if self._newest is None or self.mode in (Mode.MOVING, Mode.STOPPING):
            raise TareError(f'the arm is {self.mode.value}; expected one at rest: hold it first')
        if self.measurements.contact.is_on and not self._held:
            raise TareError(
                'the arm yields to the force that a tare would change at once: hold it, or set '
                'admittance.enabled to false first'
            )
        self.measurements.tare(self._newest.q)

    def respond_if_due(self, now: float) -> Response | None:
        """The response to the state that waits, once it need not wait any longer."""
        state = self._waiting
        if state is None:
            return None
        known = self.input.buffer.has(state.cycle)
        if not known and self._must_wait(state, now):
            return None
        self._waiting = None
        self._expecting = self._expecting and known
        self.newest_response = self._respond(state, now)
        if self.newest_response is not None:
            self._response_cycle = state.cycle
            self.responses += 1
        return self.newest_response

    def _same_again(self, q: np.ndarray, now: float) -> Response | None:
        """A robot that waits for its command asks again, and gets the same one."""
        if self._newest is None:  # activated while the robot waits
            q = self._controller.nearest_turn(q)
            self._newest = _State(self._cycles.newest, self._cycles.number, q, now)
            self._waiting = self._newest
        elif not np.array_equal(q, self._newest.q):
            raise ClockError(
                'stamped as the last one, but with other positions; expected a later stamp'
            )
        return self.respond_if_due(now) if self._waiting else self.newest_response

    def _must_wait(self, state: _State, now: float) -> bool:
        """Whether a task velocity that is not there may yet come in time."""
        if self.input.settings.lockstep:
            return True
        patience = self.input.settings.twist_patience
        return self._expecting and not self._held and now - state.arrived < patience

    # --- a tick -----------------------------------------------------------------------------------

    def _respond(self, state: _State, now: float) -> Response | None:
        """What was missed, what is asked for, the mode that follows, and its command."""
        missed = self._bridge(state)
        self._blocked = bool(not self._active or self._held or self._cycles.rate_error)
        commandable = self._session.commanding_at(state.stamp)
        stale = self.input.is_stale(state.cycle, now)
        dx = self.input.buffer.play(state.cycle)
        self._measure(state, missed)
        self._watch(state, dx, stale, missed)
        self._change_mode(state, dx, stale, commandable)
        if self.mode is Mode.INACTIVE:
            return None
        if stale and (self.mode is Mode.HOLDING or self._yields):
            self.input.buffer.clear()
            dx = np.zeros(len(dx))
        command = self._command(state, dx, missed)
        follows = commandable and self._reference.approach is None
        follows = follows and self._is_motion_allowed(stale)
        if not follows or command.s >= _LITTLE:
            self._slow_since = 0
        elif not self._slow_since:
            self._slow_since = state.cycle
        return Response(state.stamp, command, command.s if follows else 0.0, state.q)

    def _bridge(self, state: _State) -> int:
        """The cycles without a command that count; after a long silence the arm is at rest."""
        self.silence = ''
        missed = max(state.cycle - self._response_cycle - 1, 0) if self._response_cycle else 0
        self.skipped += missed
        moves = self.mode in (Mode.MOVING, Mode.STOPPING)
        if moves and self._controller.bridging == 'hold':
            self._missed.rollback_if_late(min(state.arrived, self._cycles.earliest_arrival))
        allowed = self.input.settings.restart_after
        if missed <= allowed:
            self._missed.count(missed, state.cycle)
            return missed
        last = self.newest_response
        if last is None or not self._reference.exists:
            return missed
        if self._missed.explain(state.q - last.q, missed):
            return missed
        if moves:
            holds = self._controller.bridging == 'hold'
            place = 'the last reference' if holds else 'the measured position'
            self.silence = (
                f'no state came in {missed} cycles, allowed {allowed}: the arm goes on from '
                f'{place}, at rest'
            )
            self._reference.place(self._controller.reference if holds else state.q)
            self.mode = Mode.HOLDING
        return 0

    def _measure(self, state: _State, missed: int) -> None:
        """Update measurements beside positions; they restart while motion is blocked."""
        if self._blocked or self.faults.reason or self._reference.approach is not None:
            self.measurements.restart()
        try:
            self.measurements.update(state.q, missed, self.mode is not Mode.MOVING)
        except RedresError as error:
            self.faults.set(str(error))
            self.measurements.restart()

    def _watch(self, state: _State, dx: np.ndarray, stale: bool, missed: int) -> None:
        """Notice faults, and that one is over."""
        asks = not stale and largest(dx) > _NO_TASK
        asks = asks or (self._yields and self.measurements.asks)
        self.faults.note_request(asks, stale, (missed + 1) * self._controller.T)
        approach = self._reference.approach
        if isinstance(approach, Probe):
            if approach.has_failed:
                self.faults.set_not_executing()
        elif self.mode in (Mode.MOVING, Mode.STOPPING) and not self.faults.reason:
            self.faults.watch(state.q, missed + 1)

    def _is_motion_allowed(self, stale: bool) -> bool:
        """Whether motion is allowed; a fault does not count once its motion was given up."""
        if self._blocked or stale:
            return False
        return not self.faults.reason or self.faults.released

    def _is_yielding_allowed(self, stale: bool) -> bool:
        """Whether an arm follows what is measured, and comes to rest after it by itself."""
        if self._blocked or self.faults.reason:
            return False
        if self._yields:
            return True
        interrupted = stale and self.mode is Mode.MOVING  # it brakes first
        retreats = self.measurements.contact.retreats
        return self.measurements.asks and (retreats or not interrupted)

    def _change_mode(self, state: _State, dx: np.ndarray, stale: bool, commandable: bool) -> None:
        """Switch to the mode of this state."""
        allowed = self._is_motion_allowed(stale)
        asked = allowed and (largest(dx) > 0.0 or self.faults.is_probing)
        if (self._yields or self.measurements.asks) and self._is_yielding_allowed(stale):
            allowed = True
            asked = asked or self.measurements.asks
        conditions = Conditions(
            # A robot that extrapolates rests only after the same reference twice.
            active=self._active or not self._controller.at_rest,
            commandable=self.faults.executes and commandable,
            motion_allowed=allowed,
            motion_asked=asked,
            at_rest=not asked and largest(self._controller.dq) <= _AT_REST,
        )
        mode = next_mode(self.mode, conditions)
        self._yields = mode is Mode.MOVING and stale
        if mode is not self.mode:
            self.mode = mode
            self._begin_mode(state)

    def _begin_mode(self, state: _State) -> None:
        """What the mode of this state begins with."""
        reference = self._reference
        self.faults.begin()
        if self.mode is Mode.MOVING:
            reference.begin_motion(state.q)
            return
        reference.end_approach()
        if self.mode is not Mode.HOLDING:
            self.measurements.restart()
        if self.mode is Mode.INACTIVE:
            reference.exists = False
        elif self.mode is Mode.STOPPING:
            self._controller.hold()
        elif self.mode is Mode.HOLDING:
            reference.rest(state.q)

    def _command(self, state: _State, dx: np.ndarray, missed: int) -> Command:
        """The command of the mode in force."""
        reference = self._reference
        if self.mode is Mode.MIRRORING or not reference.exists:
            reference.place(state.q)
        if self.mode in (Mode.MIRRORING, Mode.HOLDING):
            return reference.standing()
        try:
            return reference.moving(state.q, dx, missed, yields=self.mode is Mode.MOVING)
        except RedresError as error:
            self.faults.set(str(error))
        self.mode = Mode.STOPPING
        self.measurements.restart()
        return reference.braking(state.q, missed)

    def _begin_anew(self) -> None:
        """Reset the published references: the robot is another one, or was restarted."""
        self.faults.clear()
        self.input.buffer.clear()
        self.faults.begin()
        self._reference.exists = False
        self._controller.restart()
        self._response_cycle = 0
        if self.mode is not Mode.INACTIVE:
            self.mode = Mode.HOLDING
