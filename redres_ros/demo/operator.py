"""The planner of `redres demo --teleop`: a simulated operator steers the tip in place of a task.

It publishes what a planner publishes, the operator's goals as the reference. Its task velocities
have no stamp, like those of a joystick, so the controller takes them for an operator's.
"""

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from redres_ros.kernels.tick import rotation_error
from redres_ros.nodes.parameters import declare
from redres_ros.nodes.planner import WaitingPlannerNode
from redres_ros.parameter import param
from redres_ros.planning.goals import Goal
from redres_ros.planning.planner import Reference, ReferenceSource
from redres_ros.planning.task_executor import Step
from redres_ros.simulation.operators import GoalOperator

_NOW = 0  # a stamp that means: as soon as it comes


@dataclass(frozen=True)
class _OperatorParameters:
    """Parameters of the node beside those of a planner."""

    duration: float = param(60.0, 'how long the operator steers [s]', 1.0, 1e6)
    seed: int = param(0, "of the operator's goals", 0, 1_000_000)


class SteeredPlanner(ReferenceSource):
    """An operator in the place of a path: goal after goal, for some time.

    Args:
        operator: Steers.
        duration: How long [s].
    """

    def __init__(self, operator: GoalOperator, duration: float) -> None:
        self._operator = operator
        self._duration = duration
        self._ticks = 0  # of the operator's time, which goes on where limits stop the arm

    def reference(
        self, x: np.ndarray, t: float, R: np.ndarray | None = None, **_: Any
    ) -> Reference:
        """The operator's twist, and the goal; of the arguments x and R (3, 3) matter."""
        operator = self._operator
        R = np.eye(3) if R is None else R
        dx = operator.twist(self._ticks * operator.T, x, R)
        self._ticks += 1
        finished = self._ticks >= round(self._duration / operator.T)
        goal = operator.goal
        R_d = R if goal.R is None else goal.R
        number = operator.reached + operator.given_up + 1
        if finished:
            dx = np.zeros(6)
        turn_left = rotation_error(R, R_d)
        return Reference(dx, goal.x, goal.x - x, number, finished, R_d, turn_left)

    def time_left(self, t: float) -> float:
        """How long the operator still steers [s], whatever the time t of a task."""
        return self._duration - self.elapsed(t)

    @property
    def duration(self) -> float:
        """How long the operator steers [s]."""
        return self._duration

    def elapsed(self, t: float) -> float:
        """How much of that is over [s], whatever the time t of a task."""
        return min(self._ticks * self._operator.T, self._duration)


class OperatorNode(WaitingPlannerNode):
    """A planner whose task is to let an operator steer."""

    def __init__(self) -> None:
        super().__init__()
        self._operator = declare(self, _OperatorParameters())

    def _task_goal(self) -> Goal:
        """The joints to the start, then the operator."""
        settings = self._operator

        def make_planner(x: np.ndarray, R: np.ndarray) -> SteeredPlanner:
            operator = GoalOperator(self._model, self._T, settings.seed)
            return SteeredPlanner(operator, settings.duration)

        goal = super()._task_goal()
        return replace(goal, make_planner=make_planner, duration=settings.duration)

    def _publish(self, step: Step, q: np.ndarray, R: np.ndarray) -> None:
        if step.dx is None:
            super()._publish(step, q, R)
            return
        self._twist_publisher.publish(self._twists.written(_NOW, step.dx))
        self._topics.show(step, R)
