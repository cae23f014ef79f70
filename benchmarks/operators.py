"""Operators of a teleoperated arm, simulated: what somebody at a joystick commands.

They are seeded, know the pose of the end effector and nothing of the joints, and move the joystick
smoothly.
"""

from abc import ABC, abstractmethod

import numpy as np
import pinocchio as pin

from redres_ros import RobotModel

SPEED = 0.25  # [m/s], the joystick's range
TURN = 0.8  # [rad/s]
PATIENCE = 15.0  # [s] after which a goal is given up
HAND = 0.1  # [s] time constant of the hand
GAIN = 1.5  # [1/s] of the distance to a goal
NEAR = 0.005  # [m] from a goal that counts as reached
NEAR_ANGLE = 0.035  # [rad]
INTERVAL = 2.0  # [s] between two random twists


class Operator(ABC):
    """Somebody who sends a twist every T seconds, and counts the goals reached and given up."""

    def __init__(self, T: float, seed: int) -> None:
        self.T = T
        self.reached = 0
        self.given_up = 0
        self.random = np.random.default_rng(seed)
        self._twist = np.zeros(6)

    def twist(self, t: float, x: np.ndarray, R: np.ndarray) -> np.ndarray:
        """The twist (6,) [m/s], [rad/s] at t [s], with the end effector at x (3,) and R (3, 3)."""
        intended = self.intended(t, x, R)
        self._twist = self._twist + min(self.T / HAND, 1.0) * (intended - self._twist)
        return self._twist

    @abstractmethod
    def intended(self, t: float, x: np.ndarray, R: np.ndarray) -> np.ndarray:
        """The twist towards which the hand moves; see twist()."""


class BlindOperator(Operator):
    """Another random twist every two seconds; if translates, without rotation."""

    def __init__(self, T: float, seed: int, *, translates: bool = False) -> None:
        super().__init__(T, seed)
        self._turn = 0.0 if translates else TURN  # [rad/s]
        self._until = 0.0  # [s]
        self._intended = np.zeros(6)

    def intended(self, t: float, x: np.ndarray, R: np.ndarray) -> np.ndarray:
        if t >= self._until:
            self._until = t + INTERVAL
            half = 0.5 * self.random.normal(size=6)
            self._intended = within_range(np.repeat((SPEED, self._turn), 3) * half)
        return self._intended


class GoalOperator(Operator):
    """Moves in straight lines to poses of random postures; gives a goal up after PATIENCE.

    In every second goal, and if position_only in all of them, the orientation does not count.
    """

    def __init__(
        self, model: RobotModel, T: float, seed: int, *, position_only: bool = False
    ) -> None:
        super().__init__(T, seed)
        self._model = model
        self._position_only = position_only
        self._next_goal(0.0)

    def intended(self, t: float, x: np.ndarray, R: np.ndarray) -> np.ndarray:
        distance, angle = self._error(x, R)
        if np.linalg.norm(distance) < NEAR and np.linalg.norm(angle) < NEAR_ANGLE:
            self.reached += 1
            self._next_goal(t)
        elif t >= self._until:
            self.given_up += 1
            self._next_goal(t)
        return within_range(GAIN * np.concatenate(self._error(x, R)))

    def _error(self, x: np.ndarray, R: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Distance (3,) [m] and rotation vector (3,) [rad] to the goal."""
        has_orientation = (self.reached + self.given_up) % 2 and not self._position_only
        angle = pin.log3(self.R @ R.T) if has_orientation else np.zeros(3)
        return self.x - x, angle

    def _next_goal(self, t: float) -> None:
        """The pose of a random posture above the base plane."""
        lower = np.maximum(self._model.q_min, -np.pi)
        upper = np.minimum(self._model.q_max, np.pi)
        self._until = t + PATIENCE
        while True:
            self.x, self.R = self._model.tip(self.random.uniform(lower, upper))
            if self.x[2] > 0.0:
                return


def within_range(twist: np.ndarray) -> np.ndarray:
    """A twist (6,) whose translation and rotation are shortened to the joystick's range."""
    faster = max(float(np.linalg.norm(twist[:3])) / SPEED, 1.0)
    turning = max(float(np.linalg.norm(twist[3:])) / TURN, 1.0)
    return np.concatenate((twist[:3] / faster, twist[3:] / turning))
