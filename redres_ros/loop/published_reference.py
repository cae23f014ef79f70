"""What goes out: the reference that the robot gets, at rest, moving or braking."""

import numpy as np

from redres_ros.command import Command
from redres_ros.controller import Controller
from redres_ros.errors import RedresError
from redres_ros.loop.approach import Approach, Probe
from redres_ros.loop.faults import FaultMonitor
from redres_ros.loop.gate import Gate
from redres_ros.loop.measurements import Measurements
from redres_ros.loop.pose_hold import PoseHold
from redres_ros.loop.settings import AUTO
from redres_ros.loop.twist_buffer import TwistBufferSettings
from redres_ros.loop.velocity_input import VelocityInput


class PublishedReference:
    """The published reference, and what decides where the next one may be.

    Args:
        controller: Is updated here and nowhere else.
        faults: Knows how far the arm may be from its reference.
        velocities: What the arm follows.
        measurements: May change the task velocity.
        twists: Accelerations with which an unused component of a twist is held.
    """

    def __init__(
        self,
        controller: Controller,
        faults: FaultMonitor,
        velocities: VelocityInput,
        measurements: Measurements,
        twists: TwistBufferSettings,
    ) -> None:
        self.exists = False  # one was published: the next has to follow from it
        self.gate = Gate(controller)
        self.approach: Approach | None = None  # goes before the input velocity
        self._controller = controller
        self._faults = faults
        self._velocities = velocities
        self._measurements = measurements
        self._pose_hold = PoseHold(controller, twists)

    def place(self, q: np.ndarray) -> None:
        """Be at rest at q (n,) [rad]."""
        self._controller.place(q)
        self.exists = True

    def begin_motion(self, q: np.ndarray) -> None:
        """Move from now on; an arm that is elsewhere is approached first.

        Args:
            q: Measured, (n,) [rad].
        """
        if not self.exists:
            self.place(q)
        self._pose_hold.clear()
        if self._faults.is_probing:
            self.approach = Probe(self._controller, q)
        elif self._faults.is_away(q):
            self.approach = Approach(self._controller, q)
        self._controller.resume()

    def end_approach(self) -> None:
        """Follow the input velocity again."""
        if self.approach is not None:
            self.approach = None
            self._controller.follow_joints(self._velocities.is_of_joints)

    def rest(self, q: np.ndarray) -> None:
        """Stay at the last reference; without one at the measured position q (n,) [rad]."""
        self.place(self._controller.reference if self.exists else q)

    def standing(self) -> Command:
        """The same reference again, exactly."""
        self.gate.reason = ''
        return self._controller.standing()

    def moving(self, q: np.ndarray, dx: np.ndarray, missed: int, *, yields: bool) -> Command:
        """The next reference, on the way of the input velocity or of an approach.

        Args:
            q: Measured, (n,) [rad].
            dx: Input velocity, (m,).
            missed: Cycles since the last reference that went without one.
            yields: Whether what is measured may change the task velocity.

        Raises:
            RedresError: There is none. The one before is still in force.
        """
        controller = self._controller
        velocities = self._velocities
        before = controller.reference, controller.dq
        correction = None
        scaling = velocities.settings.scaling
        if scaling == AUTO:
            scaling = 'components' if velocities.is_open_loop else 'task'
        controller.set_scaling(scaling)
        is_of_task = self.approach is None and not velocities.is_of_joints
        try:
            if self.approach is not None:
                dx = self.approach.velocity()
            if is_of_task:
                # what yields is not held
                is_open_loop = velocities.is_open_loop and not self._measurements.yields
                dx, correction = self._pose_hold.hold(dx, is_open_loop)
            if is_of_task and yields:
                dx = self._measurements.velocity(dx, q, missed)
            command = self.gate.admit(controller.update(q, dx, missed, correction))
        except RedresError:
            controller.correct(*before)
            raise
        if is_of_task and yields:
            self._measurements.record(command)
        if self.approach is not None and self.approach.is_over(q):
            self.end_approach()
            self._faults.is_probing = False
        return command

    def braking(self, q: np.ndarray, missed: int) -> Command:
        """The next reference of an arm that is to come to rest.

        Args:
            q: Measured, (n,) [rad].
            missed: As of moving().
        """
        self._controller.hold()
        zeros = np.zeros(self._controller.m)
        return self.gate.admit(self._controller.update(q, zeros, missed))

    def problem(self, q: np.ndarray) -> str:
        """Why an arm at rest cannot stay at its reference; '' if it can.

        Args:
            q: Measured, (n,) [rad].
        """
        controller = self._controller
        command = controller.standing()
        if self._faults.is_away(q):
            lag, joint = self._faults.lag(q)
            name = controller.model.joint_names[joint]
            return (
                f'held, and {name} is measured {lag:.3g} rad from its reference: the next motion '
                'begins with an approach to where the arm is'
            )
        limits = controller.policy.limits
        bounds = limits and limits.at(command.state, command.T)
        if not bounds or bounds.allow(command.dq):
            return ''
        _, active, _ = bounds.nearest(command.dq, None, [])
        return (
            f'held where a limit does not allow it ({active}): a task velocity moves it back '
            'within its limits, or change that limit'
        )
