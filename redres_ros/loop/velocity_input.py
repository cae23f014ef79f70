"""Incoming task and joint velocities: their parameters, age, speed, and the kind in use."""

import math
from dataclasses import dataclass

import numpy as np

from redres_ros.controller import Controller
from redres_ros.errors import RedresError
from redres_ros.loop.cycle_counter import CycleCounter
from redres_ros.loop.twist_buffer import TwistBuffer
from redres_ros.parameter import check_parameters, param
from redres_ros.policy import SCALING
from redres_ros.types import JointVelocities, Nanoseconds, Seconds, TaskVelocity

AUTO = 'auto'

# rclpy's EventsExecutor hands no source time over (it crashes on callbacks that ask for it), so
# what was queued while the process slept is recognised only by its arrival.
_QUEUED = 0.05  # [s] after a gap of all input, in which messages without a stamp may be old
_ROUNDING = 1e-9  # of a limit


@dataclass(frozen=True)
class LoopSettings:
    """When the controller follows, waits or holds, and how it buffers task velocities.

    Raises RangeError or UnknownNameError for a value that is not allowed.
    """

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

    def __post_init__(self) -> None:
        check_parameters(self)


class TwistSpeedError(RedresError):
    """A task velocity that is faster than allowed."""


class TwistAgeError(RedresError):
    """A task velocity whose stamp is too far from the robot's clock."""


class VelocityInput:
    """The input velocities, of the task or of all joints; the newest kind counts.

    Args:
        controller: Switches to the kind that is in use.
        cycles: The robot's clock.
        settings: Can be replaced at any time.

    Attributes:
        buffer: The one in use: of_task or of_joints.
        is_of_joints: Velocities of all joints are in use.
        is_open_loop: The newest velocity is of the task and was not computed from a state:
            teleoperation.
    """

    def __init__(
        self, controller: Controller, cycles: CycleCounter, settings: LoopSettings
    ) -> None:
        model = controller.model
        A = np.array(model.arm.acceleration_limit or (math.inf,) * model.n)
        lag = 0 if settings.lockstep else settings.twist_lag
        self.settings = settings
        self.of_task = TwistBuffer(controller.m, controller.T, lag)
        self.of_joints = TwistBuffer(model.n, controller.T, lag, A)
        self.buffer = self.of_task
        self.is_of_joints = False
        self.is_open_loop = False
        self._controller = controller
        self._cycles = cycles
        self._cycle = 0  # in which the newest velocity came
        self._time = math.inf  # when that was [s]; infinite if its stamp is that of a state
        self._last_input = 0.0  # when any input came last [s]
        self._woke = -math.inf  # when input came again after a gap [s]

    def note_input(self, now: Seconds) -> None:
        """Record when any input came: in a gap of all input the process may have slept."""
        if self._last_input and now - self._last_input > self.settings.command_timeout:
            self._woke = now
        self._last_input = now

    def check_twist(self, dx: TaskVelocity) -> None:
        """Raise TwistSpeedError for a task velocity that is too fast."""
        settings = self.settings
        for part, unit, name, most in (
            (dx[:3], 'm/s', 'max_linear', settings.max_linear),
            (dx[3:], 'rad/s', 'max_angular', settings.max_angular),
        ):
            speed = math.hypot(*part.tolist())
            if not speed <= most:
                raise TwistSpeedError(f'{speed:.6g} {unit}; allowed: {most:g} (parameter {name})')

    def check_joint_velocity(self, dq: JointVelocities) -> None:
        """Raise TwistSpeedError for joint velocities beyond the arm's limits."""
        model = self._controller.model
        excess = np.abs(dq) - model.dq_max * (1.0 + _ROUNDING)
        if not (excess <= 0.0).all():
            joint = int(np.argmax(excess))
            raise TwistSpeedError(
                f'{model.joint_names[joint]}: {dq[joint]:.6g} rad/s; '
                f'allowed: {model.dq_max[joint]:.6g}'
            )

    def enter(
        self,
        buffer: TwistBuffer,
        stamp: Nanoseconds,
        dx: TaskVelocity,
        now: Seconds,
        time_of_day: Nanoseconds,
    ) -> bool:
        """Store a velocity that was checked, in of_task or of_joints; returns whether it belongs to
        the state that its stamp names.

        The rest is as of CommandLoop.enter_twist().
        """
        cycles = self._cycles
        self.note_input(now)
        if not cycles.newest:
            return False  # no state has come that it could belong to
        stamp = cycles.robot_stamp(stamp, time_of_day, self.settings.command_timeout)
        if not self._is_of_this_robot(stamp):
            return False
        if buffer is not self.buffer:
            buffer.clear()
            self.buffer = buffer
            self.is_of_joints = buffer is self.of_joints
            self._controller.follow_joints(self.is_of_joints)
        of_a_state = stamp > 0 and cycles.is_of_a_state(stamp)
        self._cycle = cycles.number
        self._time = math.inf if of_a_state else now
        self.is_open_loop = not (self.is_of_joints or of_a_state)
        buffer.put(cycles.cycle(stamp) if stamp else cycles.number, dx)
        return of_a_state

    def _is_of_this_robot(self, stamp: Nanoseconds) -> bool:
        """Whether a velocity can be judged by the robot's clock: after a silence, its stamp may be
        another robot's, whose states have not come yet. Else TwistAgeError if it is too old.
        """
        if not stamp:
            if self._last_input - self._woke < _QUEUED:
                raise TwistAgeError(
                    f'without a stamp, within {_QUEUED:g} s after a gap of all input: it may have '
                    'been sent long before'
                )
            return True
        timeout = self.settings.command_timeout
        problem = self._cycles.age_problem(stamp, timeout)
        if not problem:
            return True
        if self._last_input - self._cycles.arrived > timeout:
            return False
        raise TwistAgeError(
            f'{problem} (parameter command_timeout); stamp it as the newest joint_states, or 0 for '
            'now'
        )

    def is_stale(self, cycle: int, now: Seconds) -> bool:
        """Whether the newest velocity is too old for the state of a cycle: by its stamp, and by its
        arrival on the robot's clock; on ours if it is of no state.
        """
        timeout = self.settings.command_timeout
        cycles = cycle - min(self.buffer.newest, self._cycle)
        return cycles * self._controller.T > timeout or now - self._time > timeout
