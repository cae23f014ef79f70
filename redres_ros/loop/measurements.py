"""Wrenches and other measurements beside joint positions, and motion that they ask for."""

import numpy as np

from redres_ros.contact import BASE, ContactControl
from redres_ros.controller import Controller
from redres_ros.loop.cycle_counter import ClockError, CycleCounter
from redres_ros.robot_model import RobotState, TickContext
from redres_ros.types import Cycles, JointPositions, Nanoseconds, Seconds, Wrench, check_finite

_PAUSE = 0.5  # [s] for which a motion goes on after the last measurement that asked for it


class Measurements:
    """Wrenches for contact, other measurements for preferences and limits.

    Attributes:
        is_idle: Nothing was measured, and nothing was to yield.
        asks: For motion, now or shortly before.
        yields: Contact may change the task velocity.
    """

    def __init__(
        self, controller: Controller, contact: ContactControl, cycles: CycleCounter
    ) -> None:
        self.contact = contact
        self.is_idle = True
        self.asks = False
        self.yields = False
        self._controller = controller
        self._cycles = cycles
        # By name, each with the time of the loop at which it came [s].
        self._values: dict[str, tuple[np.ndarray, Seconds]] = {}
        self._links = {'': '', BASE: controller.model.base_frame}  # by the name of a frame
        self._time = 0.0  # [s] of the loop, since it is not idle
        self._asked = -np.inf  # when motion was last asked for [s]
        self._usable = 0.0  # when there was a usable wrench last, or none was needed [s]

    @property
    def problem(self) -> str:
        """Why an arm that should yield does not; '' if it does, or should not."""
        if self._time - self._usable <= _PAUSE:  # the first wrench may be on its way
            return self.contact.warning
        return self.contact.sensor.problem

    def enter_wrench(
        self, stamp: Nanoseconds, wrench: Wrench, frame: str, time_of_day: Nanoseconds = 0
    ) -> None:
        """Record a measured wrench.

        Args:
            stamp: A time on the robot's clock or on this computer's; 0 for now.
            frame: The link along whose axes and about whose origin it is; '' is the tip, 'base' the
                base.
            time_of_day: Arrival by this computer's clock; 0: not known.

        Raises ClockError for one that is too old or stamped too far ahead, and UnknownNameError for
        a link that the arm has not.
        """
        self._check_age('wrench', stamp, time_of_day)
        if frame not in self._links:
            model = self._controller.model
            model.position(np.zeros(model.n), frame)
            self._links[frame] = '' if frame == model.arm.tip_frame else frame
        self.contact.sensor.enter(wrench, self._links[frame])

    def enter(
        self, name: str, stamp: Nanoseconds, value: np.ndarray, time_of_day: Nanoseconds = 0
    ) -> None:
        """Record a value (k,) that a preference or limit uses by this name; as enter_wrench(). A
        value that is not finite raises ArrayError.
        """
        self._check_age(name, stamp, time_of_day)
        check_finite(value, name)
        self._values[name] = value, self._time

    def _check_age(self, name: str, stamp: Nanoseconds, time_of_day: Nanoseconds) -> None:
        """Raise ClockError for a stamp too far from the robot's clock."""
        allowed = self.contact.settings.wrench_timeout
        _, problem = self._cycles.judge(stamp, time_of_day, allowed)
        if problem and self._cycles.newest:
            raise ClockError(
                f'{name}: {problem} (admittance.wrench_timeout; a zero stamp means now)'
            )
        self.is_idle = False

    def update(self, q: JointPositions, missed: Cycles, at_rest: bool) -> None:
        """Drop what is too old, and see whether the rest asks for motion; once a tick."""
        self._time += (missed + 1) * self._controller.T
        self.is_idle = False
        self.yields = self.contact.is_on
        if not self.yields:
            self.contact.sensor.advance(missed + 1)
        if not (self.yields and self.contact.sensor.problem):
            self._usable = self._time
        oldest = self._time - self.contact.settings.wrench_timeout
        self._controller.measurements = {
            name: value for name, (value, time) in self._values.items() if time >= oldest
        }
        state = self.state(q)
        asks = self.yields and self.contact.asks(state, missed, at_rest=at_rest)
        if asks or any(p.asks(state) for p in self._controller.policy.preferences):
            self._asked = self._time
        self.asks = self._time - self._asked <= _PAUSE

    def restart(self) -> None:
        """Restart from rest: nothing asks for motion."""
        if not self.asks and not self.contact.is_on:
            return
        self.contact.restart()
        self._asked = -np.inf
        self.asks = False

    def state(self, q: JointPositions) -> RobotState:
        """An arm measured at q, with these measurements."""
        rest = np.zeros(len(q))
        tick = TickContext(self._controller.measurements)
        return RobotState(self._controller.model, q, rest, rest, tick)
