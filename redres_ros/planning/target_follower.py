"""Follows a target that changes while the tip moves, as a policy or a hand streams it."""

from functools import partial
from typing import Any

import numpy as np

from redres_ros.kernels.tick import rotation_error
from redres_ros.planning.planner import LEVER, Reference, ReferenceSource, limited
from redres_ros.planning.waypoints import WaypointTask
from redres_ros.rotation import rotation_matrix

_GAIN = 3.0  # [1/s] speed for a distance near the target
_DAMPING = 4.0  # times the gain: both poles are at -2 gain


class TargetFollower(ReferenceSource):
    """A point mass that is drawn to the target, with limited speed and acceleration.

    Nothing of it jumps with the target: a new one changes the acceleration alone. From rest it
    takes a straight line; near the target it is a critically damped spring.

    Args:
        task: Task with the feedback gain and the tolerances.
        x: Where the tip is, (3,) [m].
        R: Its orientation, (3, 3); None for the position alone.
        dx: The task velocity with which it goes on, (3,) or (6,) [m/s], [rad/s].
        t: Time of the task now [s].
        speed: Largest one [m/s]; of a turn ten times as many [rad/s].
        acceleration: Largest one [m/s^2]; of a turn ten times as many [rad/s^2].
        feedback_limit: Largest speed that the feedback may add [m/s], [rad/s].
    """

    def __init__(
        self,
        task: WaypointTask,
        x: np.ndarray,
        R: np.ndarray | None,
        dx: np.ndarray,
        t: float = 0.0,
        *,
        speed: float,
        acceleration: float,
        feedback_limit: float,
    ) -> None:
        self._task = task
        self._speed = speed
        self._acceleration = acceleration
        self._feedback = partial(limited, task.feedback_gain, feedback_limit)
        self._x = x
        self._R = R
        self._v = dx[:3]
        self._w = dx[3:]
        self._t = t
        self.set_target(x, R)

    def set_target(self, x: np.ndarray, R: np.ndarray | None) -> None:
        """Go to another pose from here on.

        Args:
            x: Position, (3,) [m].
            R: Orientation, (3, 3); None for the position alone.
        """
        self._x_end = x
        self._R_end = R
        self._whole = max(self.time_left(self._t), 1e-9)  # [s]

    def reference(
        self, x: np.ndarray, t: float, R: np.ndarray | None = None, *, rate: float = 1.0, **_: Any
    ) -> Reference:
        """The reference at this time; arguments as of ReferenceSource.reference().

        What is unachieved is not looked at: only the target itself ends the motion.
        """
        dt = max(t - self._t, 0.0)
        self._t = t
        self._v = self._next_velocity(self._x_end - self._x, self._v, dt, 1.0)
        self._x = self._x + dt * self._v
        error = self._x - x
        dx = rate * self._v + self._feedback(error)  # Eq. (37)
        is_there = _is_short(self._x_end - x, self._task.tolerance)
        if R is None or self._R is None or self._R_end is None:
            return Reference(dx, self._x, error, 1, is_there)
        turn = rotation_error(self._R, self._R_end)
        self._w = self._next_velocity(turn, self._w, dt, 1.0 / LEVER)
        self._R = rotation_matrix(dt * self._w).dot(self._R)
        turn_left = rotation_error(R, self._R)
        twist = np.concatenate((dx, rate * self._w + self._feedback(turn_left)))
        is_there &= _is_short(rotation_error(R, self._R_end), self._task.orientation_tolerance)
        return Reference(twist, self._x, error, 1, is_there, self._R, turn_left)

    def time_left(self, t: float) -> float:
        """About how long the motion still takes, whatever the time t [s]; 0 beside the target."""
        distance = float(np.linalg.norm(self._x_end - self._x))
        if self._R is not None and self._R_end is not None:
            angle = float(np.linalg.norm(rotation_error(self._R, self._R_end)))
            distance = max(distance, LEVER * angle)
        return distance / self._speed if distance > self._task.tolerance else 0.0

    @property
    def duration(self) -> float:
        """About how long the motion to the newest target takes [s]."""
        return self._whole

    def elapsed(self, t: float) -> float:
        """How much of the duration is over at a time t of the task [s]."""
        return max(self._whole - self.time_left(t), 0.0)

    def _next_velocity(
        self, offset: np.ndarray, v: np.ndarray, dt: float, scale: float
    ) -> np.ndarray:
        """The velocity after dt [s], (3,), from v (3,) at an offset (3,) from the target; scale is
        of speed and acceleration: 1 for lengths, 1 / LEVER for turns.
        """
        distance = float(np.linalg.norm(offset))
        acceleration = scale * self._acceleration
        braking = np.sqrt(acceleration * distance)  # with half of the acceleration
        speed = min(_GAIN * distance, braking, scale * self._speed)
        wanted = offset * (speed / distance) if distance > 0.0 else np.zeros(3)
        change = min(_DAMPING * _GAIN * dt, 1.0) * (wanted - v)
        excess = float(np.linalg.norm(change)) / max(acceleration * dt, 1e-12)
        return v + change / max(excess, 1.0)


def _is_short(error: np.ndarray, tolerance: float) -> bool:
    return float(np.linalg.norm(error)) < tolerance
