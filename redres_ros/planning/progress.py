"""Detects a motion without progress, and the velocity that a singularity blocks."""

import numpy as np

from redres_ros.kernels.closed_form import is_far
from redres_ros.laws import make_law
from redres_ros.policy import Policy
from redres_ros.robot_model import RobotModel, RobotState
from redres_ros.tasks import make_task
from redres_ros.types import JointPositions, Seconds, TaskVelocity

_STEP = 0.05  # [s] of the segment's time that count as progress
_FRACTION = 0.9  # of the error at the end of a segment's time, below which it has become smaller
_AT_REST = 0.5  # [s] without progress, after which an arm at the end of its reach has come to rest


class ProgressMonitor:
    """Counts the time without progress, `idle`.

    While a segment's time is not over, progress is time that the path goes on. Afterwards it is an
    error that becomes smaller. The remark says why there is none; it is empty until stuck_after.
    """

    stuck_after = 5.0  # [s]
    give_up_after = 30.0  # [s]

    def __init__(self) -> None:
        self.begin()

    def begin(self) -> None:
        self.remark = ''
        self.idle: Seconds = 0.0
        self._segment = -1
        self._left = 0.0
        self._error = 0.0
        self.active_limits = ''  # that acted last, in words

    def enter(
        self, seconds: Seconds, segment: int, left: Seconds, error: float, distance: str = ''
    ) -> bool:
        """Enter the seconds since the last call and where the motion is: what is left of the
        segment's time, and how far its end is, in any unit and in words. Whether it is given up.
        """
        goes_on = left < self._left - _STEP or (left <= 0.0 < self._left)
        comes_nearer = left <= 0.0 and error < _FRACTION * self._error
        if segment != self._segment or goes_on or comes_nearer:
            self.begin()
            self._segment = segment
            self._left = left
            self._error = error
        else:
            self.idle += seconds
        is_hopeless = self.idle >= self.give_up_after
        if is_hopeless or (self.idle >= self.stuck_after and not self.remark):
            limit = self.give_up_after if is_hopeless else self.stuck_after
            where = f'{left:.3g} s of its time are left' if left > 0.0 else distance
            reasons = '; '.join(filter(None, (self.active_limits, where)))
            self.remark = f'no progress for {limit:g} s: {reasons}'
        return is_hopeless


class UnachievedVelocity:
    """The part of a task velocity that a singularity does not let through, whatever the law.

    `end_of_reach` is the smallest singular value there, relative to the largest one.
    """

    def __init__(self, model: RobotModel, task_space: str, T: Seconds, end_of_reach: float) -> None:
        self._model = model
        self._T = T
        self._end_of_reach = end_of_reach
        self._policy = Policy(make_law('minimum_velocity'), make_task(task_space))

    def __call__(
        self, q: JointPositions, asked: TaskVelocity, idle: Seconds
    ) -> TaskVelocity | None:
        """The blocked part, or None; all of it for an arm at the end of its reach that has made no
        progress for a while: there it comes to rest beside the singularity.
        """
        state = RobotState(self._model, q, np.zeros(len(q)))
        if idle > _AT_REST and not is_far(state.J[:3], self._end_of_reach):
            return asked
        return self._policy.unconstrained(state, asked, self._T).unachieved
