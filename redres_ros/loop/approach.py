"""Joint velocities straight to where an arm was measured, or a step that shows whether it moves."""

import math

import numpy as np

from redres_ros.controller import Controller
from redres_ros.kernels.boxes import stopping_speed
from redres_ros.types import JointPositions, JointVelocities

_SPEED = 0.1  # of an approach, as a fraction of the joints' speed limits
_ACCELERATION = 1.0  # [rad/s^2] at most
_ARRIVED = 1e-6  # [rad]
_STEP = 0.4  # of A T^2, which a robot may execute at once
_SEEN = 0.3  # of that step
_RESPONSE = 0.2  # [s] in which an arm has to respond


class Approach:
    """Velocities to a configuration, through all limits of the controller, which follows them.

    Args:
        q: Where the arm is.
        is_probe: Take a step instead, so small that the robot may execute it at once, and which
            shows whether it executes commands.
    """

    def __init__(self, controller: Controller, q: JointPositions, *, is_probe: bool) -> None:
        self.is_probe = is_probe
        self.left = _RESPONSE if is_probe else math.inf  # time to move or arrive [s]
        self._controller = controller
        self._q = q
        self._target = q
        if is_probe:
            model = controller.model
            A = np.array(model.arm.acceleration_limit or (_ACCELERATION,) * model.n)
            middle = np.nan_to_num((model.q_min + model.q_max) / 2.0)
            self._target = q + np.copysign(_STEP * A * controller.T**2, middle - q)
        controller.follow_joints(True)

    def is_over(self, q: JointPositions) -> bool:
        """Whether the input may be followed a cycle later, with the arm measured at q."""
        self.left -= self._controller.T
        if self.is_probe:
            return bool((np.abs(q - self._q) > _SEEN * np.abs(self._target - self._q)).any())
        return float(np.abs(self._target - self._controller.reference).max()) <= _ARRIVED

    def velocity(self) -> JointVelocities:
        """The velocity from which all joints can stop at their targets."""
        rest = self._target - self._controller.reference
        T = self._controller.T
        allowed = [
            min(stopping_speed(abs(d), _ACCELERATION, T), V)
            for d, V in zip(rest.tolist(), self._controller.model.dq_max * _SPEED, strict=True)
        ]
        return rest * float(np.min(allowed / np.maximum(np.abs(rest), _ARRIVED)))
