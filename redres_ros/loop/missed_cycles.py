"""What the robot did in cycles in which it got no command, or two."""

import math

import numpy as np

from redres_ros.command import Published
from redres_ros.controller import Controller
from redres_ros.types import Cycles, JointPositions, Seconds

# A response that was sent so shortly before the robot published the next state came after that.
_TOGETHER = 0.001  # [s] that both transports take, of the state and of the response
_TOGETHER_FRACTION = 0.25  # of a cycle, if that is less
_INTERVAL_TIME = 2.0  # [s] after which a long interval between states counts for less


class MissedCycles:
    """Has the controller allow for cycles without a command, or with two."""

    def __init__(self, controller: Controller) -> None:
        self.sent = -math.inf  # when the newest response was on its way [s]
        self._controller = controller
        self._holds = controller.robot_interface.holds
        self._together = min(_TOGETHER, _TOGETHER_FRACTION * controller.T)  # [s]
        self._interval = 1  # cycles between two responses, at most, of late
        self._interval_cycle = 0  # when that was

    def count(self, missed: Cycles, cycle: int) -> None:
        """Allow for intervals between commands such as those before this cycle, in which a robot
        that does not hold moves on: joints must still stop in time.
        """
        if self._holds or missed + 1 == self._interval == 1:
            return
        if missed + 1 >= self._interval:
            self._interval = missed + 1
            self._interval_cycle = cycle
        elif (cycle - self._interval_cycle) * self._controller.T > _INTERVAL_TIME:
            self._interval -= 1
            self._interval_cycle = cycle
        if self._controller.gap != self._interval:
            self._controller.gap = self._interval

    def explain(self, moved: JointPositions, missed: Cycles, published: Published) -> bool:
        """Whether a robot that extrapolates has gone on by itself all the time: it still moves.

        Args:
            moved: Since the last response; a servo's lag is in both positions.
            missed: Cycles without a command.
            published: The last reference.
        """
        if self._holds:
            return False
        expected = self._controller.bridged(published, missed).q - published.q
        return float(np.abs(moved - expected).max()) <= 0.5 * float(np.abs(expected).max())

    def is_late(self, published: Seconds) -> bool:
        """Whether the last response and the next one reach a robot in the same cycle, which has
        published a state between them.

        One that holds executes only the second of them, which would be a step of two cycles.
        """
        return published - self.sent < self._together
