"""The velocity that a singularity blocks."""

import numpy as np

from redres_ros.kernels.closed_form import is_far
from redres_ros.laws import make_law
from redres_ros.policy import Policy
from redres_ros.robot_model import RobotModel, RobotState
from redres_ros.tasks import make_task
from redres_ros.types import JointPositions, Seconds, TaskVelocity

_AT_REST = 0.5  # [s] without progress, after which an arm at the end of its reach has come to rest


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
