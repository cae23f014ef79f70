"""Incoming task and joint velocities: age, speed, the one in use, and what is held beside it."""

import math
from dataclasses import replace

import numpy as np

from redres_ros.controller import Controller
from redres_ros.errors import RedresError
from redres_ros.kernels.tick import largest
from redres_ros.loop.cycle_counter import CycleCounter
from redres_ros.loop.settings import LoopSettings
from redres_ros.loop.twist_buffer import TwistBuffer, TwistBufferSettings
from redres_ros.robot_model import RobotState
from redres_ros.tasks import Pose

# rclpy's EventsExecutor hands no source time over (it crashes on callbacks that ask for it), so
# what was queued while the process slept is recognised only by its arrival.
_QUEUED = 0.05  # [s] after a gap of all input, in which messages without a stamp may be old
_ROUNDING = 1e-9  # of a limit

_HOLDING_GAIN = 2.0  # [1/s] of the error of what is held
# [m/s], [rad/s] with which the tip comes back at most; limits may have turned it by half a turn
_FASTEST = {'translation': 0.25, 'rotation': 1.0}

_NOTHING = 1e-9  # [m/s], [rad/s] that count as zero: rounding of a transformation

_COMPONENTS = {'translation': slice(0, 3), 'rotation': slice(3, 6)}


class TwistSpeedError(RedresError):
    """A task velocity that is faster than allowed."""


class TwistAgeError(RedresError):
    """A task velocity whose stamp is too far from the robot's clock."""


class VelocityInput:
    """The input velocities, of the task or of all joints; the newest kind counts.

    Args:
        controller: Goes over to the kind that is in use.
        cycles: The robot's clock.
        settings: Ages and speeds that are allowed; they can be replaced at any time.
        twists: How velocities are buffered; in lock-step without lag.
    """

    def __init__(
        self,
        controller: Controller,
        cycles: CycleCounter,
        settings: LoopSettings,
        twists: TwistBufferSettings,
    ) -> None:
        if settings.lockstep:
            twists = replace(twists, twist_lag=0)
        model = controller.model
        self.settings = settings
        A = np.array(model.arm.acceleration_limit or (math.inf,) * model.n)
        self.of_task = TwistBuffer(controller.m, controller.T, twists)
        self.of_joints = TwistBuffer(model.n, controller.T, twists, A)
        self.buffer = self.of_task  # the one in use
        self.is_of_joints = False  # velocities of all joints are in use
        # The newest one is of the task and was not computed from a state: teleoperation.
        self.is_open_loop = False
        self._controller = controller
        self._cycles = cycles
        self._cycle = 0  # in which the newest velocity came
        self._time = math.inf  # when that was [s]; infinite if its stamp is that of a state
        self._last_input = 0.0  # when any input came last [s]
        self._woke = -math.inf  # when input came again after a gap [s]

    def note_input(self, now: float) -> None:
        """Record the monotonic time [s] of any input: in a gap of all input the process may have
        slept.
        """
        if self._last_input and now - self._last_input > self.settings.command_timeout:
            self._woke = now
        self._last_input = now

    def check_twist(self, dx: np.ndarray) -> None:
        """Raise TwistSpeedError for a task velocity (m,) [m/s], [rad/s] that is too fast."""
        settings = self.settings
        linear = math.hypot(*dx[:3].tolist())
        angular = math.hypot(*dx[3:].tolist())
        if not linear <= settings.max_linear:
            raise TwistSpeedError(
                f'{linear:.6g} m/s; allowed: {settings.max_linear:g} (parameter max_linear)'
            )
        if not angular <= settings.max_angular:
            raise TwistSpeedError(
                f'{angular:.6g} rad/s; allowed: {settings.max_angular:g} (parameter max_angular)'
            )

    def check_joint_velocity(self, dq: np.ndarray) -> None:
        """Raise TwistSpeedError for joint velocities (n,) [rad/s] beyond the arm's limits."""
        model = self._controller.model
        excess = np.abs(dq) - model.dq_max * (1.0 + _ROUNDING)
        if not (excess <= 0.0).all():
            joint = int(np.argmax(excess))
            raise TwistSpeedError(
                f'{model.joint_names[joint]}: {dq[joint]:.6g} rad/s; '
                f'allowed: {model.dq_max[joint]:.6g}'
            )

    def enter(
        self, buffer: TwistBuffer, stamp: int, dx: np.ndarray, now: float, time_of_day: int
    ) -> bool:
        """Store a velocity; returns whether it belongs to the state that its stamp names.

        Args:
            buffer: of_task or of_joints.
            stamp: Stamp of the state that it belongs to, or another time on the robot's clock [ns];
                0 for now.
            dx: A velocity that was checked.
            now: Its arrival [s].
            time_of_day: The same by the computer's clock [ns]; 0: not known.

        Raises:
            TwistAgeError: It is too old, or stamped too far ahead.
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

    def _is_of_this_robot(self, stamp: int) -> bool:
        """Whether a velocity can be judged by the robot's clock: after a silence, its stamp may be
        another robot's, whose states have not come yet.

        Args:
            stamp: Stamp of the velocity [ns]; 0 for now.

        Raises:
            TwistAgeError: It is too old or stamped too far ahead while states come.
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

    def is_stale(self, cycle: int, now: float) -> bool:
        """Whether the newest velocity is too old, by its stamp, and by its arrival on the robot's
        clock; on ours if it is of no state.

        Args:
            cycle: Cycle of the state that is responded to.
            now: Time by a monotonic clock [s].
        """
        timeout = self.settings.command_timeout
        cycles = max(self.buffer.age(cycle), cycle - self._cycle)
        return cycles * self._controller.T > timeout or now - self._time > timeout


