"""What an arm does before it follows the input: it goes to where it was measured, or takes a small
step that shows whether the robot executes commands.
"""

import numpy as np

from redres_ros.controller import Controller
from redres_ros.kernels.boxes import stopping_speed

_SPEED = 0.1  # fraction of the joints' speed limits
_ACCELERATION = 1.0  # [rad/s^2] at most
_ARRIVED = 1e-6  # [rad]
_STEP = 0.4  # of A T^2
_SEEN = 0.3  # of that step
_RESPONSE = 0.2  # [s] in which an arm has to respond


class Approach:
    """Joint velocities straight to a configuration, through all limits of the controller.

    Args:
        controller: Follows joint velocities until the approach is over.
        target: Where the arm is, (n,) [rad].
    """

    def __init__(self, controller: Controller, target: np.ndarray) -> None:
        self._controller = controller
        self._V = _SPEED * controller.model.dq_max  # (n,) [rad/s]
        self._target = target
        controller.follow_joints(True)

    def is_over(self, q: np.ndarray) -> bool:
        """Whether other motion may begin, with the arm at q (n,) [rad]."""
        return float(np.abs(self._target - self._controller.reference).max()) <= _ARRIVED

    def velocity(self) -> np.ndarray:
        """The velocity from which all joints can stop at their targets, (n,) [rad/s]."""
        rest = self._target - self._controller.reference
        allowed = [
            min(stopping_speed(abs(d), _ACCELERATION, self._controller.T), V)
            for d, V in zip(rest.tolist(), self._V.tolist(), strict=True)
        ]
        return rest * float(np.min(allowed / np.maximum(np.abs(rest), _ARRIVED)))


class Probe(Approach):
    """A step so small that a robot may execute it at once, which shows whether it does.

    Args:
        controller: Follows joint velocities until the probe is over.
        q: Where the arm is, (n,) [rad].
    """

    def __init__(self, controller: Controller, q: np.ndarray) -> None:
        A = np.array(controller.model.arm.acceleration_limit or (_ACCELERATION,) * len(q))
        middle = (controller.model.q_min + controller.model.q_max) / 2.0
        step = np.copysign(_STEP * A * controller.T**2, np.nan_to_num(middle) - q)  # (n,) [rad]
        super().__init__(controller, q + step)
        self._q = q
        self._step = np.abs(step)
        self._left = _RESPONSE  # [s]

    def is_over(self, q: np.ndarray) -> bool:
        self._left -= self._controller.T
        return bool((np.abs(q - self._q) > _SEEN * self._step).any())

    @property
    def has_failed(self) -> bool:
        """Whether the arm has not moved."""
        return self._left <= 0.0
