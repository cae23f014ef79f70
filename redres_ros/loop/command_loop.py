"""Everything that stands between two ticks of the controller: the robot's clock and session, task
velocities and their age, an arm that does not follow.
"""

import math
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from redres_ros.command import Command
from redres_ros.controller import Controller
from redres_ros.errors import RedresError
from redres_ros.loop.cycle_counter import NANOSECONDS, ClockError, CycleCounter
from redres_ros.loop.session import RobotSession
from redres_ros.loop.settings import LoopSettings
from redres_ros.loop.twist_buffer import TwistBuffer, TwistBufferSettings

_LITTLE = 0.05  # share of a task velocity with which a task hardly goes on
_LONG = 1.0  # [s] after which that is told
# An answer that was sent so shortly before the robot published the next state came after that.
_TOGETHER = 0.001  # [s] that both ways take, of the state and of the answer
_TOGETHER_SHARE = 0.25  # of a cycle, where that is less


class LeapError(RedresError):
    """A state in which a joint is where it cannot have got to since the last one."""


class TwistSpeedError(RedresError):
    """A task velocity that is faster than allowed."""


class TwistAgeError(RedresError):
    """A task velocity whose stamp is too far from the robot's clock."""


class Response(NamedTuple):
    """What the controller answers to a state.

    stamp: of the state [ns]; scaling: share of the task velocity that is carried out, 0 while the
    arm stands still by hold, for want of a task velocity, or because the robot takes no commands;
    restarted: from where the controller began anew, and why; empty if it went on.
    """

    stamp: int
    command: Command
    scaling: float
    restarted: str


class _State(NamedTuple):
    """A state that is not answered yet.

    stamp: [ns]; lag: how far a joint is from its reference [rad]; arrived: when it came [s].
    """

    stamp: int
    cycle: int
    q: np.ndarray
    lag: float
    arrived: float


