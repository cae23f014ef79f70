"""Incoming task and joint velocities: their parameters, age, speed, and the kind in use; sampled
with a fixed lag, then limited in their acceleration.

Which velocity a cycle uses must not depend on which process ran first: one tick more or less would
look like an acceleration, and a law that minimises accelerations would obey it.
"""

import math
from collections import deque
from dataclasses import dataclass

import numpy as np

from redres_ros.controller import Controller
from redres_ros.errors import RedresError
from redres_ros.loop.cycle_counter import CycleCounter
from redres_ros.parameter import Checked, param
from redres_ros.policy import SCALING
from redres_ros.types import (
    Cycles,
    JointAccelerations,
    JointVelocities,
    Nanoseconds,
    Seconds,
    TaskVelocity,
)

AUTO = 'auto'

# With which a sudden task velocity is approached.
LINEAR_ACCELERATION = 2.0  # [m/s^2]
ANGULAR_ACCELERATION = 6.0  # [rad/s^2]

_DENSE = 2  # cycles now and then between two velocities of a source that sends one a cycle
_RECENT = 4  # intervals by which that is judged
_RETURN = 4  # cycles for each one missed, over which an extrapolation fades out
_EXTRAPOLATED = 10  # cycles at most over which a steady change goes on without new velocities
# rclpy's EventsExecutor hands no source time over (it crashes on callbacks that ask for it), so
# what was queued while the process slept is recognised only by its arrival.
_QUEUED = 0.05  # [s] after a gap of all states, in which messages without a stamp may be old
_SILENT = 0.15  # [s] without a state, after which velocities are of no use
_ROUNDING = 1e-9  # of a limit


@dataclass(frozen=True)
class LoopSettings(Checked):
    """When the controller follows, waits or holds, and how it buffers task velocities."""

    command_timeout: float = param(
        0.1, 'age at which a cartesian_velocity counts as stale [s]', 0.001, 10.0, live=True
    )
    max_linear: float = param(
        2.0, 'largest linear task velocity; a faster one is refused [m/s]', 0.001, 100.0, live=True
    )
    max_angular: float = param(
        6.0, 'the same for the angular task velocity [rad/s]', 0.001, 100.0, live=True
    )
    twist_lag: int = param(
        1, 'cycles after its state at which a task velocity acts; in lock-step 0', 0, 100
    )
    scaling: str = param(
        AUTO,
        'what limits scale: the task velocity as a whole, or its components, translation and '
        'rotation; auto: the components of a velocity that is not computed from a state, as that '
        'of teleoperation',
        choices=(AUTO, *SCALING),
        live=True,
    )
    lockstep: bool = param(
        False, 'respond to a state only together with the cartesian_velocity of the same stamp'
    )


class VelocityError(RedresError):
    """A velocity that is faster than allowed, or whose stamp is too far from the robot's clock."""


class _TwistBuffer:
    """Returns the velocity of the state `lag` cycles ago, within the largest accelerations.

    What comes every cycle acts as it is. Whatever the velocity jumps by is added back, and fades
    out: over the cycles since the velocity before, which smooths what a camera or a joystick sends,
    or over as many as the accelerations need. While none comes from a source that sends one a
    cycle, a steady change goes on for a few cycles, and its error fades out over four times those.

    Args:
        rows: Rows of a velocity: 3, or 6 with the angular part below.
        accelerations: Of each row by itself, instead of a linear and an angular one.

    Attributes:
        newest: Cycle of the newest velocity; -inf without one.
        known_until: Cycle up to which play() need not guess.
        missing: Cycles in which none came from a source that sends one a cycle.
        late: Velocities that came after the cycle in which they were to act.
    """

    def __init__(
        self, rows: int, T: Seconds, lag: Cycles, accelerations: JointAccelerations | None = None
    ) -> None:
        self.missing = 0
        self.late = 0
        self._lag = lag
        self._linear_step = LINEAR_ACCELERATION * T  # [m/s] a cycle
        self._angular_step = ANGULAR_ACCELERATION * T  # [rad/s] a cycle
        self._steps = None if accelerations is None else accelerations * T  # (m,) a cycle
        self._rest = np.zeros(rows)
        self._played = 0  # cycle that was played last
        self.clear()

    def clear(self) -> None:
        """Clear the buffer: the next velocity is approached from rest."""
        self.newest = -math.inf
        self.known_until = -math.inf
        self._twists: dict[int, TaskVelocity] = {}  # by cycle: those that have not acted yet
        self._sampled: int | None = None  # cycle of the last one that has
        self._dx = self._rest  # that one
        self._intervals: deque[Cycles] = deque(maxlen=_RECENT)  # between the last ones
        self._is_dense = False  # they come from a source that sends one a cycle, but for a few
        self._slope = self._rest  # their steady change a cycle
        self._guesses = 0  # cycles since the last one
        self._residual = self._rest  # what is added, and fades out
        self._left = 0  # cycles until it has

    def put(self, cycle: int, dx: TaskVelocity) -> None:
        """Record the velocity of a cycle; of several for one cycle the newest counts."""
        self.late += cycle + self._lag <= self._played
        if self._sampled is None or cycle >= self._sampled:
            self._twists[cycle] = dx
            self.newest = max(self.newest, cycle)
            self.known_until = self.newest + self._lag

    def play(self, cycle: int) -> TaskVelocity:
        """The velocity of a later cycle."""
        cycles = max(cycle - self._played, 1)
        self._played = cycle
        sampled = cycle - self._lag
        expected = self._predicted(sampled) if self._guesses else self._dx
        is_new = False
        for known in sorted(self._twists):
            if known <= sampled:
                self._take(known)
                is_new = True
        is_guess = self._sampled is not None and self._sampled != sampled
        target = self._predicted(sampled) if is_guess else self._dx
        if is_new:
            jump = expected - target
            spread = self._intervals[-1] if self._intervals else 0
            if self._is_dense:
                spread = _RETURN * self._guesses
            if spread or self._cycles_needed(jump) > cycles:
                self._residual = self._residual + jump
                self._left = max(self._left, spread, self._cycles_needed(self._residual))
        self._guesses = self._guesses + 1 if is_guess else 0
        self.missing += is_guess and self._is_dense
        if self._left:
            self._left -= 1
            self._residual = self._residual * (self._left / (self._left + 1))
        return target + self._residual

    def _take(self, cycle: int) -> None:
        dx = self._twists.pop(cycle)
        self._slope = self._rest
        if self._sampled is not None:
            interval = max(cycle - self._sampled, 1)
            self._intervals.append(interval)
            self._is_dense = min(self._intervals) <= _DENSE
            if self._is_dense:
                self._slope = (dx - self._dx) / interval
        self._sampled = cycle
        self._dx = dx

    def _predicted(self, cycle: int) -> TaskVelocity:
        """The last velocity, continued to a cycle if it changes steadily."""
        if self._sampled is None or self._cycles_needed(self._slope) > 1:
            return self._dx
        return self._dx + min(cycle - self._sampled, _EXTRAPOLATED) * self._slope

    def _cycles_needed(self, change: TaskVelocity) -> Cycles:
        """Over so many cycles a change keeps to the largest accelerations."""
        if self._steps is not None:
            return math.ceil(float((np.abs(change) / self._steps).max()) - 1e-9)
        values = change.tolist()
        linear = math.hypot(*values[:3]) / self._linear_step
        angular = math.hypot(*values[3:]) / self._angular_step
        return math.ceil(max(linear, angular) - 1e-9)


