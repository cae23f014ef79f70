"""Holds the component of a twist, translation or rotation, that an operator does not ask for.

A velocity that is integrated drifts, and beside singularities and limits it is not executed in
full. A planner closes its own loop; an operator does not, whose translation alone must not turn the
tip. So a component that is zero while the other one is not keeps its last commanded pose.
"""

import numpy as np

from redres_ros.controller import Controller
from redres_ros.kernels.tick import largest
from redres_ros.loop.twist_buffer import ANGULAR_ACCELERATION, LINEAR_ACCELERATION
from redres_ros.robot_model import RobotState
from redres_ros.tasks import Pose
from redres_ros.types import TaskVelocity

_GAIN = 2.0  # [1/s] of the error of what is held
_NOTHING = 1e-9  # [m/s], [rad/s] that count as zero: rounding of a transformation

_COMPONENTS = {'translation': slice(0, 3), 'rotation': slice(3, 6)}
# [m/s], [rad/s] with which the tip comes back at most; limits may have turned it by half a turn
_FASTEST = {'translation': 0.25, 'rotation': 1.0}


class PoseHold:
    """Adds to a twist what holds the component that it does not ask for."""

    def __init__(self, controller: Controller) -> None:
        self._controller = controller
        self._steps = {
            'translation': LINEAR_ACCELERATION * controller.T,
            'rotation': ANGULAR_ACCELERATION * controller.T,
        }
        self.clear()

    def clear(self) -> None:
        """Hold nothing."""
        self._targets: dict[str, Pose] = {}  # by component
        self._added = np.zeros(6)

    @property
    def acts(self) -> bool:
        """Whether something is added to the twist."""
        return bool(self._targets) or largest(self._added) > 0.0

    def hold(
        self, dx: TaskVelocity, is_open_loop: bool
    ) -> tuple[TaskVelocity, TaskVelocity | None]:
        """The twist, and the part of it that only holds; that is None if nothing is held.

        Args:
            is_open_loop: Whether dx is an operator's.
        """
        task = self._controller.policy.task
        published = self._controller.published
        may_hold = is_open_loop or self.acts
        if not may_hold or not isinstance(task, Pose) or published is None:
            self.clear()
            return dx, None
        state = RobotState(self._controller.model, published.q, np.zeros(len(published.q)))
        correction = np.zeros(6)
        for component, rows in _COMPONENTS.items():
            is_held = is_open_loop and not _asks(dx[rows])
            velocity = np.zeros(3)
            if not is_held:
                self._targets.pop(component, None)
            elif not _asks(dx):
                pass  # a reversal passes through zero: what is held stays the same
            elif component not in self._targets:
                pose = Pose(gain=_GAIN, frame=task.frame)
                self._targets[component] = pose.with_initial_targets(state)
            else:
                velocity = self._targets[component].velocity(state)[rows]
                velocity = _shortened(velocity, _FASTEST[component])
            change = velocity - self._added[rows]
            self._added[rows] += _shortened(change, self._steps[component])
            if is_held:
                correction[rows] = self._added[rows]
        return dx + self._added, correction if correction.any() else None


def _asks(dx: np.ndarray) -> bool:
    """Whether a velocity, or a component of it, asks for motion."""
    return bool((np.abs(dx) > _NOTHING).any())


def _shortened(vector: np.ndarray, length: float) -> np.ndarray:
    """The vector (3,), or one of that length if it is longer."""
    return vector * min(1.0, length / max(float(np.linalg.norm(vector)), length))
