"""What keeps an arm safe: faults that stop it, and when it may resume; motion without progress; and
the safety filter, the last check of a reference before it is published.

Limits on dq do not bound what the robot gets: missed cycles, restarts, measurements and wrapped
angles all act on the reference. With p where the robot is by now and v its velocity
(RobotInterface.bridged), a reference q_ref passes the filter if

    q_min <= q_ref <= q_max,   |q_ref - p| <= V T,   |(q_ref - p)/T - v| <= A T

(outside the range: only towards it). Otherwise the arm brakes within A.
"""

from collections import deque
from collections.abc import Callable
from dataclasses import replace

import numpy as np

from redres_ros.command import Published
from redres_ros.controller import Controller, Plan
from redres_ros.kernels.boxes import admit
from redres_ros.kernels.tick import add_excess, largest, widen
from redres_ros.types import Cycles, JointPositions, Seconds

LAG_TIME = 0.1  # [s] by which a servo may be behind a moving reference
_DELAY = 0.03  # [s] of dead time that is allowed for
_SHORTEST = 0.02  # [s] between two looks at whether the arm has moved
_LONGEST = 1.0  # [s]
_COMMANDED = 1e-3  # [rad] that a joint must be commanded to move before it is judged
_MOVED = 0.1  # of that, which shows that it moves
_NOISE = 1e-4  # [rad] of a measurement
_CARRIED = 0.01  # [rad] beyond its references, at which others, or a wall, have moved an arm
_LATE = 0.01  # [s] by which it may be late or early in its motion
_AWAY = 3.0  # states in short succession that are away from the reference; encoders may fail once
_AWAY_DECAY = 0.1  # of these for each good one
_PAUSE = 0.5  # [s] without a request for motion, after which a new one clears a fault
_SETTLING_TIME = 5.0  # [s] in which null-space motion has to come to rest, if no task moves
_SETTLED = 0.02  # [rad/s] of a joint that counts as at rest then
_STEP = 0.05  # [s] of the path's time that count as progress
_FRACTION = 0.9  # of the error at the end of a segment's time, below which it has become smaller


