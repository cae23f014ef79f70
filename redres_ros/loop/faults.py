"""Faults that stop the arm, and when it may resume: an arm that does not follow its references,
impossible measurements, null-space motion without end.
"""

from collections import deque

import numpy as np

from redres_ros.controller import Controller
from redres_ros.errors import RedresError
from redres_ros.kernels.tick import largest, largest_excess, update_peak, widen
from redres_ros.types import Cycles, JointPositions, Radians, Seconds

_LAG_TIME = 0.1  # [s] by which a servo may be behind a moving reference
_DECAY_TIME = 0.2  # [s] for which a reference counts as moving after it has stopped
_DELAY = 0.03  # [s] of dead time that is allowed for
_SHORTEST = 0.02  # [s] between two looks at whether the arm has moved
_LONGEST = 1.0  # [s]
_COMMANDED = 1e-3  # [rad] that a joint must be commanded to move before it is judged
_MOVED = 0.1  # of that, which shows that it moves
_NOISE = 1e-4  # [rad] of a measurement
_LEAPS = 3.0  # states in short succession that cannot be of this arm
_LEAP_DECAY = 0.1  # of these for each good one
_PROBE_TIME = 0.5  # [s] between probes of whether an arm that does not move is moved again
_PAUSE = 0.5  # [s] without a request for motion, after which a new one clears a fault
_SETTLING_TIME = 5.0  # [s] in which null-space motion has to come to rest, if no task moves
_SETTLED = 0.02  # [rad/s] of a joint that counts as at rest then


class LeapError(RedresError):
    """A state with a joint position that is impossible after the last one."""


class FaultMonitor:
    """Notices faults. The first one stays until a new motion is commanded, or it is cleared.

    Attributes:
        reason: Of the fault; empty without one.
        executes: False for an arm that does not move at all.
        released: The motion that was stopped is no longer commanded.
        is_probing: Motion begins with a probe of whether the arm moves.
    """

    def __init__(self, controller: Controller) -> None:
        self.reason = ''
        self._controller = controller
        self._model = controller.model
        self._allowed = controller.robot_interface.following_tolerance  # [rad]
        self._until_probe = 0.0  # [s]
        self._pause = 0.0  # [s] for which no motion was asked for
        self._references: deque[JointPositions] = deque(maxlen=max(round(_DELAY / controller.T), 1))
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
        self._fast = np.zeros(self._model.n)  # recent speed of the reference, (n,) [rad/s]

    def set(self, reason: str) -> None:
        """There is a fault; of several the first one counts."""
        if not self.reason:
            self.reason = reason
            self.released = False
            self._pause = 0.0

    def set_not_executing(self) -> None:
        """The arm does not move at all. Whether it does again is probed now and then."""
        self.set('the arm does not move: the robot executes no commands')
        self.executes = False
        self.is_probing = False
        self._until_probe = _PROBE_TIME

    def clear(self) -> None:
        """There is none any more."""
        self.reason = ''
        self.executes = True
        self.released = False
        self.is_probing = False
        self._leaps = 0.0

    def note_request(self, asks: bool, stale: bool, seconds: Seconds) -> None:
        """Record whether velocities ask for motion, or are stale; a new motion clears a fault."""
        self.released = self.released or (stale and self._pause >= _PAUSE)
        if asks and self.reason and (self.released or self._pause >= _PAUSE):
            self.clear()
        if not stale and not self.executes:
            self._until_probe -= seconds
            if self._until_probe <= 0.0:
                self.clear()
                self.is_probing = True
        self._pause = 0.0 if asks else self._pause + seconds
        self._settling = 0.0 if asks else self._settling + seconds

    def check_leap(self, q: JointPositions, before: JointPositions, seconds: Seconds) -> None:
        """Refuse a state in which a joint has moved further than it can since the last one.

        An encoder that fails for a moment is passed over. Several such states are a fault: they may
        come from two robots with the same joint names.

        Raises:
            LeapError: It is refused.
        """
        leap, _ = largest_excess(q, before, self._model.dq_max, seconds)
        if leap <= self._allowed:
            self._leaps = max(self._leaps - _LEAP_DECAY, 0.0)
            return
        self._leaps += 1.0
        what = f'a joint has moved {leap:.3g} rad further than it can; allowed: {self._allowed:g}'
        if self._leaps < _LEAPS:
            raise LeapError(what)
        self.set(f'{what}; does another robot publish joint_states, too?')

    def _lag(self, q: JointPositions) -> tuple[Radians, int]:
        """How far the joint furthest behind is from its reference, and which one it is.

        What a servo may be behind a moving reference does not count.
        """
        published = self._controller.published
        q_ref = q if published is None else published.q
        return largest_excess(q_ref, q, self._fast, _LAG_TIME)

    def is_away(self, q: JointPositions) -> bool:
        """Whether an arm measured at q is not where its reference is."""
        return self._lag(q)[0] > self._allowed

    def holding_problem(self, q: JointPositions) -> str:
        """Why an arm at rest, measured at q, cannot stay at its reference; or ''."""
        controller = self._controller
        if controller.published is None:
            return ''
        lag, joint = self._lag(q)
        if lag > self._allowed:
            return (
                f'held, and {self._model.joint_names[joint]} is measured {lag:.3g} rad from its '
                'reference: the next motion begins with an approach to where the arm is'
            )
        command = controller.hold_command()
        limits = controller.policy.limits
        bounds = limits and limits.at(command.state, command.T)
        if not bounds or bounds.allow(command.dq):
            return ''
        _, active = bounds.nearest(command.dq, None, [])
        name = active.name if active else ''
        return (
            f'held where a limit does not allow it ({name}): a task velocity moves it back '
            'within its limits, or change that limit'
        )

    def watch(self, q: JointPositions, cycles: Cycles) -> None:
        """Compare what was measured of a moving arm, `cycles` after the last state, with what was
        commanded.
        """
        published = self._controller.published
        if published is None:
            return
        seconds = cycles * self._controller.T
        update_peak(self._fast, published.dq, max(1.0 - seconds / _DECAY_TIME, 0.0))
        moves = self._moves(q, published.q, seconds)
        lag, joint = largest_excess(published.q, q, self._fast, _LAG_TIME)
        if lag > self._allowed:
            self.set(
                f'the arm does not follow: {self._model.joint_names[joint]} is {lag:.3g} rad from '
                f'its reference, allowed {self._allowed:g}'
            )
        if not moves:
            self.set_not_executing()
        if self._settling > _SETTLING_TIME and largest(published.dq) > _SETTLED:
            self.set(f'the null-space motion has not come to rest within {_SETTLING_TIME:g} s')

    def _moves(self, q: JointPositions, q_ref: JointPositions, seconds: Seconds) -> bool:
        """Whether any joint moves, if any is or was shortly before commanded to."""
        delayed = self._references[0] if self._references else q_ref
        self._references.append(q_ref)
        self._elapsed += seconds
        widen(self._lower, self._upper, q_ref, delayed, q)
        if self._elapsed < _SHORTEST:
            return True
        in_time, later, moved = self._upper - self._lower
        commanded = np.minimum(in_time, later)
        is_little = largest(commanded) < _COMMANDED
        if is_little and self._elapsed < _LONGEST:
            return True
        self._lower = np.array((q_ref, delayed, q))
        self._upper = self._lower.copy()
        self._elapsed = 0.0
        return is_little or bool((moved > _MOVED * commanded + _NOISE).any())
