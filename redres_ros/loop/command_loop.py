"""Everything between two ticks of the controller: modes, the robot's clock and session, input
velocities, faults, and the safety filter.
"""

from typing import NamedTuple

import numpy as np

from redres_ros.command import Command
from redres_ros.contact import AdmittanceSettings, ContactControl, TareError
from redres_ros.controller import Controller
from redres_ros.errors import RedresError
from redres_ros.kernels.tick import largest
from redres_ros.loop.commands import Commands
from redres_ros.loop.cycle_counter import NANOSECONDS, ClockError, CycleCounter
from redres_ros.loop.faults import FaultMonitor
from redres_ros.loop.measurements import Measurements
from redres_ros.loop.modes import MOVING_MODES, Conditions, Mode, RobotSession, next_mode
from redres_ros.loop.twist_buffer import TwistBuffer
from redres_ros.loop.velocity_input import LoopSettings, VelocityInput
from redres_ros.types import (
    Cycles,
    JointPositions,
    JointVelocities,
    Nanoseconds,
    Seconds,
    TaskVelocity,
    check_finite,
)

_LITTLE = 0.05  # scaling factor below which a task hardly goes on
_LONG = 1.0  # [s] after which that is reported
_AT_REST = 1e-4  # [rad/s]
_NO_TASK = 1e-3  # [m/s], [rad/s] of a velocity that hardly asks for anything
_CLOCK_STEP = 0.1  # [s] at which a robot has another clock than before


class Response(NamedTuple):
    """The published response to a state."""

    stamp: Nanoseconds  # of the state
    command: Command
    # Fraction of the task velocity that is executed; 0 while none is, because the arm is held,
    # stops or mirrors.
    scaling: float
    q: JointPositions  # measured
    cycle: int  # of the state


class _State(NamedTuple):
    """A state, and when it came."""

    stamp: Nanoseconds
    cycle: int
    q: JointPositions
    arrived: Seconds