class PoseHold:
    """Adds to a twist what holds the component that it does not ask for.

    A velocity that is integrated drifts, and beside singularities and limits it is not executed in
    full. A planner closes its own loop, an operator does not, whose translation alone must not turn
    the tip. So a component of the twist, translation or rotation, that is zero while the other one
    is not holds its last commanded value.

    Args:
        controller: Knows the task and the last reference.
        settings: The accelerations with which that comes and goes.
    """

    def __init__(self, controller: Controller, settings: TwistBufferSettings) -> None:
        self._controller = controller
        self._steps = {
            'translation': settings.max_linear_acceleration * controller.T,
            'rotation': settings.max_angular_acceleration * controller.T,
        }
        self.clear()

    def clear(self) -> None:
        """Hold nothing."""
        self._targets: dict[str, Pose] = {}  # by component
        self._added = np.zeros(6)

    def hold(self, dx: np.ndarray, is_open_loop: bool) -> tuple[np.ndarray, np.ndarray | None]:
        """The twist (6,), and the part of it that only holds; that is None if nothing is held.

        Args:
            dx: The velocity of the task, (m,) [m/s] and [rad/s].
            is_open_loop: Whether dx is an operator's.
        """
        task = self._controller.policy.task
        may_hold = is_open_loop or largest(self._added) > 0.0
        if not may_hold or not isinstance(task, Pose):
            self.clear()
            return dx, None
        q_ref = self._controller.reference
        state = RobotState(self._controller.model, q_ref, np.zeros(len(q_ref)))
        correction = np.zeros(6)
        for component, rows in _COMPONENTS.items():
            velocity = np.zeros(3)
            is_held = is_open_loop and not _asks(dx[rows])
            if not is_held:
                self._targets.pop(component, None)
            elif not _asks(dx):
                pass  # a reversal passes through zero: what is held stays the same
            elif component not in self._targets:
                pose = Pose(gain=_HOLDING_GAIN, frame=task.frame)
                self._targets[component] = pose.with_initial_targets(state)
            else:
                velocity = self._targets[component].velocity(state)[rows]
                most = _FASTEST[component]
                velocity = velocity * min(1.0, most / max(float(np.linalg.norm(velocity)), most))
            change = velocity - self._added[rows]
            step = self._steps[component]
            self._added[rows] += change * min(1.0, step / max(float(np.linalg.norm(change)), step))
            if is_held:
                correction[rows] = self._added[rows]
        return dx + self._added, correction if correction.any() else None


def _asks(dx: np.ndarray) -> bool:
    """Whether a velocity, or a component of it, asks for motion."""
    return bool((np.abs(dx) > _NOTHING).any())
