"""What is between two ticks of the controller: modes, clock, session, velocities, and faults."""

import math
from typing import NamedTuple

import numpy as np

from redres_ros.command import Command, Published
from redres_ros.contact import AdmittanceSettings, ContactControl, ContactError
from redres_ros.controller import Controller
from redres_ros.errors import RedresError
from redres_ros.kernels.tick import largest
from redres_ros.loop.cycle_counter import NANOSECONDS, CycleCounter
from redres_ros.loop.holding import ARRIVED, NOTHING, HeldReference, PoseHold, approach_velocity
from redres_ros.loop.measurements import Measurements
from redres_ros.loop.modes import COMMANDING, MOVING_MODES, Conditions, Mode, next_mode
from redres_ros.loop.safety import LAG_TIME, FaultMonitor, ProgressMonitor, SafetyFilter
from redres_ros.loop.velocity_input import AUTO, LoopSettings, VelocityInput
from redres_ros.preview import Preview
from redres_ros.robot_model import Correction
from redres_ros.types import (
    Cycles,
    JointPositions,
    JointVelocities,
    Nanoseconds,
    Seconds,
    TaskVelocity,
    check_finite,
)

_AT_REST = 1e-4  # [rad/s]
_PATIENCE = 1.0  # [s] for an arm that is to come to rest
_ROUNDING = 1e-9  # [m/s], [rad/s] of a planner that holds its target
# A robot that holds executes the second alone of two responses that it gets in one cycle. A state
# that comes so shortly after a response was sent was published before that arrived.
_TOGETHER = 0.001  # [s] that both transports take, of the state and of the response
_TOGETHER_FRACTION = 0.25  # of a cycle, if that is less
_PAUSE = 2.0  # [s] of no motion, after which progress is judged anew
_CLOCK_STEP = 0.1  # [s] at which a robot has another clock than before


