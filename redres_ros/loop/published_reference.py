"""The published reference, at rest, moving or braking; and what the robot does in cycles in which
it gets none, or two.
"""

import math

import numpy as np

from redres_ros.command import Command
from redres_ros.controller import Controller
from redres_ros.errors import RedresError
from redres_ros.loop.approach import Approach, Probe
from redres_ros.loop.faults import FaultMonitor
from redres_ros.loop.gate import Gate
from redres_ros.loop.measurements import Measurements
from redres_ros.loop.settings import AUTO
from redres_ros.loop.twist_buffer import TwistBufferSettings
from redres_ros.loop.velocity_input import PoseHold, VelocityInput

# A response that was sent so shortly before the robot published the next state came after that.
_TOGETHER = 0.001  # [s] that both transports take, of the state and of the response
_TOGETHER_FRACTION = 0.25  # of a cycle, if that is less
_GAP_TIME = 2.0  # [s] after which a gap between states counts for less


class PublishedReference:
    """The published reference, and what decides where the next one may be.

    Args:
        controller: Controller, which is updated only here.
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
        """Move from now on; an arm measured elsewhere, at q (n,) [rad], is approached first."""
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
        """The next reference, along the input velocity or an approach.

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
        yields = yields and is_of_task and self._measurements.yields
        try:
            if self.approach is not None:
                dx = self.approach.velocity()
            if is_of_task:
                # what yields is not held
                is_open_loop = velocities.is_open_loop and not self._measurements.yields
                dx, correction = self._pose_hold.hold(dx, is_open_loop)
            if yields:
                dx = self._measurements.velocity(dx, q, missed)
            command = self.gate.admit(controller.update(q, dx, missed, correction))
        except RedresError:
            controller.correct(*before)
            raise
        if yields:
            self._measurements.record(command)
        if self.approach is not None and self.approach.is_over(q):
            self.end_approach()
            self._faults.is_probing = False
        return command

    def braking(self, q: np.ndarray, missed: int) -> Command:
        """The next reference of an arm that is to come to rest.

        Args:
            q: Measured, (n,) [rad].
            missed: See moving().
        """
        self._controller.hold()
        zeros = np.zeros(self._controller.m)
        return self.gate.admit(self._controller.update(q, zeros, missed))

    def problem(self, q: np.ndarray) -> str:
        """Why an arm at rest, measured at q (n,) [rad], cannot stay at its reference; or ''."""
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
        _, active = bounds.nearest(command.dq, None, [])
        name = active.name if active else ''
        return (
            f'held where a limit does not allow it ({name}): a task velocity moves it back '
            'within its limits, or change that limit'
        )


class MissedCycles:
    """Has the controller allow for cycles without a command."""

    def __init__(self, controller: Controller) -> None:
        self.sent = -math.inf  # when the newest response was on its way [s]
        self._controller = controller
        self._together = min(_TOGETHER, _TOGETHER_FRACTION * controller.T)  # [s]
        self._gap = 1  # cycles between two responses, at most, of late
        self._gap_cycle = 0  # when that was

    def count(self, missed: int, cycle: int) -> None:
        """Prepare for gaps such as the last ones, in which a robot that does not hold moves on:
        joints must still stop in time.

        Args:
            missed: Cycles without a command before this one.
            cycle: The present one.
        """
        controller = self._controller
        if controller.bridging == 'hold':
            return
        if missed + 1 >= self._gap:
            self._gap = missed + 1
            self._gap_cycle = cycle
        elif (cycle - self._gap_cycle) * controller.T > _GAP_TIME:
            self._gap -= 1
            self._gap_cycle = cycle
        controller.gap = self._gap

    def explain(self, moved: np.ndarray, missed: int) -> bool:
        """Whether a robot that extrapolates has gone on by itself all the time: it still moves.

        Args:
            moved: Since the last response, (n,) [rad]; a servo's lag is in both positions.
            missed: Cycles without a command.
        """
        if self._controller.bridging == 'hold':
            return False
        p, _ = self._controller.bridged(missed)
        expected = p - self._controller.reference
        return float(np.abs(moved - expected).max()) <= 0.5 * float(np.abs(expected).max())

    def rollback_if_late(self, published: float) -> None:
        """Take back the last response if the next one will reach the robot in the same cycle.

        For a robot that holds: it executes only the second of them, which would be a step of two
        cycles.

        Args:
            published: When the robot published the next state [s].
        """
        if published - self.sent < self._together:
            self._controller.correct(*self._controller.before)
