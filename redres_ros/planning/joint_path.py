"""A joint-space motion from rest to rest: all joints start and arrive together."""

from dataclasses import dataclass

import numpy as np

from redres_ros.interpolation import PEAK_ACCELERATION, PEAK_SPEED, quintic
from redres_ros.robot_model import RobotModel

_SHORTEST = 0.5  # [s]
_GAIN = 10.0  # k_P of the feedback [1/s]
_TOLERANCE = 0.005  # [rad] at which the end counts as reached
_TURN = 2.0 * np.pi  # [rad]
_MARGIN = 0.1  # [rad] between an equal angle, a turn away, and the end of the range


@dataclass(frozen=True)
class JointReference:
    """The reference of a joint path at one tick.

    Attributes:
        dq: Joint velocity, (n,) [rad/s].
        q_d: Desired joint positions, (n,) [rad].
        error: q_d - q, (n,) [rad].
        finished: The end is reached.
    """

    dq: np.ndarray
    q_d: np.ndarray
    error: np.ndarray
    finished: bool


class JointPath:
    """The quintic of Eq. (36) from q_start to q_end for every joint, with feedback as in Eq. (37).

    It takes as long as the slowest joint needs, so that no joint exceeds its velocity or its
    acceleration on a path that is followed exactly.
    """

    def __init__(
        self,
        q_start: np.ndarray,
        q_end: np.ndarray,
        velocity: np.ndarray,
        acceleration: np.ndarray,
        *,
        turning: np.ndarray | None = None,
    ) -> None:
        """A path, at its start.

        Args:
            q_start: (n,) [rad].
            q_end: (n,) [rad].
            velocity: Largest one of each joint, (n,) [rad/s]; feedback keeps to it, too.
            acceleration: Largest one of each joint, (n,) [rad/s^2]; infinite for no limit.
            turning: Whether each joint has a range of more than a turn, (n,), so that its driver
                may report angles of one turn only; None: no joint has.
        """
        self._q_start = q_start.copy()
        self._delta = q_end - q_start
        self._velocity = velocity
        self._turning = np.zeros(len(q_start), bool) if turning is None else turning
        distance = np.abs(self._delta)
        by_speed = PEAK_SPEED * distance / velocity  # (n,) [s]
        by_acceleration = np.sqrt(PEAK_ACCELERATION * distance / acceleration)  # (n,) [s]
        self.duration = float(max(by_speed.max(), by_acceleration.max(), _SHORTEST))  # [s]

    def reference(self, q: np.ndarray, t: float, rate: float = 1.0) -> JointReference:
        """The reference at this time.

        Args:
            q: (n,) where the joints are [rad].
            t: Time since the path began [s]; it advances by s T if limits leave the fraction s.
            rate: Factor on the velocity along the path while the clock goes slower.
        """
        s, ds = quintic(t / self.duration)
        q_d = self._q_start + s * self._delta  # Eq. (36)
        error = q_d - q
        error = error - _whole_turns(error, self._turning)
        feedback = _GAIN * error  # Eq. (37)
        excess = float((np.abs(feedback) / self._velocity).max())
        dq = self._delta * (rate * ds / self.duration) + feedback / max(excess, 1.0)
        is_there = float(np.abs(error).max()) < _TOLERANCE
        return JointReference(dq, q_d, error, t >= self.duration and is_there)


def path_to(
    model: RobotModel, q: np.ndarray, q_end: np.ndarray, fraction: float, tolerance: float
) -> JointPath | None:
    """The joint-space motion of an arm to given positions; None if it is there.

    A joint with a range of more than a turn goes to the nearest equal angle within its range.

    Args:
        model: The arm.
        q: Where the joints are, (n,) [rad].
        q_end: Where they are to go, (n,) [rad].
        fraction: Fraction of the arm's velocity and acceleration limits that the motion uses.
        tolerance: Distance of each joint below which the arm is there [rad].
    """
    turning = model.q_max - model.q_min > _TURN
    nearest = q_end + _whole_turns(q - q_end, turning)
    is_allowed = (nearest >= model.q_min + _MARGIN) & (nearest <= model.q_max - _MARGIN)
    q_end = np.where(is_allowed, nearest, q_end)
    if np.abs(q_end - q).max() < tolerance:
        return None
    acceleration = np.array(model.arm.acceleration_limit or (np.inf,) * model.n)
    return JointPath(q, q_end, fraction * model.dq_max, fraction * acceleration, turning=turning)


def _whole_turns(angle: np.ndarray, turning: np.ndarray) -> np.ndarray:
    """The whole turns in each angle (n,) [rad] of a turning joint, 0 for the others."""
    return np.where(turning, _TURN * np.round(angle / _TURN), 0.0)