class Response(NamedTuple):
    """The published response to a state."""

    stamp: Nanoseconds  # of the state
    command: Command
    scaling: float  # executed fraction of the task velocity; 0 while the arm holds or stops
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
        self._interface = controller.robot_interface
        self._holds = self._interface.holds  # the robot does, without a command
        self._cycles = CycleCounter(round(NANOSECONDS * controller.T))
        self.input = VelocityInput(controller, self._cycles, settings)
        self.measurements = Measurements(controller, contact, self._cycles)
        self.faults = FaultMonitor(controller)
        self.safety_filter = SafetyFilter(controller)
        self._progress = ProgressMonitor()
        self._executed = 0.0  # of the velocity, in seconds at its full speed
        self._watched = 0.0  # when that was [s]
        self._pose_hold = PoseHold(controller)
        self._held_reference = HeldReference(controller)
        self.mode = Mode.HOLDING
        # What moves the arm in place of the input: an approach to where it is, or measurements.
        self._approach: JointPositions | None = None
        self._yields_alone = False
        self._active = True
        self._held = False  # by request
        self._is_connected = True
        self._session = ''  # of the robot; one without takes commands
        # The path to come, from the state of a stamp on; the newest one counts.
        self.preview: tuple[Nanoseconds, Preview] | None = None
        self._newest: _State | None = None  # that was believed
        self._waiting: _State | None = None  # that has no response yet
        self.newest_response: Response | None = None
        self.sent = -math.inf  # when that was on its way, as its sender notes [s]
        self._together = min(_TOGETHER, _TOGETHER_FRACTION * controller.T)  # [s]
        self._before: Published | None = None  # what its command continued from
        self._silence = ''  # after which the arm started again from the last state
        self.responses = 0  # to states
        self.skipped = 0  # cycles whose state did not come
        if not (self._holds or settings.lockstep):
            controller.longest_gap = self._interface.restart_after + 1

    @property
    def q(self) -> JointPositions | None:
        """Measured positions of the newest state; None before the first."""
        return self._newest.q if self._newest else None

    @property
    def error(self) -> str:
        """Why the arm may not move, or cannot stay where it is, and the remedy; or empty."""
        if reason := self.faults.reason:
            return f'{reason}; controller/hold with false, or a new motion, lets it go on'
        if self._cycles.rate_error or self.mode is not Mode.HOLDING or self._newest is None:
            return self._cycles.rate_error
        if self._interface.forwards_commands and self._held_reference.restless > _PATIENCE:
            return 'the measured positions do not come to rest; no motion begins before'
        return self.faults.holding_problem(self._newest.q)

    @property
    def warning(self) -> str:
        """The irregularity at the last state; empty if there was none."""
        if self.safety_filter.reason:
            return f'the safety filter acts: {self.safety_filter.reason}'
        remark = self._progress.remark if self.mode is Mode.MOVING else ''
        return self._silence or self.measurements.problem or remark

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
        self._newest = None
        self._waiting = None
        self._held = False
        self.preview = None
        self._cycles.restart()
        self._begin_anew(None)

    def enter_session(self, state: str) -> None:
        """Record the name of the robot's session state.

        One that begins to take commands executes them, whatever it did before. In lock-step the
        first command begins the session, so the tick in which that is reported must not matter.
        """
        begins = self.input.settings.lockstep and not self._session
        if begins and state not in COMMANDING:
            return
        self._session = state
        if state in COMMANDING and not self.faults.executes:
            self.faults.clear()

    def tare(self) -> None:
        """Take the measured wrench for the sensor's bias. Raises ContactError while the arm moves
        or yields, or for a wrench that cannot be used.
        """
        if self._newest is None or self.mode in MOVING_MODES:
            raise ContactError(f'the arm is {self.mode.value}; expected one at rest: hold it first')
        if self.measurements.contact.is_on and not self._held:
            raise ContactError(
                'the arm yields to the force that a tare would change at once: hold it, or set '
                'admittance.enabled to false first'
            )
        self.measurements.contact.sensor.tare()

    def step(
        self, stamp: Nanoseconds, q: JointPositions, now: Seconds, *, is_connected: bool = True
    ) -> Response | None:
        """The response to a state; None if it waits for its task velocity, or nothing is published.

        Args:
            is_connected: Whether commands may reach the robot; a moving arm is not let go of.

        Raises ClockError for a stamp that is not of a new cycle, ArrayError for q not finite.
        """
        if not np.isfinite(q).all():
            check_finite(q, 'q')
        if self.mode not in MOVING_MODES:
            self._is_connected = is_connected
        cycles = self._cycles
        before = cycles.newest
        if self._controller.has_turns:
            q = self._controller.nearest_turn(q)
        is_known = stamp and stamp == before
        if is_known and self._newest and np.array_equal(q, self._newest.q):
            # A robot that waits for its command asks again, and gets the same one.
            return self.respond_if_due(now) if self._waiting else self.newest_response
        # Else it may be the same one for a controller that was activated while the robot waits.
        if not is_known or self._newest:
            # A robot whose clock has made a step against this computer's is another one.
            step = (stamp - before) / NANOSECONDS - now + cycles.arrived
            is_another = not before or abs(step) >= _CLOCK_STEP
            number = cycles.number
            if cycles.enter(stamp, now) == 0 and cycles.number > number:
                self._begin_anew(None if is_another else q)
                if before and is_another and self._session:
                    self._session = 'unknown'
        robot_waits = self._waiting is None
        self._newest = _State(stamp, cycles.number, q, now)
        self._waiting = self._newest
        return self.respond_if_due(now, robot_waits=robot_waits)

    def _begin_anew(self, q: JointPositions | None) -> None:
        """Reset the published references: the robot is another one, or was restarted. The last one
        stays if an arm that was silent for long, measured at q, is where that holds it.
        """
        controller = self._controller
        published = controller.published
        stays = self.mode is Mode.HOLDING or (self._holds and self.mode in MOVING_MODES)
        is_away = self.faults.is_away
        if self._interface.forwards_commands:
            is_away = self._held_reference.is_left
        self.faults.clear()
        self.faults.begin()
        self.faults.is_lost = False
        self.input.buffer.clear()
        self._approach = None
        if q is None or published is None or not stays or is_away(q):
            controller.restart()
        else:
            controller.hold_at(published.q)
        self.newest_response = None
        if self.mode is not Mode.INACTIVE:
            self.mode = Mode.HOLDING

    def enter_velocity(
        self,
        stamp: Nanoseconds,
        dx: TaskVelocity | JointVelocities,
        now: Seconds,
        time_of_day: Nanoseconds = 0,
        *,
        of_joints: bool = False,
    ) -> Response | None:
        """The response to the state that waited for this velocity, of the task or of all joints, if
        there is one. The newest kind counts.

        Args:
            stamp: Of the state that it belongs to, or another time on the robot's clock; 0 for now.
            time_of_day: Arrival by the computer's clock; 0: not known.

        Raises VelocityError for one that is too fast, too old, or stamped too far ahead.
        """
        self.input.enter(stamp, dx, now, time_of_day, of_joints=of_joints)
        return self.respond_if_due(now)

    def respond_if_due(self, now: Seconds, *, robot_waits: bool = True) -> Response | None:
        """The response to the state that waits for its velocity, once it need not wait any longer:
        it does as long as the last response had its velocity, and the robot waits.
        """
        state = self._waiting
        if state is None:
            return None
        buffer = self.input.buffer
        last = self.newest_response
        if buffer.known_until < state.cycle:
            waits = robot_waits and now - state.arrived < self._interface.patience
            awaits = last and buffer.known_until >= last.cycle and self.input.is_of_state
            if self.input.settings.lockstep or (waits and awaits and not self._held):
                return None
        self._waiting = None
        self.newest_response = self._respond(state, now)
        self.responses += self.newest_response is not None
        return self.newest_response

    def _respond(self, state: _State, now: Seconds) -> Response | None:
        """What was missed, what is asked for, the mode that follows, and its command."""
        last = self.newest_response
        if last and last.cycle == state.cycle:  # of a stray, which took the cycle of this state
            return last._replace(stamp=state.stamp, q=state.q)
        controller = self._controller
        self._silence = ''
        is_together = state.arrived - self.sent < self._together
        if is_together and self._holds and self.mode in MOVING_MODES:
            controller.published = self._before
        missed = state.cycle - last.cycle - 1 if last else 0
        if last and missed:
            missed = self._bridge(state, last, missed)
        stale = self.input.is_stale(state.cycle, now)
        dx = self.input.buffer.play(state.cycle)
        self._watch(state, dx, missed, stale)
        blocked = self._change_mode(state, dx, stale)
        if self.mode is Mode.INACTIVE:
            return None
        rests = self.mode is Mode.HOLDING and self._interface.forwards_commands
        if rests and controller.published and not self._held_reference.update(state.q, missed + 1):
            return None  # others have moved the arm
        if stale and (self.mode is Mode.HOLDING or self._yields_alone):
            self.input.buffer.clear()
            dx = np.zeros(len(dx))
        before = controller.published
        try:
            command = self._command(state.q, dx, missed)
        except RedresError as error:
            self.faults.set(str(error))
            blocked = True
            self.faults.is_lost = False
            self.mode = Mode.STOPPING
            controller.hold(at_once=self.measurements.contact.retreat is not None)  # may press on
            self.measurements.restart()
            controller.published = before
            command = self._command(state.q, dx, missed)
        follows = not (blocked or stale or self._approach is not None)
        scaling = command.s if follows else 0.0
        return Response(state.stamp, command, scaling, state.q, state.cycle)

    def _bridge(self, state: _State, last: Response, missed: Cycles) -> Cycles:
        """The cycles without a command that count; after a long silence the arm is at rest."""
        controller = self._controller
        holds = self._holds
        published = controller.published
        if published is None:
            return 0
        self.skipped += missed
        allowed = self._interface.restart_after
        if missed <= allowed:
            if not holds:  # it moves on in such intervals, and its joints must stop in time
                controller.gap = max(controller.gap, missed + 1)
            return missed
        if not holds:
            # It may have continued by itself; a servo's lag is in both positions.
            expected = controller.bridged(published, missed).q - published.q
            if largest(state.q - last.q - expected) <= 0.5 * largest(expected):
                return missed
        if self.mode in MOVING_MODES:
            place = 'the last reference' if holds else 'the measured position'
            self._silence = (
                f'no state came in {missed} cycles, allowed {allowed}: the arm goes on from '
                f'{place}, at rest'
            )
            self._approach = None
            self.faults.is_lost = False
            controller.hold_at(published.q if holds else state.q)
            self._held_reference.begin(state.q, LAG_TIME * self.faults.fast if holds else None)
            self.mode = Mode.HOLDING
        return 0

    def _watch(self, state: _State, dx: TaskVelocity, missed: Cycles, stale: bool) -> None:
        """Update measurements beside positions, and notice faults, or that one is over."""
        measurements = self.measurements
        faults = self.faults
        blocked = not self._active or self._held or self._cycles.rate_error or faults.reason
        if blocked or self._approach is not None:
            measurements.restart()
        if not measurements.is_idle or measurements.contact.settings.enabled:
            try:
                measurements.update(state.q, missed, self.mode is not Mode.MOVING)
            except RedresError as error:
                faults.set(str(error))
                measurements.restart()
        asks = not stale and largest(dx) > NOTHING
        asks = asks or (self.mode is Mode.MOVING and measurements.asks)
        # A reference that approaches the arm needs no motion of it.
        moves = self.mode in MOVING_MODES and self._approach is None and not faults.is_lost
        was_lost = faults.is_lost
        faults.update(state.q, missed + 1, asks=asks, stale=stale, moves=moves)
        if faults.is_lost and not was_lost:  # its reference is to come to where it is
            self._controller.resume()
            self._controller.follow_joints(True, at_once=True)

    def _change_mode(self, state: _State, dx: TaskVelocity, stale: bool) -> bool:
        """Switch to the mode of this state; returns whether more than silence blocks motion.

        A fault does until its motion is given up.
        """
        faults = self.faults
        measurements = self.measurements
        takes_commands = self._session in ('', *COMMANDING)
        commandable = takes_commands and self._is_connected and faults.executes
        is_stopped = self._held or not self._active or not commandable
        has_fault = faults.reason and not faults.released
        blocked = bool(is_stopped or has_fault or faults.is_lost or self._cycles.rate_error)
        if self._interface.forwards_commands and self.mode not in MOVING_MODES:
            blocked = blocked or self.mode is not Mode.HOLDING or self._held_reference.wait > 0.0
        published = self._controller.published
        fastest = 0.0 if published is None else largest(published.dq)  # [rad/s]
        allowed = not (blocked or stale)
        # A planner closes a loop, to which the least velocity matters.
        asked = allowed and largest(dx) > (NOTHING if self.input.is_steered else _ROUNDING)
        if (self._yields_alone or measurements.asks) and not blocked and not faults.reason:
            # An arm that only follows what is measured comes to rest after it by itself; one whose
            # velocity ends brakes first.
            interrupted = stale and self.mode is Mode.MOVING and not self._yields_alone
            if not interrupted or measurements.contact.retreat is not None:
                allowed = True
                asked = asked or measurements.asks
        is_at_rest = fastest <= _AT_REST
        if faults.is_lost:
            is_at_rest = self._held_reference.has_caught_up(state.q) and is_at_rest
        conditions = Conditions(
            # A robot that extrapolates rests only after the same reference twice.
            active=self._active or fastest > 0.0,
            commandable=commandable,
            motion_allowed=allowed,
            motion_asked=asked,
            at_rest=is_at_rest and not asked,
        )
        before = self.mode
        self.mode = next_mode(before, conditions)
        if self.mode is not before:
            self._begin_mode(state, before)
        self._yields_alone = stale and self.mode is Mode.MOVING and self._approach is None
        return blocked

    def _begin_mode(self, state: _State, before: Mode) -> None:
        controller = self._controller
        self.faults.begin()
        if self.mode is Mode.MOVING and state.arrived - self._watched > _PAUSE:
            self._progress.begin()
        if self.mode is not Mode.STOPPING:
            self._approach = None
        if before is Mode.INACTIVE or controller.published is None:
            controller.hold_at(state.q)
        if before in MOVING_MODES:
            self._pose_hold.rest()
        if self.mode is Mode.MOVING:
            self._pose_hold.resume()
            if self.faults.is_away(state.q):
                self._approach = state.q
            controller.resume()
        elif self.mode is Mode.HOLDING:
            controller.gap = 1
            controller.hold_at(controller.reference)
            controller.follow_joints(self.input.is_of_joints)
            follows = before in MOVING_MODES and not (self.faults.reason or self.faults.is_lost)
            lag = LAG_TIME * self.faults.fast if follows else None
            self._held_reference.begin(state.q, lag)
        else:
            if not self.faults.is_lost:
                controller.hold()
            self.measurements.restart()
        if self.mode is not Mode.STOPPING:
            self.faults.is_lost = False

    def _watch_progress(self, asked: TaskVelocity, command: Command) -> None:
        """Notice that hardly anything is executed of what is asked for."""
        executed = command.J.dot(command.dq)
        scale = command.solution.scale
        if scale is not None:  # makes a turn comparable to a translation
            asked = scale * asked
            executed = scale * executed
        square = asked.dot(asked)
        if square > _ROUNDING**2:
            self._watched = self._cycles.arrived
            T = self._controller.T
            self._executed += T * max(asked.dot(executed) / square, 0.0)
            self._progress.active_limits = command.active_limit or str
            self._progress.enter(T, 0, -self._executed, 0.0, 'hardly anything executed')

    def _command(self, q: JointPositions, dx: TaskVelocity, missed: Cycles) -> Command:
        """The mode's command for the input velocity dx. Raises RedresError if there is none."""
        if self.mode not in MOVING_MODES:
            return self._rest(q)
        if self.mode is Mode.STOPPING:
            along = np.zeros(self._controller.m)
            if self.faults.is_lost:
                along = self._held_reference.catch_up(q)
            return self._move(q, along, missed)
        of_joints = self._approach is not None or self.input.is_of_joints
        if of_joints:
            self._pose_hold.clear()
        if of_joints is not self._controller.follows_joints:
            self._controller.follow_joints(of_joints)
        if self._approach is not None:
            return self._approach_arm(self._approach, q, missed)
        scaling = self.input.settings.scaling
        if scaling == AUTO:
            scaling = 'components' if self.input.is_steered else 'task'
        if scaling != self._controller.policy.scaling:
            self._controller.set_scaling(scaling)
        if self.measurements.yields and not self.input.is_of_joints:
            return self._yield(q, dx, missed)
        return self._follow(q, dx, missed)

    def _rest(self, q: JointPositions) -> Command:
        """The last reference again; while mirroring, where the arm is."""
        controller = self._controller
        if self.mode is Mode.MIRRORING or controller.published is None:
            controller.hold_at(q)
            self._held_reference.begin(q)
        self.safety_filter.reason = ''
        return controller.hold_command()

    def _approach_arm(self, end: JointPositions, q: JointPositions, missed: Cycles) -> Command:
        """Towards where the arm is, before it follows anything."""
        command = self._move(q, approach_velocity(self._controller, end), missed)
        if largest(end - self._controller.reference) <= ARRIVED:
            self._approach = None
        return command

    def _yield(self, q: JointPositions, dx: TaskVelocity, missed: Cycles) -> Command:
        """Along dx and what the contact adds; nothing is held against it."""
        measurements = self.measurements
        dx, _ = self._pose_hold.hold(dx, is_open_loop=False)
        along = measurements.contact.velocity(dx, measurements.state(q), missed)
        command = self._move(q, along, missed)
        measurements.contact.record(command, dx)
        return command

    def _follow(self, q: JointPositions, dx: TaskVelocity, missed: Cycles) -> Command:
        """Along dx; of a planner that does not wait, on the path that it has announced."""
        ahead = None
        leads = self.input.is_of_state and not self.input.is_of_joints  # a planner
        if self.preview and self._controller.horizon and leads and largest(dx) > _ROUNDING:
            begin, path = self.preview
            ahead = path.after((self._cycles.newest - begin) / NANOSECONDS)
        along, correction = self._pose_hold.hold(dx, is_open_loop=self.input.is_steered)
        command = self._move(q, along, missed, correction, ahead)
        self._watch_progress(dx, command)
        return command

    def _move(
        self,
        q: JointPositions,
        along: TaskVelocity,
        missed: Cycles,
        correction: Correction | None = None,
        ahead: Preview | None = None,
    ) -> Command:
        """The controller's command, through the safety filter."""
        plan = self._controller.plan(q, along, missed, correction, ahead)
        self._before = plan.base
        return self._controller.commit(self.safety_filter.admit(plan))