class CommandLoop:
    """Turns the states and task velocities that come into answers, each with one controller update.

    All times are given by the caller: stamps [ns], and arrivals by a monotonic clock [s].

    Args:
        controller: It is updated here and nowhere else.
        settings: Can be replaced at any time.
        twist_buffer: How task velocities are played out; in lock-step without lag.
    """

    def __init__(
        self,
        controller: Controller,
        settings: LoopSettings | None = None,
        twist_buffer: TwistBufferSettings | None = None,
    ) -> None:
        self.settings = settings or LoopSettings()
        self.held = False  # to stand still, whatever is asked for
        self.answered = 0  # states
        self.skipped = 0  # cycles whose state did not come
        twist_buffer = twist_buffer or TwistBufferSettings()
        if self.settings.lockstep:
            twist_buffer = replace(twist_buffer, twist_lag=0)
        self.twist_buffer = TwistBuffer(controller.m, controller.T, twist_buffer)
        self._controller = controller
        self._cycles = CycleCounter(round(NANOSECONDS * controller.T))
        self._slowdown = _Slowdown()
        self._session = RobotSession(self.settings.lockstep)
        self._twist_arrival = _TwistArrival()
        self._expecting = self.settings.lockstep  # that task velocities go on to come
        self._waiting: _State | None = None
        self.q: np.ndarray | None = None  # of the newest state, (n,) [rad]
        self._answer: Response | None = None  # to the newest state that was answered
        self._answered_cycle = 0
        self._heard_cycle = 0  # of the newest state that was believed
        self._state_arrived = 0.0  # when that came [s]
        self._sent = -math.inf  # when the newest answer was on its way [s]
        self._together = min(_TOGETHER, _TOGETHER_SHARE * controller.T)  # [s]
        self._doubtful: np.ndarray | None = None  # q of a state that was not believed, (n,) [rad]

    @property
    def commanding(self) -> bool:
        """Whether the robot takes commands, as far as is known."""
        return self._session.commanding_at(self._cycles.newest)

    def forget(self) -> None:
        """Know nothing of what came before; held and settings stay."""
        self._waiting = None
        self._answer = None
        self.q = None
        self._answered_cycle = 0
        self._cycles = CycleCounter(round(NANOSECONDS * self._controller.T))
        self.twist_buffer.clear()
        self._controller.reset()

    @property
    def limit_warning(self) -> str:
        """What has held the task up for a second or more; empty if nothing has."""
        return self._slowdown.told(self._controller.T)

    def enter_session(self, word: str) -> None:
        """Take in the robot's word on its session; a robot that says nothing takes commands."""
        self._session.enter(word)

    def enter_state(self, stamp: int, q: np.ndarray, now: float) -> Response | None:
        """The answer to a state; None if it waits for its task velocity.

        Args:
            stamp: Of the state [ns].
            q: Measured joint positions, (n,) [rad].
            now: Its arrival [s].

        Raises:
            ClockError: The stamp is not that of a new cycle.
            LeapError: A joint has moved further than it can; the next such state is believed.
            RedresError: What Controller.update() raises.
        """
        if stamp and stamp == self._cycles.newest:
            return self._same_again(q, now)
        another_robot = self._cycles.newest > 0
        cycles = self._cycles.enter(stamp, now)
        lag = self._controller.lag(q)
        if cycles == 0:
            self._begin(stamp, another_robot)
        else:
            self._check_leap(q, lag)
        if self._waiting:
            self._expecting = False  # the robot did not wait, so nobody else need
        self.q = q
        self._heard_cycle = self._cycles.number
        self._state_arrived = now
        self._waiting = _State(stamp, self._cycles.number, q, lag, now)
        return self.answer_if_due(now)

    def note_sent(self, now: float) -> None:
        """The newest answer is on its way at this time [s]."""
        self._sent = now

    def enter_twist(self, stamp: int, dx: np.ndarray, now: float) -> Response | None:
        """The answer to the state that waited for this task velocity, if there is one.

        Args:
            stamp: Of the state that it belongs to, or another time on the robot's clock; 0 for now.
            dx: Task velocity, (m,) [m/s] and [rad/s].
            now: Its arrival [s].

        Raises:
            TwistSpeedError: It is too fast.
            TwistAgeError: It is too old, or stamped too far ahead.
            RedresError: What Controller.update() raises.
        """
        self._check_speed(dx)
        if not self._cycles.newest:
            return None  # no state has come that it could belong to
        cycle = self._cycles.cycle(stamp) if stamp else self._cycles.number
        if not self._is_of_this_clock(cycle, now):
            return None
        of_a_state = stamp > 0 and self._cycles.is_of_a_state(stamp)
        self._twist_arrival = _TwistArrival(self._cycles.number, math.inf if of_a_state else now)
        self._expecting = self._expecting or of_a_state
        self.twist_buffer.put(cycle, dx)
        return self.answer_if_due(now)

    def answer_if_due(self, now: float) -> Response | None:
        """The answer to the state that waits, once it need not wait any longer."""
        state = self._waiting
        if state is None or self._must_wait(state, now):
            return None
        self._waiting = None
        self._expecting = self._expecting and self.twist_buffer.has(state.cycle)
        self._answer = None
        self._answer = self._update(state, now)
        self._answered_cycle = state.cycle
        self.answered += 1
        return self._answer

    def _begin(self, stamp: int, another_robot: bool) -> None:
        """Know nothing of what was before this stamp [ns]."""
        if another_robot:
            self._session.begin(stamp)
        self.twist_buffer.clear()
        self._answered_cycle = 0
        self._doubtful = None

    def _check_leap(self, q: np.ndarray, lag: float) -> None:
        """Doubt a single state that would make the controller begin anew somewhere else, such as
        that of an encoder which fails for a moment.

        Args:
            q: (n,) [rad]. An arm that is really there says so again.
            lag: How far a joint is from its reference [rad].
        """
        doubtful = self._doubtful
        self._doubtful = None
        tolerance = self.settings.following_tolerance
        if self.q is None or lag <= tolerance:
            return
        q = self._controller.nearest_turn(q)
        leap = self._leap(q, self._controller.nearest_turn(self.q))
        if leap > tolerance and (doubtful is None or self._leap(q, doubtful) > tolerance):
            self._doubtful = q
            raise LeapError(
                f'a joint has moved {leap:.3g} rad further than it can; expected at most '
                f'{tolerance:g} (parameter following_tolerance), or a second state like it'
            )

    def _leap(self, q: np.ndarray, before: np.ndarray) -> float:
        """By how much the joint that leapt furthest is further away than its speed allows [rad]."""
        seconds = self._controller.T * (self._cycles.number - self._heard_cycle)
        reach = seconds * self._controller.model.dq_max  # (n,)
        return float((np.abs(q - before) - reach).max())

    def _same_again(self, q: np.ndarray, now: float) -> Response | None:
        """A robot that waits for its answer asks again, and gets the same one."""
        if not (self.q is not None and np.array_equal(q, self.q)):
            raise ClockError(
                'stamped as the last one, but with other positions; expected a later stamp'
            )
        return self.answer_if_due(now) if self._waiting else self._answer

    def _must_wait(self, state: _State, now: float) -> bool:
        if self.twist_buffer.has(state.cycle):
            return False
        if self.settings.lockstep:
            return True
        patience = self.settings.twist_patience
        return self._expecting and not self.held and now - state.arrived < patience

    def _update(self, state: _State, now: float) -> Response:
        controller = self._controller
        missed = max(state.cycle - self._answered_cycle - 1, 0) if self._answered_cycle else 0
        commanding = self._session.commanding_at(state.stamp)
        restarted = self._begin_anew(state, missed)
        if not commanding or not self._answered_cycle:
            controller.reset()
        if restarted or not commanding or not self._answered_cycle:
            missed = 0
        self.skipped += missed
        if self.settings.bridging == 'hold':
            missed = 0  # the arm has not gone on
            self._take_back_if_late(state)
        stale = self._is_stale(state, now)
        dx = self.twist_buffer.play(state.cycle)
        if self.held or stale:
            controller.hold()
        else:
            controller.resume()
        command = controller.update(state.q, dx, missed=missed)
        if stale and not command.dq.any():
            self.twist_buffer.clear()  # the arm has come to rest
        follows = commanding and not self.held and not stale
        self._slowdown.enter(command, follows)
        scaling = command.s if follows else 0.0
        return Response(state.stamp, command, scaling, restarted)

    def _begin_anew(self, state: _State, missed: int) -> str:
        """Begin anew where the arm is not where the last command would have it.

        Args:
            state: To be answered.
            missed: Cycles before it that had no state.

        Returns:
            From where it begins, and why; empty where it goes on.
        """
        controller = self._controller
        settings = self.settings
        if state.lag > settings.following_tolerance:
            controller.reset()
            return (
                f'from the measurement: the arm does not follow: a joint is {state.lag:.3g} rad '
                f'from its reference, allowed {settings.following_tolerance:g}'
            )
        if missed <= settings.restart_after:
            return ''
        silence = f'no state came in {missed} cycles, allowed {settings.restart_after}'
        if settings.bridging == 'hold':
            controller.reset_at_reference()
            return f'from the last reference, where the arm is held: {silence}'
        controller.reset()
        return f'from the measurement: {silence}'

    def _take_back_if_late(self, state: _State) -> None:
        """Of two answers that come in one cycle, a robot that holds carries out the second alone:
        the first must not count, or that would be a step of two cycles.

        Args:
            state: To be answered. The last answer has come too late where this one was on its way
                already.
        """
        published = min(state.arrived, self._cycles.earliest_arrival)
        if published - self._sent < self._together:
            self._controller.rollback()

    def _is_stale(self, state: _State, now: float) -> bool:
        """By its stamp, and by its arrival on the robot's clock; on ours if it is of no state."""
        timeout = self.settings.command_timeout
        newest = max(self.twist_buffer.age(state.cycle), state.cycle - self._twist_arrival.cycle)
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

    def told(self, T: float) -> str:
        if self._ticks * T < _LONG:
            return ''
        return f'the limits leave {self._share:.1%} of the task velocity ({self._active_limits})'
