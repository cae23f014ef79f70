"""Holds the component of a twist, translation or rotation, that an operator does not ask for.

A velocity that is integrated drifts, and beside singularities and limits it is not executed in
full. A planner closes its own loop; an operator does not, whose translation alone must not turn the
tip. So a component that is zero while the other one is not keeps its last commanded pose.
"""

import numpy as np

from redres_ros.controller import Controller
from redres_ros.kernels.tick import largest
from redres_ros.loop.velocity_input import ANGULAR_ACCELERATION, LINEAR_ACCELERATION
from redres_ros.robot_model import RobotState
from redres_ros.tasks import Pose
from redres_ros.types import TaskVelocity

_GAIN = 2.0  # [1/s] of the error of what is held
_NOTHING = 1e-9  # [m/s], [rad/s] that count as zero: rounding of a transformation

# Rows of each component; the velocity with which the tip comes back at most, because limits may
# have turned it by half a turn; and the acceleration.
_COMPONENTS = (
    (slice(0, 3), 0.25, LINEAR_ACCELERATION),  # [m/s], [m/s^2]
    (slice(3, 6), 1.0, ANGULAR_ACCELERATION),  # [rad/s], [rad/s^2]
)


class PoseHold:
    """Adds to a twist what holds the component that it does not ask for."""

    def __init__(self, controller: Controller) -> None:
        self._controller = controller
        self.clear()

    def clear(self) -> None:
        self._targets: dict[int, Pose] = {}  # by component
        self._added = np.zeros(6)

    def hold(
        self, dx: TaskVelocity, *, is_open_loop: bool
    ) -> tuple[TaskVelocity, TaskVelocity | None]:
        """The twist, and the part of it that only holds; that is None if nothing is held.

        Args:
            is_open_loop: Whether dx is an operator's.
        """
        controller = self._controller
        task = controller.policy.task
        acts = is_open_loop or self._targets or largest(self._added) > 0.0
        if not acts or not isinstance(task, Pose) or controller.published is None:
            self.clear()
            return dx, None
        q = controller.published.q
        state = RobotState(controller.model, q, np.zeros(len(q)))
        correction = np.zeros(6)
        for component, (rows, fastest, acceleration) in enumerate(_COMPONENTS):
            is_held = is_open_loop and not _asks(dx[rows])
            velocity = np.zeros(3)
            if not is_held:
                self._targets.pop(component, None)
            elif _asks(dx):  # a reversal passes through zero: what is held stays the same
                if component not in self._targets:
                    pose = Pose(gain=_GAIN, frame=task.frame)
                    self._targets[component] = pose.with_initial_targets(state)
                velocity = self._targets[component].velocity(state)[rows]
            change = _shortened(velocity, fastest) - self._added[rows]
            self._added[rows] += _shortened(change, acceleration * controller.T)
            if is_held:
                correction[rows] = self._added[rows]
        return dx + self._added, correction if correction.any() else None


def _asks(dx: np.ndarray) -> bool:
    """Whether a velocity, or a component of it, asks for motion."""
    return bool((np.abs(dx) > _NOTHING).any())


def _shortened(vector: np.ndarray, length: float) -> np.ndarray:
    """The vector (3,), or one of that length if it is longer."""
    return vector * min(1.0, length / max(float(np.linalg.norm(vector)), length))
