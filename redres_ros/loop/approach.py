"""An arm that is not at its reference: the joints go to where it is, before anything else."""

import numpy as np

from redres_ros.controller import Controller
from redres_ros.kernels.boxes import stopping_speed

_SPEED = 0.1  # fraction of the joints' speed limits
_ACCELERATION = 1.0  # [rad/s^2] at most
_ARRIVED = 1e-6  # [rad]


class Approach:
    """Joint velocities straight to a configuration, through all limits of the controller.

    Args:
        controller: Follows joint velocities until the approach is over.
        target: Where the arm is, (n,) [rad].
    """

    def __init__(self, controller: Controller, target: np.ndarray) -> None:
        self._T = controller.T
        self._V = _SPEED * controller.model.dq_max  # (n,) [rad/s]
        self._target = target
        controller.follow_joints(True)

    def is_over(self, q_ref: np.ndarray) -> bool:
        """Whether the reference q_ref (n,) [rad] is there."""
        return float(np.abs(self._target - q_ref).max()) <= _ARRIVED

    def velocity(self, q_ref: np.ndarray) -> np.ndarray:
        """The velocity from which all joints can stop at their targets, (n,) [rad/s].

        Args:
            q_ref: The last reference, (n,) [rad].
        """
        rest = self._target - q_ref
        allowed = [
            min(stopping_speed(abs(d), _ACCELERATION, self._T), V)
            for d, V in zip(rest.tolist(), self._V.tolist(), strict=True)
        ]
        return rest * float(np.min(allowed / np.maximum(np.abs(rest), _ARRIVED)))