class CommandLoop:
    """Turns states and task velocities into responses, at most one for each state.

    All times are given by the caller: stamps, and arrivals by a monotonic clock.

    Args:
        controller: It is updated here and nowhere else.
        contact: How the arm yields to wrenches; None: not at all.
    """

    def __init__(
        self,
        controller: Controller,
        settings: LoopSettings | None = None,
        contact: ContactControl | None = None,
    ) -> None:
        settings = settings or LoopSettings()
        contact = contact or ContactControl(AdmittanceSettings.of_rows(3), controller.T)
        self._controller = controller
        self._holds = controller.robot_interface.holds  # the robot does, without a command
        self._cycles = CycleCounter(round(NANOSECONDS * controller.T))
        self._session = RobotSession(settings.lockstep)
        self.input = VelocityInput(controller, self._cycles, settings)
        self.measurements = Measurements(controller, contact, self._cycles)
        self.faults = FaultMonitor(controller)
        self._commands = Commands(controller, self.faults, self.input, self.measurements)
        self.safety_filter = self._commands.safety_filter
        self.mode = Mode.HOLDING
        self.responses = 0  # to states
        self.skipped = 0  # cycles whose state did not come
        self.newest_response: Response | None = None
        self._silence = ''  # after which the arm started again from the last state
        self._newest: _State | None = None  # that was believed
        self._waiting: _State | None = None  # that has no response yet
        self._expecting = settings.lockstep  # that velocities go on to come
        self._active = True
        self._held = False  # by request
        self._yields_alone = False  # it moves only as measurements ask
        self._slow_since = 0  # cycle from which on limits have all but stopped the task; 0: none
        if not (self._holds or settings.lockstep):
            controller.longest_gap = controller.robot_interface.restart_after + 1

    # --- what others ask for ----------------------------------------------------------------------

    @property
    def q(self) -> JointPositions | None:
        """Measured positions of the newest state; None before the first."""
        return self._newest.q if self._newest else None

    @property
    def commanding(self) -> bool:
        """Whether the robot takes commands, as far as is known."""
        return self.faults.executes and self._session.commanding_at(self._cycles.newest)

    @property
    def limit_warning(self) -> str:
        """What has slowed the task down for a second or more; empty if nothing has."""
        response = self.newest_response
        if response is None or not self._slow_since:
            return ''
        if (response.cycle - self._slow_since) * self._controller.T < _LONG:
            return ''
        limits = response.command.active_limits
        return f'the limits leave {response.scaling:.1%} of the task velocity ({limits})'

    @property
    def error(self) -> str:
        """What blocks motion, and the remedy; empty if nothing does."""
        if reason := self.faults.reason:
            return f'{reason}; controller/hold with false, or a new motion, lets it go on'
        if self._cycles.rate_error:
            return self._cycles.rate_error
        if self.mode is not Mode.HOLDING or self._newest is None:
            return ''
        return self.faults.holding_problem(self._newest.q)

    @property
    def warning(self) -> str:
        """The irregularity at the last state; empty if there was none."""
        if self.safety_filter.reason:
            return f'the safety filter acts: {self.safety_filter.reason}'
        return self._silence or self.measurements.problem

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
        if self.mode not in MOVING_MODES:
            self.mode = Mode.INACTIVE

    def forget(self) -> None:
        """Reset all but the settings."""
        self._waiting = None
        self._newest = None
        self._held = False
        self._cycles.restart()
        self._begin_anew()

    def enter_session(self, state: str) -> None:
        """Record the name of the robot's session state; a robot without one takes commands.

        One that begins to take commands executes them, whatever it did before.
        """
        self._session.enter(state)
        if not self.faults.executes and self._session.commanding_at(self._cycles.newest):
            self.faults.clear()

    def set_connected(self, connected: bool) -> None:
        """Whether commands may reach the robot at all; a moving arm is not let go of."""
        if self.mode not in MOVING_MODES:
            self._session.is_connected = connected

    def tare(self) -> None:
        """Take the measured wrench for the sensor's bias.

        Raises TareError while the arm moves or yields, or for a wrench that cannot be used.
        """
        if self._newest is None or self.mode in MOVING_MODES:
            raise TareError(f'the arm is {self.mode.value}; expected one at rest: hold it first')
        if self.measurements.contact.is_on and not self._held:
            raise TareError(
                'the arm yields to the force that a tare would change at once: hold it, or set '
                'admittance.enabled to false first'
            )
        self.measurements.contact.sensor.tare()

    # --- states and task velocities ---------------------------------------------------------------

    def step(self, stamp: Nanoseconds, q: JointPositions, now: Seconds) -> Response | None:
        """The response to a state; None if it waits for its task velocity, or nothing is published.

        Raises:
            ClockError: The stamp is not that of a new cycle.
            LeapError: A joint has moved further than it can.
            ArrayError: Positions that are not finite.
        """
        if not np.isfinite(q).all():
            check_finite(q, 'q')
        self.input.note_input(now)
        stamp_before = self._cycles.newest
        if stamp and stamp == stamp_before:
            return self._same_again(q, now)
        clock_step = (stamp - stamp_before) / NANOSECONDS - now + self._cycles.arrived
        cycles = self._cycles.enter(stamp, now)
        q = self._controller.nearest_turn(q)
        if cycles == 0:
            if stamp_before:
                self._session.begin(stamp)
            held = self._held_reference(q, clock_step)
            self._begin_anew()
            if held is not None:
                self._controller.hold_at(held)
        elif self._newest and self.mode not in (Mode.HOLDING, Mode.INACTIVE):
            seconds = (self._cycles.number - self._newest.cycle) * self._controller.T
            self.faults.check_leap(q, self._newest.q, seconds)
        if self._waiting:
            self._expecting = False  # the robot did not wait, so nothing else need
        self._newest = _State(stamp, self._cycles.number, q, now)
        self._waiting = self._newest
        return self.respond_if_due(now)

    def _same_again(self, q: JointPositions, now: Seconds) -> Response | None:
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

    def _held_reference(self, q: JointPositions, clock_step: Seconds) -> JointPositions | None:
        """The last reference, if an arm that was silent for long is where that holds it.

        A robot whose clock has made a step against this computer's is another one.
        """
        published = self._controller.published
        is_held = self.mode is Mode.HOLDING or (self._holds and self.mode in MOVING_MODES)
        is_another = abs(clock_step) >= _CLOCK_STEP
        if published is None or not is_held or is_another or self.faults.is_away(q):
            return None
        return published.q

    def _begin_anew(self) -> None:
        """Reset the published references: the robot is another one, or was restarted."""
        self.faults.clear()
        self.faults.begin()
        self.input.buffer.clear()
        self._commands.end_approach()
        self._controller.restart()
        self.newest_response = None
        if self.mode is not Mode.INACTIVE:
            self.mode = Mode.HOLDING

    def note_sent(self, now: Seconds) -> None:
        """The newest response is on its way."""
        self._commands.sent = now

    def enter_twist(
        self, stamp: Nanoseconds, dx: TaskVelocity, now: Seconds, time_of_day: Nanoseconds = 0
    ) -> Response | None:
        """The response to the state that waited for this task velocity, if there is one.

        Args:
            stamp: Of the state that it belongs to, or another time on the robot's clock; 0 for now.
            time_of_day: Arrival by the computer's clock; 0: not known.

        Raises:
            TwistSpeedError: It is too fast.
            TwistAgeError: It is too old, or stamped too far ahead.
        """
        self.input.check_twist(dx)
        return self._enter(self.input.of_task, stamp, dx, now, time_of_day)

    def enter_joint_velocity(
        self, stamp: Nanoseconds, dq: JointVelocities, now: Seconds, time_of_day: Nanoseconds = 0
    ) -> Response | None:
        """As enter_twist(), for velocities of all joints; the newest kind counts."""
        self.input.check_joint_velocity(dq)
        return self._enter(self.input.of_joints, stamp, dq, now, time_of_day)

    def _enter(
        self,
        buffer: TwistBuffer,
        stamp: Nanoseconds,
        dx: TaskVelocity,
        now: Seconds,
        time_of_day: Nanoseconds,
    ) -> Response | None:
        kind = self.input.buffer
        of_a_state = self.input.enter(buffer, stamp, dx, now, time_of_day)
        if self.input.buffer is not kind:
            self._commands.end_approach()
        self._expecting = self._expecting or of_a_state
        response = self.respond_if_due(now)
        if of_a_state and self._waiting is None:
            self._prepare(buffer)
        return response

    def _prepare(self, buffer: TwistBuffer) -> None:
        """Compute ahead what the next response needs, while nobody waits for it."""
        follows = self.mode is Mode.MOVING and self._commands.approach is None
        if follows and not (self._yields_alone or self.measurements.yields):
            dx = buffer.prepare(self._cycles.number + 1)
            if dx is not None:
                self._controller.prepare(dx)

    def respond_if_due(self, now: Seconds) -> Response | None:
        """The response to the state that waits, once it need not wait any longer."""
        state = self._waiting
        if state is None:
            return None
        known = self.input.buffer.known_until >= state.cycle
        if not known:
            awaits = self._expecting and not self._held
            patience = self._controller.robot_interface.patience
            if self.input.settings.lockstep or (awaits and now - state.arrived < patience):
                return None
        self._waiting = None
        self._expecting = self._expecting and known
        self.newest_response = self._respond(state, now)
        self.responses += self.newest_response is not None
        return self.newest_response

    # --- a tick -----------------------------------------------------------------------------------

    def _respond(self, state: _State, now: Seconds) -> Response | None:
        """What was missed, what is asked for, the mode that follows, and its command."""
        missed = self._count_missed(state)
        stale = self.input.is_stale(state.cycle, now)
        dx = self.input.buffer.play(state.cycle)
        self._measure(state, missed)
        self._watch(state, dx, stale, missed)
        blocked = self._change_mode(state, dx, stale)
        if self.mode is Mode.INACTIVE:
            return None
        if stale and (self.mode is Mode.HOLDING or self._yields_alone):
            self.input.buffer.clear()
            dx = np.zeros(len(dx))
        try:
            command = self._command(state, dx, missed)
        except RedresError as error:
            self.faults.set(str(error))
            blocked = True
            self.mode = Mode.STOPPING
            self.measurements.restart()
            command = self._commands.brake(state.q, missed)
        follows = not (blocked or stale or self._commands.approach)
        if not follows or command.s >= _LITTLE:
            self._slow_since = 0
        elif not self._slow_since:
            self._slow_since = state.cycle
        scaling = command.s if follows else 0.0
        return Response(state.stamp, command, scaling, state.q, state.cycle)

    def _count_missed(self, state: _State) -> Cycles:
        """The cycles without a command that count; after a long silence the arm is at rest."""
        self._silence = ''
        last = self.newest_response
        moves = self.mode in MOVING_MODES
        if moves and self._holds:
            self._commands.drop_late(min(state.arrived, self._cycles.earliest_arrival))
        published = self._controller.published
        if last is None or published is None:
            return 0
        missed = max(state.cycle - last.cycle - 1, 0)
        self.skipped += missed
        allowed = self._controller.robot_interface.restart_after
        if missed <= allowed:
            if missed or self._commands.interval > 1:
                self._commands.allow_for_interval(missed, state.cycle)
            return missed
        if self._commands.still_moves(state.q - last.q, missed, published):
            return missed
        if moves:
            place = 'the last reference' if self._holds else 'the measured position'
            self._silence = (
                f'no state came in {missed} cycles, allowed {allowed}: the arm goes on from '
                f'{place}, at rest'
            )
            self._commands.end_approach()
            self._controller.hold_at(published.q if self._holds else state.q)
            self.mode = Mode.HOLDING
        return 0

    def _measure(self, state: _State, missed: Cycles) -> None:
        """Update measurements beside positions; they restart while motion is blocked."""
        blocked = not self._active or self._held or self._cycles.rate_error or self.faults.reason
        if blocked or self._commands.approach is not None:
            self.measurements.restart()
        try:
            self.measurements.update(state.q, missed, self.mode is not Mode.MOVING)
        except RedresError as error:
            self.faults.set(str(error))
            self.measurements.restart()

    def _watch(self, state: _State, dx: TaskVelocity, stale: bool, missed: Cycles) -> None:
        """Notice faults, and that one is over."""
        approach = self._commands.approach
        asks = not stale and largest(dx) > _NO_TASK
        asks = asks or (self._yields_alone and self.measurements.asks)
        self.faults.note_request(asks, stale, (missed + 1) * self._controller.T)
        if approach is not None and approach.is_probe:
            if approach.left <= 0.0:
                self.faults.set_not_executing()
        elif self.mode in MOVING_MODES and not self.faults.reason:
            self.faults.watch(state.q, missed + 1)

    def _change_mode(self, state: _State, dx: TaskVelocity, stale: bool) -> bool:
        """Switch to the mode of this state; returns whether more than silence blocks motion.

        A fault does until its motion is given up.
        """
        commandable = self.faults.executes and self._session.commanding_at(state.stamp)
        has_fault = bool(self.faults.reason) and not self.faults.released
        is_ready = commandable and self._active and not (self._held or has_fault)
        blocked = not is_ready or bool(self._cycles.rate_error)
        published = self._controller.published
        fastest = 0.0 if published is None else largest(published.dq)  # [rad/s]
        allowed = not (blocked or stale)
        asked = allowed and (largest(dx) > 0.0 or self.faults.is_probing)
        yields = self._yields_alone or self.measurements.asks
        if yields and not blocked and self._may_yield(stale):
            allowed = True
            asked = asked or self.measurements.asks
        conditions = Conditions(
            # A robot that extrapolates rests only after the same reference twice.
            active=self._active or fastest > 0.0,
            commandable=commandable,
            motion_allowed=allowed,
            motion_asked=asked,
            at_rest=not asked and fastest <= _AT_REST,
        )
        before = self.mode
        self.mode = next_mode(before, conditions)
        if self.mode is not before:
            self._begin_mode(state, before)
        approaches = self._commands.approach is not None
        self._yields_alone = stale and self.mode is Mode.MOVING and not approaches
        return blocked

    def _may_yield(self, stale: bool) -> bool:
        """Whether an arm follows what is measured, and comes to rest after it by itself."""
        if self.faults.reason:
            return False
        interrupted = stale and self.mode is Mode.MOVING  # it brakes first
        return self._yields_alone or not interrupted or self.measurements.contact.retreats

    def _begin_mode(self, state: _State, before: Mode) -> None:
        """What the mode of this state begins with."""
        controller = self._controller
        self.faults.begin()
        self._commands.end_approach()
        if before is Mode.INACTIVE or controller.published is None:
            controller.hold_at(state.q)
        if self.mode is Mode.MOVING:
            self._commands.begin_motion(state.q)
        elif self.mode is Mode.HOLDING:
            controller.hold_at(controller.reference)
        else:
            self.measurements.restart()
        if self.mode is Mode.STOPPING:
            controller.hold()

    def _command(self, state: _State, dx: TaskVelocity, missed: Cycles) -> Command:
        """The command of the mode in force. Raises RedresError if there is none."""
        if self.mode is Mode.MOVING:
            return self._commands.move(state.q, dx, missed)
        if self.mode is Mode.STOPPING:
            return self._commands.brake(state.q, missed)
        if self.mode is Mode.MIRRORING or self._controller.published is None:
            self._controller.hold_at(state.q)
        return self._commands.hold()
