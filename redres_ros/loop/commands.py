"""The commands of an arm that holds, moves or brakes, each through the safety filter."""

import numpy as np

from redres_ros.command import Command, Published
from redres_ros.controller import Controller
from redres_ros.errors import RedresError
from redres_ros.loop.approach import Approach
from redres_ros.loop.faults import FaultMonitor
from redres_ros.loop.measurements import Measurements
from redres_ros.loop.modes import Source
from redres_ros.loop.pose_hold import PoseHold
from redres_ros.loop.safety_filter import SafetyFilter
from redres_ros.loop.settings import AUTO
from redres_ros.loop.velocity_input import VelocityInput
from redres_ros.types import Cycles, JointPositions, TaskVelocity

_TWIST = 6  # rows of a task velocity that has components to hold


class Commands:
    """Updates the controller, along what the arm follows.

    Attributes:
        source: What a moving arm follows.
        approach: Of the sources APPROACH and PROBE; else None.
        before: What the last command continued from; None before the first.
    """

    def __init__(
        self,
        controller: Controller,
        faults: FaultMonitor,
        velocities: VelocityInput,
        measurements: Measurements,
    ) -> None:
        self.source = Source.INPUT
        self.approach: Approach | None = None
        self.before: Published | None = None
        self.safety_filter = SafetyFilter(controller)
        self._controller = controller
        self._faults = faults
        self._velocities = velocities
        self._measurements = measurements
        self._pose_hold = PoseHold(controller, velocities.settings)

    def begin_motion(self, q: JointPositions) -> None:
        """Move from now on; an arm measured elsewhere, at q, is approached first."""
        self._pose_hold.clear()
        is_probe = self._faults.is_probing
        if is_probe or self._faults.is_away(q):
            self.approach = Approach(self._controller, q, is_probe)
            self.source = Source.PROBE if is_probe else Source.APPROACH
        self._controller.resume()

    def end_approach(self) -> None:
        """Follow the input velocity again."""
        if self.approach is not None:
            self.approach = None
            self.source = Source.INPUT
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
        velocities = self._velocities
        published = controller.published
        yields = self._measurements.yields
        scaling = velocities.settings.scaling
        if scaling == AUTO:
            scaling = 'components' if velocities.is_open_loop else 'task'
        if scaling != controller.policy.scaling:
            controller.set_scaling(scaling)
        try:
            if self.approach is not None:
                return self._approached(self.approach, q, missed)
            if velocities.buffer is velocities.of_joints:
                return self._publish(q, dx, missed)
            correction = None
            if len(dx) == _TWIST and (velocities.is_open_loop or self._pose_hold.acts):
                # what yields is not held
                dx, correction = self._pose_hold.hold(dx, velocities.is_open_loop and not yields)
            if yields:
                dx = self._measurements.velocity(dx, q, missed)
            command = self._publish(q, dx, missed, correction)
        except RedresError:
            controller.go_on_from(published)
            raise
        if yields:
            self._measurements.record(command)
        return command

    def brake(self, q: JointPositions, missed: Cycles) -> Command:
        """The next reference of an arm that is to come to rest."""
        self._controller.hold()
        return self._publish(q, np.zeros(self._controller.m), missed)

    def _approached(self, approach: Approach, q: JointPositions, missed: Cycles) -> Command:
        controller = self._controller
        command = self._publish(q, approach.velocity(controller.reference), missed)
        if approach.is_over(q, controller.reference, controller.T):
            self.end_approach()
            self._faults.is_probing = False
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
        self.before = plan.base
        return self._controller.commit(plan)
