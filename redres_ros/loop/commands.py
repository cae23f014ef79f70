"""The commands of an arm that approaches, holds, moves or brakes, each through the safety filter,
and from where the robot is after cycles in which it got no command, or two.
"""

import math

import numpy as np

from redres_ros.command import Command, Published
from redres_ros.controller import Controller
from redres_ros.errors import RedresError
from redres_ros.kernels.boxes import stopping_speed
from redres_ros.loop.faults import FaultMonitor
from redres_ros.loop.measurements import Measurements
from redres_ros.loop.pose_hold import PoseHold
from redres_ros.loop.safety_filter import SafetyFilter
from redres_ros.loop.velocity_input import AUTO, VelocityInput
from redres_ros.types import Cycles, JointPositions, JointVelocities, Seconds, TaskVelocity

_TWIST = 6  # rows of a task velocity that has components to hold

_SPEED = 0.1  # of an approach, as a fraction of the joints' speed limits
_ACCELERATION = 1.0  # [rad/s^2] at most
_ARRIVED = 1e-6  # [rad]
_STEP = 0.4  # of A T^2, which a robot may execute at once
_SEEN = 0.3  # of that step
_RESPONSE = 0.2  # [s] in which an arm has to respond

# A response that was sent so shortly before the robot published the next state came after that.
_TOGETHER = 0.001  # [s] that both transports take, of the state and of the response
_TOGETHER_FRACTION = 0.25  # of a cycle, if that is less
_INTERVAL_TIME = 2.0  # [s] after which a long interval between states counts for less


class _Approach:
    """Joint velocities straight to a configuration, through all limits of the controller.

    Args:
        controller: Follows joint velocities until the approach is over.
        q: Where the arm is.
        is_probe: Take a step instead, so small that the robot may execute it at once, and which
            shows whether it executes commands.
    """

    def __init__(self, controller: Controller, q: JointPositions, is_probe: bool) -> None:
        self.is_probe = is_probe
        self.left = _RESPONSE if is_probe else math.inf  # time to move or arrive [s]
        self._controller = controller
        self._q = q
        self._target = q
        if is_probe:
            model = controller.model
            A = np.array(model.arm.acceleration_limit or (_ACCELERATION,) * model.n)
            middle = np.nan_to_num((model.q_min + model.q_max) / 2.0)
            self._target = q + np.copysign(_STEP * A * controller.T**2, middle - q)
        controller.follow_joints(True)

    def is_over(self, q: JointPositions) -> bool:
        """Whether the input may be followed a cycle later, with the arm measured at q."""
        self.left -= self._controller.T
        if self.is_probe:
            return bool((np.abs(q - self._q) > _SEEN * np.abs(self._target - self._q)).any())
        return float(np.abs(self._target - self._controller.reference).max()) <= _ARRIVED

    def velocity(self) -> JointVelocities:
        """The velocity from which all joints can stop at their targets."""
        rest = self._target - self._controller.reference
        T = self._controller.T
        allowed = [
            min(stopping_speed(abs(d), _ACCELERATION, T), V)
            for d, V in zip(rest.tolist(), self._controller.model.dq_max * _SPEED, strict=True)
        ]
        return rest * float(np.min(allowed / np.maximum(np.abs(rest), _ARRIVED)))


