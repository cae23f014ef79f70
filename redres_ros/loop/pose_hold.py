"""Feedback for what an operator does not ask for: translation alone must not turn the tip.

A velocity that is integrated drifts, and beside singularities and limits it is not executed in
full. A planner closes its own loop, an operator does not. So a component of the twist, translation
or rotation, that is zero while the other one is not holds its last commanded value.
"""

import numpy as np

from redres_ros.controller import Controller
from redres_ros.loop.twist_buffer import TwistBufferSettings
from redres_ros.robot_model import RobotState
from redres_ros.tasks import Pose

_GAIN = 2.0  # [1/s], of the error
# [m/s], [rad/s] with which the tip comes back at most; limits may have turned it by half a turn
_FASTEST = {'translation': 0.25, 'rotation': 1.0}

_NOTHING = 1e-9  # [m/s], [rad/s] that count as zero: rounding of a transformation

_COMPONENTS = {'translation': slice(0, 3), 'rotation': slice(3, 6)}


class PoseHold:
    """Adds to a twist what holds the component that it does not ask for.

    Args:
        controller: Knows the task and the last reference.
        settings: The accelerations with which that comes and goes.
    """

    def __init__(self, controller: Controller, settings: TwistBufferSettings) -> None:
        self._controller = controller
        self._steps = {
            'translation': settings.max_linear_acceleration * controller.T,
            'rotation': settings.max_angular_acceleration * controller.T,
        }
        self.clear()

    def clear(self) -> None:
        """Hold nothing."""
        self._targets: dict[str, Pose] = {}  # by component
        self._added = np.zeros(6)

    def hold(self, dx: np.ndarray, is_open_loop: bool) -> tuple[np.ndarray, np.ndarray | None]:
        """The twist (6,), and the part of it that only holds; that is None if nothing is held.

        Args:
            dx: The velocity of the task, (m,) [m/s] and [rad/s].
            is_open_loop: Whether dx is an operator's.
        """
        task = self._controller.policy.task
        if not isinstance(task, Pose) or not (is_open_loop or self._added.any()):
            self.clear()
            return dx, None
        q_ref = self._controller.reference
        state = RobotState(self._controller.model, q_ref, np.zeros(len(q_ref)))
        correction = np.zeros(6)
        for component, rows in _COMPONENTS.items():
            velocity = np.zeros(3)
            is_held = is_open_loop and _asks(dx) and not _asks(dx[rows])
            if not is_held:
                self._targets.pop(component, None)
            elif component not in self._targets:
                pose = Pose(gain=_GAIN, frame=task.frame)
                self._targets[component] = pose.with_initial_targets(state)
            else:
                velocity = self._targets[component].velocity(state)[rows]
                most = _FASTEST[component]
                velocity = velocity * min(1.0, most / max(float(np.linalg.norm(velocity)), most))
            change = velocity - self._added[rows]
            step = self._steps[component]
            self._added[rows] += change * min(1.0, step / max(float(np.linalg.norm(change)), step))
            if is_held:
                correction[rows] = self._added[rows]
        return dx + self._added, correction if correction.any() else None


def _asks(dx: np.ndarray) -> bool:
    """Whether a velocity, or a component of it, asks for motion."""
    return bool((np.abs(dx) > _NOTHING).any())