class FaultMonitor:
    """Notices faults: an arm that does not follow its references, impossible measurements,
    null-space motion without end. The first fault stays until a new motion is commanded, or it is
    cleared.

    Attributes:
        reason: Of the fault; empty without one.
        executes: False for an arm that does not move at all.
        released: The motion that was stopped is no longer commanded.
    """

    def __init__(self, controller: Controller) -> None:
        self.reason = ''
        self._controller = controller
        self._model = controller.model
        self._allowed = controller.robot_interface.following_tolerance  # [rad]
        self._most = _CARRIED if controller.robot_interface.forwards_commands else self._allowed
        self._peaks = np.zeros((2, self._model.n))  # recent ones of dq and -dq, (2, n) [rad/s]
        self._excess = np.zeros((2, self._model.n))  # motion beyond these, (2, n) [rad]
        self._q = np.zeros(self._model.n)  # measured last, (n,) [rad]
        self.fast = np.zeros(self._model.n)  # recent speed of the reference, (n,) [rad/s]
        self._pause = 0.0  # [s] for which no motion was asked for
        self._references: deque[JointPositions] = deque(maxlen=max(round(_DELAY / controller.T), 1))
        self.is_lost = False  # others have moved the arm, and its reference is of no use
        self.clear()
        self.begin()

    def begin(self) -> None:
        """The arm is at rest, at its reference."""
        self._references.clear()
        # The ranges of positions: commanded, the same as late as an arm may be, and measured.
        self._lower = np.full((3, self._model.n), np.inf)
        self._upper = -self._lower
        self._elapsed = 0.0  # [s] of these
        self._settling = 0.0  # [s] for which the arm has moved without a task
        self._away = 0.0  # states that were away from the reference, of late

    def set(self, reason: str) -> None:
        """There is a fault; of several the first one counts."""
        if not self.reason:
            self.reason = reason
            self.released = False
            self._pause = 0.0

    def clear(self) -> None:
        self.reason = ''
        self.executes = True
        self.released = False

    def update(
        self, q: JointPositions, cycles: Cycles, *, asks: bool, stale: bool, moves: bool
    ) -> None:
        """Record a state, `cycles` after the last one.

        Args:
            asks: A velocity asks for motion; a new motion clears a fault.
            stale: Velocities are too old.
            moves: The arm follows its reference, and is to be watched.
        """
        seconds = cycles * self._controller.T
        self.released = self.released or (stale and self._pause >= _PAUSE)
        if asks and not self.is_lost and self.reason and (self.released or self._pause >= _PAUSE):
            self.clear()
        self._pause = 0.0 if asks else self._pause + seconds
        self._settling = 0.0 if asks else self._settling + seconds
        published = self._controller.published or Published.at_rest(q)
        if cycles > 1:
            published = self._controller.bridged(published, cycles - 1)
        excess = self._excess.copy()
        add_excess(published.dq, q - self._q, seconds, LAG_TIME, self._peaks, excess)
        self.fast = np.abs(self._peaks).max(axis=0)
        far = excess.max(axis=0) - _LATE * self.fast
        joint = int(np.argmax(far))
        is_judged = moves and not self.reason
        is_away = is_judged and far[joint] > self._most
        if not is_away:  # else the state may be wrong
            self._q = q
            self._excess = excess * is_judged
        if not is_judged:
            return
        self._away = self._away + 1.0 if is_away else max(self._away - _AWAY_DECAY, 0.0)
        if self._away >= _AWAY:
            self.is_lost = self._most < self._allowed
            self.set(
                f'the arm does not follow: {self._model.joint_names[joint]} is {far[joint]:.3g} '
                f'rad further than it can be from its reference, allowed {self._most:g}; does '
                'another robot publish joint_states, too, or another controller move it?'
            )
        delayed = self._references[0] if self._references else published.q
        self._references.append(published.q)
        self._elapsed += seconds
        widen(self._lower, self._upper, published.q, delayed, q)
        if self._elapsed >= _SHORTEST and not self._has_moved(published.q, delayed, q):
            self.set('the arm does not move: the robot executes no commands')
            self.executes = False
        if self._settling > _SETTLING_TIME and largest(published.dq) > _SETTLED:
            self.set(f'the null-space motion has not come to rest within {_SETTLING_TIME:g} s')

    def _has_moved(self, *positions: JointPositions) -> bool:
        """Whether any joint has moved, if any was commanded to; then the ranges begin anew."""
        in_time, later, moved = self._upper - self._lower
        commanded = np.minimum(in_time, later)
        is_little = largest(commanded) < _COMMANDED
        if is_little and self._elapsed < _LONGEST:
            return True
        self._lower = np.array(positions)
        self._upper = self._lower.copy()
        self._elapsed = 0.0
        return is_little or bool((moved > _MOVED * commanded + _NOISE).any())

    def is_away(self, q: JointPositions) -> bool:
        """Whether an arm at rest, measured at q, is not where its reference is."""
        published = self._controller.published
        return published is not None and largest(q - published.q) > self._allowed

    def holding_problem(self, q: JointPositions) -> str:
        """Why an arm at rest, measured at q, cannot stay at its reference; or ''."""
        controller = self._controller
        if controller.published is None:
            return ''
        if self.is_away(q):
            apart = np.abs(q - controller.published.q)
            joint = int(np.argmax(apart))
            return (
                f'held, and {controller.model.joint_names[joint]} is measured {apart[joint]:.2f} '
                'rad from its reference: the next motion begins with an approach to where it is'
            )
        command = controller.hold_command()
        limits = controller.policy.limits
        bounds = limits and limits.at(command.state, command.T)
        if not bounds or bounds.allow(command.dq):
            return ''
        _, active = bounds.nearest(command.dq, None, [])
        return (
            f'held where a limit does not allow it ({active() if active else ""}): a task '
            'velocity moves it back within its limits, or change that limit'
        )