class Commands:
    """Updates the controller, along what the arm follows.

    Attributes:
        approach: What comes before the input is followed, while that lasts: to where the arm was
            measured, or a probe.
        interval: Cycles between two commands, at most, of late.
        sent: When the newest response was on its way [s].
    """

    def __init__(
        self,
        controller: Controller,
        faults: FaultMonitor,
        velocities: VelocityInput,
        measurements: Measurements,
    ) -> None:
        self.approach: _Approach | None = None
        self.interval = 1
        self.sent = -math.inf
        self.safety_filter = SafetyFilter(controller)
        self._controller = controller
        self._faults = faults
        self._velocities = velocities
        self._measurements = measurements
        self._pose_hold = PoseHold(controller)
        self._holds = controller.robot_interface.holds  # without a command
        self._before: Published | None = None  # what the last command continued from
        self._together = min(_TOGETHER, _TOGETHER_FRACTION * controller.T)  # [s]
        self._interval_cycle = 0  # when that was

    # --- cycles without a command, or with two ----------------------------------------------------

    def drop_late(self, published: Seconds) -> None:
        """Have the next command replace the last one, if both reach the robot in the same cycle,
        which has published a state between them.

        One that holds executes only the second of them, which would be a step of two cycles.
        """
        if self._holds and published - self.sent < self._together:
            self._controller.go_on_from(self._before)

    def allow_for_interval(self, missed: Cycles, cycle: int) -> None:
        """Allow for intervals between commands such as those before this cycle, in which a robot
        that does not hold moves on: joints must still stop in time.
        """
        if self._holds:
            return
        if missed + 1 >= self.interval:
            self.interval = missed + 1
            self._interval_cycle = cycle
        elif (cycle - self._interval_cycle) * self._controller.T > _INTERVAL_TIME:
            self.interval -= 1
            self._interval_cycle = cycle
        if self._controller.gap != self.interval:
            self._controller.gap = self.interval

    def still_moves(self, moved: JointPositions, missed: Cycles, published: Published) -> bool:
        """Whether a robot has continued by itself in all cycles without a command.

        Args:
            moved: Since the last response; a servo's lag is in both positions.
            published: The last reference.
        """
        if self._holds:
            return False
        expected = self._controller.bridged(published, missed).q - published.q
        return float(np.abs(moved - expected).max()) <= 0.5 * float(np.abs(expected).max())

    # --- commands ---------------------------------------------------------------------------------

    def begin_motion(self, q: JointPositions) -> None:
        """Move from now on; an arm measured elsewhere, at q, is approached first."""
        self._pose_hold.clear()
        is_probe = self._faults.is_probing
        if is_probe or self._faults.is_away(q):
            self.approach = _Approach(self._controller, q, is_probe)
        self._controller.resume()

    def end_approach(self) -> None:
        """Follow the input velocity again."""
        if self.approach is not None:
            self.approach = None
            self._controller.follow_joints(self._velocities.is_of_joints)

    def hold(self) -> Command:
        """The same reference again, exactly."""
        self.safety_filter.reason = ''
        return self._controller.hold_command()

    def move(self, q: JointPositions, dx: TaskVelocity, missed: Cycles) -> Command:
        """The next reference, along the input velocity dx or an approach, from q as measured.

        Raises:
            RedresError: There is none. The one before is still in force.
        """
        controller = self._controller
        published = controller.published
        scaling = self._velocities.settings.scaling
        if scaling == AUTO:
            scaling = 'components' if self._velocities.is_open_loop else 'task'
        if scaling != controller.policy.scaling:
            controller.set_scaling(scaling)
        try:
            if self.approach is not None:
                return self._approached(self.approach, q, missed)
            if self._velocities.is_of_joints:
                return self._publish(q, dx, missed)
            return self._along_task(q, dx, missed)
        except RedresError:
            controller.go_on_from(published)
            raise

    def brake(self, q: JointPositions, missed: Cycles) -> Command:
        """The next reference of an arm that is to come to rest."""
        self._controller.hold()
        return self._publish(q, np.zeros(self._controller.m), missed)

    def _approached(self, approach: _Approach, q: JointPositions, missed: Cycles) -> Command:
        command = self._publish(q, approach.velocity(), missed)
        if approach.is_over(q):
            self.end_approach()
            self._faults.is_probing = False
        return command

    def _along_task(self, q: JointPositions, dx: TaskVelocity, missed: Cycles) -> Command:
        """The command for a task velocity, with what holds a component of it and what yields."""
        measurements = self._measurements
        is_open_loop = self._velocities.is_open_loop
        correction = None
        if len(dx) == _TWIST and (is_open_loop or self._pose_hold.acts):
            # What yields is not held.
            dx, correction = self._pose_hold.hold(dx, is_open_loop and not measurements.yields)
        if not measurements.yields:
            return self._publish(q, dx, missed, correction)
        contact = measurements.contact
        yielding = contact.velocity(dx, measurements.state(q), missed)
        command = self._publish(q, yielding, missed, correction)
        contact.record(command, dx)
        return command

    def _publish(
        self,
        q: JointPositions,
        dx: TaskVelocity,
        missed: Cycles,
        correction: TaskVelocity | None = None,
    ) -> Command:
        """The command for a velocity, from which the next tick continues."""
        plan = self._controller.plan(q, dx, missed, correction)
        plan = self.safety_filter.admit(plan)
        self._before = plan.base
        return self._controller.commit(plan)
