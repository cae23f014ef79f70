"""A joint-space motion from rest to rest: all joints start and arrive together."""

from typing import NamedTuple

import numpy as np

from redres_ros.geometry import PEAK_ACCELERATION, PEAK_SPEED, quintic
from redres_ros.robot_model import RobotModel
from redres_ros.types import JointAccelerations, JointPositions, JointVelocities, Seconds

_SHORTEST = 0.5  # [s]
_GAIN = 10.0  # k_P of the feedback [1/s]
_TOLERANCE = 0.005  # [rad] at which the end counts as reached
_TURN = 2.0 * np.pi  # [rad]
_FRACTION = 0.25  # of the velocity and acceleration limits that an arm uses
_THERE = 0.02  # [rad] within which a joint needs no path
_MARGIN = 0.1  # [rad] between an equal angle, a turn away, and the end of the range


class JointReference(NamedTuple):
    """The reference of a joint path at one tick; finished: the end is reached."""

    dq: JointVelocities
    q_d: JointPositions
    error: JointPositions
    finished: bool
    segment: int = 0  # as of an approach by the tip

    @property
    def distance(self) -> tuple[float, str]:
        """The largest error, also in words."""
        error = float(np.abs(self.error).max())
        return error, f'a joint is {error:.3g} rad from the start of the task'


class JointPath:
    """The quintic of Eq. (36) for every joint, with feedback as in Eq. (37).

    Its duration [s] is what the slowest joint needs, so that no joint exceeds its velocity or its
    acceleration, which may be infinite. Feedback keeps to the velocities, too. `turning` joints
    have a range of more than a turn: their driver may report angles of one turn only.
    """

    def __init__(
        self,
        q_start: JointPositions,
        q_end: JointPositions,
        velocity: JointVelocities,
        acceleration: JointAccelerations,
        turning: np.ndarray | bool = False,
    ) -> None:
        self._q_start = q_start.copy()
        self._delta = q_end - q_start
        self._velocity = velocity
        self._turning = turning  # (n,), or the same for all
        distance = np.abs(self._delta)
        by_speed = PEAK_SPEED * distance / velocity  # (n,) [s]
        by_acceleration = np.sqrt(PEAK_ACCELERATION * distance / acceleration)  # (n,) [s]
        self.duration = float(max(by_speed.max(), by_acceleration.max(), _SHORTEST))

    def reference(self, q: JointPositions, t: Seconds, rate: float = 1.0) -> JointReference:
        """The reference for joints at q, at a time since the path began; `rate` is a factor on the
        velocity along the path, for a clock that is going slower.
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

    def time_left(self, t: Seconds) -> Seconds:
        return max(self.duration - t, 0.0)


def path_to(model: RobotModel, q: JointPositions, q_end: JointPositions) -> JointPath | None:
    """The motion from q to q_end at a fraction of the arm's limits; None if every joint is there. A
    joint with a range of more than a turn goes to the nearest equal angle within its range.
    """
    turning = model.q_max - model.q_min > _TURN
    nearest = q_end + _whole_turns(q - q_end, turning)
    is_allowed = (nearest >= model.q_min + _MARGIN) & (nearest <= model.q_max - _MARGIN)
    q_end = np.where(is_allowed, nearest, q_end)
    if np.abs(q_end - q).max() < _THERE:
        return None
    acceleration = np.array(model.arm.acceleration_limit or (np.inf,) * model.n)
    return JointPath(q, q_end, _FRACTION * model.dq_max, _FRACTION * acceleration, turning)


def _whole_turns(angle: JointPositions, turning: np.ndarray | bool) -> JointPositions:
    """The whole turns in each angle of a turning joint, 0 for the others."""
    return np.where(turning, _TURN * np.round(angle / _TURN), 0.0)
