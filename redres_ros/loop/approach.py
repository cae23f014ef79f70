"""Where an arm that is held stands, and the way to it."""

import numpy as np

from redres_ros.controller import Controller
from redres_ros.kernels.boxes import stopping_speed
from redres_ros.kernels.tick import largest
from redres_ros.types import JointPositions, JointVelocities, Seconds

ARRIVED = 1e-6  # [rad] from its end, at which an approach is over

_SPEED = 0.1  # of an approach, as a fraction of the joints' speed limits
_ACCELERATION = 1.0  # [rad/s^2] at most
_STILL = 5e-4  # [rad] that an arm at rest moves at most
_REST = 0.1  # [s] for which it has not moved further
_SERVO = 5e-3  # [rad] of a servo's error at rest


class HeldReference:
    """Keeps the reference of an arm at rest where the arm is, also if others have moved it.

    While the arm is elsewhere, nothing may be published: a robot that holds stays as it is, and one
    that begins to listen does not leap. The reference is placed where the arm comes to rest. If the
    arm then goes on by as much, it follows: it sags, which is explained from then on, as it would
    sink for ever. So is what is left of a servo's lag.
    """

    def __init__(self, controller: Controller) -> None:
        self._controller = controller
        self.begin(np.zeros(controller.model.n))

    def begin(self, q: JointPositions, *, followed: bool = False) -> None:
        """The reference is held from now on; `followed`: by an arm that has followed it."""
        self._servo = np.zeros(len(q))  # its error, (n,) [rad]
        self._stood = q
        self._still = 0.0  # [s] for which it has stood there
        # That of an arm that follows, once it is at rest, (n,) [rad]; None: whatever is measured.
        self._expected = None if followed else self._servo

    def is_left(self, q: JointPositions) -> bool:
        """Whether an arm at rest at q is elsewhere than its servo explains."""
        return largest(q - self._controller.reference - self._servo) > _SERVO

    def update(self, q: JointPositions, seconds: Seconds) -> bool:
        """Whether the reference of an arm measured at q may be published."""
        controller = self._controller
        if largest(q - self._stood) > _STILL:
            self._stood = q
            self._still = 0.0
        self._still += seconds
        error = q - controller.reference - self._servo
        away = largest(error)
        expected = self._expected
        if self._still < _REST:
            return expected is None or away <= _SERVO
        self._expected = np.zeros(len(q))
        if expected is None or largest(error - expected) <= min(_SERVO, away / 2):
            self._servo = self._servo + error
        elif away > _SERVO:
            controller.hold_at(q - self._servo)
            self._expected = error
            self._still = 0.0
        return True


def approach_velocity(controller: Controller, q: JointPositions) -> JointVelocities:
    """The velocity of the reference to q, from which all joints can stop there."""
    rest = q - controller.reference
    allowed = [
        min(stopping_speed(abs(d), _ACCELERATION, controller.T), V)
        for d, V in zip(rest.tolist(), controller.model.dq_max * _SPEED, strict=True)
    ]
    return rest * float(np.min(allowed / np.maximum(np.abs(rest), ARRIVED)))
