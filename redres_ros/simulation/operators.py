"""Operators of a teleoperated arm, for simulation: what somebody at a joystick asks for.

Both are seeded, know the pose of the tip and nothing of the joints, and move the joystick smoothly.
"""

from abc import ABC, abstractmethod
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from redres_ros.kernels.tick import rotation_error
from redres_ros.planning.waypoints import WaypointTask
from redres_ros.robot_model import RobotModel
from redres_ros.simulation.recording import Recording

SPEED = 0.25  # [m/s], the joystick's range
TURN = 0.8  # [rad/s]
PATIENCE = 15.0  # [s] after which a goal is given up

_HAND = 0.1  # [s] time constant of the hand
_GAIN = 1.5  # [1/s] of the distance to a goal
_NEAR = 0.005  # [m] from a goal that counts as reached
_NEAR_ANGLE = 0.035  # [rad]
_INTERVAL = 2.0  # [s] between two random twists


class Operator(ABC):
    """Somebody who sends twists, sampled at regular intervals.

    Attributes:
        reached: Number of goals.
        given_up: Number of goals.

    Args:
        T: Sampling time [s].
        seed: Random seed.
    """

    def __init__(self, T: float, seed: int) -> None:
        self.T = T
        self.reached = 0  # goals
        self.given_up = 0
        self.random = np.random.default_rng(seed)
        self._twist = np.zeros(6)

    def twist(self, t: float, x: np.ndarray, R: np.ndarray) -> np.ndarray:
        """The twist that is sent, (6,) [m/s], [rad/s].

        Args:
            t: Time [s], T later in every call.
            x: Position of the tip, (3,) [m].
            R: Its orientation, (3, 3).
        """
        intended = self.intended(t, x, R)
        self._twist = self._twist + min(self.T / _HAND, 1.0) * (intended - self._twist)
        return self._twist

    @abstractmethod
    def intended(self, t: float, x: np.ndarray, R: np.ndarray) -> np.ndarray:
        """The twist towards which the hand moves, (6,) [m/s], [rad/s].

        Args:
            t: See twist().
            x: See twist().
            R: See twist().
        """


class BlindOperator(Operator):
    """One who does not look: another random twist every two seconds.

    Args:
        T: See Operator.
        seed: See Operator.
    """

    def __init__(self, T: float, seed: int) -> None:
        super().__init__(T, seed)
        self._until = 0.0  # [s]
        self._intended = np.zeros(6)

    def intended(self, t: float, x: np.ndarray, R: np.ndarray) -> np.ndarray:
        if t >= self._until:
            self._until = t + _INTERVAL
            half = 0.5 * self.random.normal(size=6)
            self._intended = _within_range(np.repeat((SPEED, TURN), 3) * half)
        return self._intended


class TipGoal(NamedTuple):
    """A pose of the tip.

    Attributes:
        x: Position, (3,) [m].
        R: Orientation, (3, 3); None if only the position counts.
    """

    x: np.ndarray
    R: np.ndarray | None


class GoalOperator(Operator):
    """One who steers the tip in straight lines to goals within reach, alternately positions and
    poses, and gives up after PATIENCE.

    Attributes:
        goal: The present one.

    Args:
        model: The arm, whose random postures are the goals.
        T: Sampling time [s].
        seed: Seed of the goals.
    """

    def __init__(self, model: RobotModel, T: float, seed: int) -> None:
        super().__init__(T, seed)
        self._model = model
        self._until = PATIENCE
        self.goal = self._next_goal()

    def intended(self, t: float, x: np.ndarray, R: np.ndarray) -> np.ndarray:
        distance, angle = self._error(x, R)
        if np.linalg.norm(distance) < _NEAR and np.linalg.norm(angle) < _NEAR_ANGLE:
            self.reached += 1
        elif t >= self._until:
            self.given_up += 1
        else:
            return _within_range(_GAIN * np.concatenate((distance, angle)))
        self.goal = self._next_goal()
        self._until = t + PATIENCE
        return _within_range(_GAIN * np.concatenate(self._error(x, R)))

    def _error(self, x: np.ndarray, R: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Distance (3,) [m] and rotation vector (3,) [rad] to the goal."""
        goal = self.goal
        angle = np.zeros(3) if goal.R is None else rotation_error(R, goal.R)
        return goal.x - x, angle

    def _next_goal(self) -> TipGoal:
        """The pose of a random posture above the base plane; in every second only the position."""
        model = self._model
        number = self.reached + self.given_up
        while True:
            lower = np.maximum(model.q_min, -np.pi)
            x, R = model.tip(self.random.uniform(lower, np.minimum(model.q_max, np.pi)))
            if x[2] > 0.0:
                return TipGoal(x, R if number % 2 else None)


def task_of_goals(recording: Recording, task: WaypointTask) -> WaypointTask:
    """A task that passes the goals of a recording, each of which is a segment of it.

    Args:
        recording: Recording of an arm under a GoalOperator.
        task: Has the robot and the start.
    """
    x_d = recording.vectors('x_d')
    segment = recording['segment']
    goals = [np.median(x_d[segment == number], axis=0) for number in np.unique(segment)]
    points = np.array([*recording.vectors('x')[:1], *goals]).reshape(-1, 3)
    return replace(task, waypoints=points, orientations=None)


def _within_range(twist: np.ndarray) -> np.ndarray:
    """A twist (6,), its components shortened to the joystick's range."""
    v = twist[:3]
    w = twist[3:]
    faster = max(float(np.linalg.norm(v)) / SPEED, 1.0)
    turning = max(float(np.linalg.norm(w)) / TURN, 1.0)
    return np.concatenate((v / faster, w / turning))