class VelocityInput:
    """The input velocities, of the task or of all joints; the newest kind counts.

    Attributes:
        buffer: The one in use: of_task or of_joints.
        is_of_joints: Velocities of all joints are in use.
        is_of_state: The newest velocity was computed from a state; an operator's is not.
        is_steered: It is of the task, and not computed from a state.
    """

    def __init__(
        self, controller: Controller, cycles: CycleCounter, settings: LoopSettings
    ) -> None:
        model = controller.model
        A = np.array(model.arm.acceleration_limit or (math.inf,) * model.n)
        lag = 0 if settings.lockstep else settings.twist_lag
        self.settings = settings
        self.of_task = _TwistBuffer(controller.m, controller.T, lag)
        self.of_joints = _TwistBuffer(model.n, controller.T, lag, A)
        self.buffer = self.of_task
        self.is_of_joints = False
        self.is_of_state = True
        self.is_steered = False
        self._controller = controller
        self._cycles = cycles
        self._cycle = 0  # in which the newest velocity came
        self._arrived = 0.0  # when that was [s]

    def enter(
        self,
        stamp: Nanoseconds,
        dx: TaskVelocity | JointVelocities,
        now: Seconds,
        time_of_day: Nanoseconds,
        *,
        of_joints: bool,
    ) -> None:
        """Store a velocity, as CommandLoop.enter_velocity(). Raises VelocityError."""
        self._check_speed(dx, of_joints)
        cycles = self._cycles
        timeout = self.settings.command_timeout
        stamp, problem = cycles.judge(stamp, time_of_day, timeout)
        is_silent = now - cycles.arrived > _SILENT
        if not cycles.newest or (is_silent and (problem or not stamp)):
            return  # the states that it belongs to have not come yet
        if problem:
            raise VelocityError(
                f'{problem} (parameter command_timeout); stamp it as the newest joint_states, or 0 '
                'for now'
            )
        if not stamp and now - cycles.woke < _QUEUED:
            raise VelocityError(
                f'without a stamp, within {_QUEUED:g} s after a gap of all states: it may have '
                'been sent long before'
            )
        if of_joints is not self.is_of_joints:
            self.is_of_joints = of_joints
            self.buffer = self.of_joints if of_joints else self.of_task
            self.buffer.clear()
        self.is_of_state = stamp > 0 and cycles.is_of_a_state(stamp)
        self.is_steered = not (of_joints or self.is_of_state)
        self._cycle = cycles.number
        self._arrived = now
        self.buffer.put(cycles.cycle(stamp) if stamp else cycles.number, dx)

    def _check_speed(self, dx: TaskVelocity | JointVelocities, of_joints: bool) -> None:
        if of_joints:
            model = self._controller.model
            excess = np.abs(dx) - model.dq_max * (1.0 + _ROUNDING)
            if not (excess <= 0.0).all():
                joint = int(np.argmax(excess))
                raise VelocityError(
                    f'{model.joint_names[joint]}: {dx[joint]:.6g} rad/s; '
                    f'allowed: {model.dq_max[joint]:.6g}'
                )
            return
        settings = self.settings
        for part, unit, name, most in (
            (dx[:3], 'm/s', 'max_linear', settings.max_linear),
            (dx[3:], 'rad/s', 'max_angular', settings.max_angular),
        ):
            speed = math.hypot(*part.tolist())
            if not speed <= most:
                raise VelocityError(f'{speed:.6g} {unit}; allowed: {most:g} (parameter {name})')

    def is_stale(self, cycle: int, now: Seconds) -> bool:
        """Whether the newest velocity is too old for the state of a cycle: by its stamp, and by its
        arrival on the robot's clock; on ours if it is of no state.
        """
        timeout = self.settings.command_timeout
        cycles = cycle - min(self.buffer.newest, self._cycle)
        waited = 0.0 if self.is_of_state else now - self._arrived
        return cycles * self._controller.T > timeout or waited > timeout
