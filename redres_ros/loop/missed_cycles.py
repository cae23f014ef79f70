"""Cycles in which the robot gets no command, or two: what it does meanwhile."""

import math

import numpy as np

from redres_ros.controller import Controller

# A response that was sent so shortly before the robot published the next state came after that.
_TOGETHER = 0.001  # [s] that both transports take, of the state and of the response
_TOGETHER_FRACTION = 0.25  # of a cycle, if that is less
_GAP_TIME = 2.0  # [s] after which a gap between states counts for less


class MissedCycles:
    """Has the controller allow for cycles without a command.

    Args:
        controller: Knows the last reference and how the robot bridges these cycles.
    """

    def __init__(self, controller: Controller) -> None:
        self.sent = -math.inf  # when the newest response was on its way [s]
        self._controller = controller
        self._together = min(_TOGETHER, _TOGETHER_FRACTION * controller.T)  # [s]
        self._gap = 1  # cycles between two responses, at most, of late
        self._gap_cycle = 0  # when that was

    def count(self, missed: int, cycle: int) -> None:
        """Have joints stop in time also if the next states get lost as the last ones did, unless
        the robot holds meanwhile.

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
        """Take the last response back if it came too late for a cycle of its own: of two in one
        cycle a robot that holds executes the second alone, and both would be a step of two cycles.

        Args:
            published: When the robot published the state after that one [s].
        """
        holds = self._controller.bridging == 'hold'
        if holds and published - self.sent < self._together:
            self._controller.correct(*self._controller.before)