class ProgressMonitor:
    """Counts the time without progress, `idle`.

    While a segment's time is not over, progress is time that the path goes on. Afterwards it is an
    error that becomes smaller. The remark says why there is none; it is empty until stuck_after.
    """

    stuck_after = 5.0  # [s]
    give_up_after = 30.0  # [s]

    def __init__(self) -> None:
        self._t = 0.0  # of the path, where it last began anew
        self._tip = np.zeros(1)
        self.begin()

    def begin(self) -> None:
        self.remark = ''
        self.idle: Seconds = 0.0
        self._segment = -1
        self._left = 0.0
        self._error = 0.0
        self.active_limits: Callable[[], str] = str  # that acted last, in words

    def redirect(self, t: Seconds, left: Seconds, tip: np.ndarray, *, is_reached: bool) -> None:
        """Follow another path at its time t; anew if it is over, or time and tip [m] went on."""
        has_moved = np.linalg.norm(tip - self._tip) > (1.0 - _FRACTION) * self._error
        if is_reached or (abs(t - self._t) > _STEP and has_moved):
            self._t = t
            self._tip = tip
            self.begin()
        self._left = left

    def enter(
        self, seconds: Seconds, segment: int, left: Seconds, error: float, distance: str = ''
    ) -> bool:
        """Enter the seconds since the last call and where the motion is: what is left of the
        segment's time, and how far its end is, in any unit and in words. Whether it is given up.
        """
        goes_on = left < self._left - _STEP or (left <= 0.0 < self._left)
        comes_nearer = left <= 0.0 and error < _FRACTION * self._error
        if segment != self._segment or goes_on or comes_nearer:
            self.begin()
            self._segment = segment
            self._left = left
            self._error = error
        else:
            self.idle += seconds
        is_hopeless = self.idle >= self.give_up_after
        limit = self.give_up_after if is_hopeless else self.stuck_after
        remark = f'no progress for {limit:g} s: '
        if self.idle >= limit and not self.remark.startswith(remark):
            where = f'{left:.3g} s of its time are left' if left > 0.0 else distance
            self.remark = remark + '; '.join(filter(None, (self.active_limits(), where)))
        return is_hopeless


class SafetyFilter:
    """Checks plans against what the controller has published before.

    Attributes:
        count: References that it changed.
        reason: Why it changed the last one; empty if it did not.
    """

    def __init__(self, controller: Controller) -> None:
        self.count = 0
        self.reason = ''
        self._controller = controller

    def admit(self, plan: Plan) -> Plan:
        """The plan whose reference may be published."""
        model = self._controller.model
        T = self._controller.T
        base = plan.base
        limits = self._controller.policy.limits
        A = np.full(model.n, np.inf)
        V = A
        if limits is not None:
            V = model.dq_max
            A = np.array(model.arm.acceleration_limit or A)
            if limits.acceleration is not None:
                A = limits.acceleration
        q_ref = np.empty(model.n)
        dq = np.empty(model.n)
        joint = admit(plan.q_ref, base.q, base.dq, T, V, A, model.q_min, model.q_max, q_ref, dq)
        self.reason = ''
        if joint < 0:
            return plan
        self.count += 1
        speed = (plan.q_ref - base.q)[joint] / T
        acceleration = (speed - base.dq[joint]) / T
        self.reason = (
            f'{model.joint_names[joint]}: the reference {plan.q_ref[joint]:.4g} rad, '
            f'{speed:.4g} rad/s, {acceleration:.4g} rad/s^2 is beyond {model.q_min[joint]:.4g} to '
            f'{model.q_max[joint]:.4g} rad, {V[joint]:.4g} rad/s, {A[joint]:.4g} rad/s^2, or too '
            'fast to stop within that range'
        )
        solution = replace(plan.solution, dq=dq.copy())
        reference = Published(q_ref.copy(), dq, (dq - base.dq) / T, dq)
        return replace(plan, solution=solution, q_ref=q_ref, reference=reference)
