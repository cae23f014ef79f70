"""What leads the tip: along the points of a task in quintic segments (36) with feedback (37), or to
a target that changes while the tip moves. For the position alone or together with the orientation.
"""

import math
from copy import copy
from functools import partial
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from redres_ros.geometry import quintic, quintics, rotation_matrix
from redres_ros.kernels.tick import rotation_error
from redres_ros.planning.waypoints import WaypointTask
from redres_ros.preview import Preview
from redres_ros.types import (
    Meters,
    Position,
    Rotation,
    RotationVector,
    Seconds,
    TaskVelocity,
    Velocity,
)

_LEVER = 0.1  # [m] on which a turn is compared with a length
_START_TOLERANCE = 0.005  # [m] from x_0, at which a task begins without an approach
_ROUNDING = 1e-9  # [s] of the time of a segment
PREVIEW_STEP = 0.05  # [s] between the poses of a preview

# A target that changes
_ACCELERATION = 1.0  # [m/s^2]
_GAIN = 3.0  # [1/s] speed for a distance near a target
_DAMPING = 4.0  # times the gain: both poles are at -2 gain


class Reference(NamedTuple):
    """The reference at one tick: task velocity, desired position, and error x_d - x.

    The segment is 1 to x_1 and so on, 0 on an approach to x_0; finished: the last point is reached
    and held. Desired orientation and the turn that is left are None for a position alone.
    """

    dx: TaskVelocity
    x_d: Position
    error: Position
    segment: int
    finished: bool
    R_d: Rotation | None = None
    orientation_error: RotationVector | None = None

    @property
    def distance(self) -> tuple[float, str]:
        """From the next point, also in words; a turn counts by its arc on a lever."""
        words = f'{np.linalg.norm(self.error):.3g} m from the next point'
        if self.orientation_error is not None:
            angle = np.linalg.norm(self.orientation_error)
            words = f'turned by {angle:.3g} rad, and {words}'
        return pose_distance(self.error, self.orientation_error), f'the tip is {words}'


class Planner:
    """Passes a task's points, one segment after the other, and then holds the last one.

    The next segment begins at the first tick at which this one is over; WaypointTask says when that
    is. A point that can be reached no better, because of what is unachieved, does not keep a
    segment from ending; the last point must still be reached.

    A tip that starts farther than 5 mm from x_0 has a first segment of its own to there, no faster
    than the fastest one of the task. A task without orientations holds the first one.

    Args:
        feedback_limit: Largest speed that the feedback may add [m/s], and [rad/s] for the
            orientation. Errors that need more come from an interruption, and a jump in velocity
            would be the response to them.
    """

    def __init__(
        self,
        task: WaypointTask,
        x_start: Position | None = None,
        R_start: Rotation | None = None,
        *,
        feedback_limit: float = np.inf,
    ) -> None:
        self._task = task
        self._feedback = partial(_feedback, task.feedback_gain, feedback_limit)
        # The first segment leads from where the tip is to x_0.
        x = task.waypoints[0] if x_start is None else x_start
        self._points = np.vstack((x, task.waypoints))  # (N + 2, 3)
        self._turns: np.ndarray | None = None  # (N + 2, 3, 3), None until one is known
        if task.orientations is not None:
            R = task.orientations[0] if R_start is None else R_start
            self._turns = np.concatenate((R[None], task.orientations))
        approach, *sizes = map(self._size, range(task.segments + 1))  # [m]
        time = 0.0
        if approach > _START_TOLERANCE:
            time = task.segment_time * max(approach / (max(sizes) or approach), 1.0)
        self._times = [time] + [task.segment_time] * task.segments  # [s]
        self._segment = 0 if time else 1
        self._t_segment = 0.0  # [s] at which it began
        self._finished = False

    def reference(
        self,
        x: Position,
        t: Seconds,
        R: Rotation | None = None,
        *,
        unachieved: TaskVelocity | None = None,
        rate: float = 1.0,
    ) -> Reference:
        """The reference for a tip at x and R, without R for the position alone.

        Args:
            t: Time of the task since it began; it never goes back. Where the arm executes the
                fraction s of the velocity, it advances by s T.
            unachieved: The part of the last dx that a singularity blocks.
            rate: Factor on the velocity along the path, for a clock that is going slower.
        """
        if self._turns is None and R is not None:
            self._turns = np.tile(R, (len(self._points), 1, 1))
        while not self._finished and self._is_over(x, t, R, unachieved):
            self._t_segment = t
            if self._segment < self._task.segments:
                self._segment += 1
            else:
                self._finished = True
        start = self._segment
        T_AB = self._times[start]
        s, ds = (1.0, 0.0) if self._finished else quintic((t - self._t_segment) / T_AB)
        ds *= rate / T_AB  # [1/s]
        end = self._points[start + 1]
        line = end - self._points[start]
        x_d = self._points[start] + line * s if s < 1.0 else end.copy()  # Eq. (36)
        error = x_d - x
        dx = self._feedback(error) + line * ds  # Eq. (37)
        if R is None or self._turns is None:
            return Reference(dx, x_d, error, start, self._finished)
        A = self._turns[start]
        B = self._turns[start + 1]
        turn = rotation_error(A, B)
        R_d = rotation_matrix(s * turn).dot(A) if s < 1.0 else B.copy()
        turn_left = rotation_error(R, R_d)
        w = turn * ds + self._feedback(turn_left)  # Eq. (36), (37)
        twist = np.concatenate((dx, w))
        return Reference(twist, x_d, error, start, self._finished, R_d, turn_left)

    def preview(
        self, t: Seconds, seconds: Seconds, rate: float = 1.0, step: Seconds = PREVIEW_STEP
    ) -> Preview:
        """The path of the next seconds, for a clock that advances at a rate."""
        times = np.arange(0.0, seconds + step, step)
        starts = self._t_segment + np.cumsum([0.0, *self._times[self._segment : -1]])
        at = t + rate * times
        segments = np.maximum(np.searchsorted(starts, at, side='right') - 1, 0)
        s = quintics((at - starts[segments]) / np.array(self._times[self._segment :])[segments])
        segments += self._segment
        if self._finished:
            s[:] = 1.0
        start = self._points[segments]
        positions = start + s[:, None] * (self._points[segments + 1] - start)
        if self._turns is None:
            return Preview(times, positions)
        turns = [rotation_error(A, B) for A, B in pairwise(self._turns)]
        rotations = [
            rotation_matrix(s[k] * turns[j]).dot(self._turns[j]) for k, j in enumerate(segments)
        ]
        return Preview(times, positions, np.array(rotations))

    def time_left(self, t: Seconds) -> Seconds:
        """Time left of the current segment; 0 once it is overdue."""
        left = self._t_segment + self._times[self._segment] - t
        return left if left > _ROUNDING else 0.0

    def progress(self, t: Seconds) -> float:
        """The fraction of the nominal duration that is over, before the last point is reached."""
        elapsed = sum(self._times[: self._segment + 1]) - self.time_left(t)
        return elapsed / sum(self._times)

    def _is_over(
        self, x: Position, t: Seconds, R: Rotation | None, unachieved: TaskVelocity | None
    ) -> bool:
        is_early = self.time_left(t) > 0.0
        if (is_early and self._task.switching == 'at_rest') or t <= self._t_segment:
            return False
        end = self._segment + 1
        errors = [self._points[end] - x]
        tolerances = [self._task.tolerance]
        if R is not None and self._turns is not None:
            errors.append(rotation_error(R, self._turns[end]))
            tolerances.append(self._task.orientation_tolerance)
        is_last = self._segment == self._task.segments
        if unachieved is not None and not is_last and not is_early:
            errors = list(map(self._reachable, errors, np.split(unachieved, len(errors))))
        return all(map(_is_short, errors, tolerances))

    def _reachable(self, error: np.ndarray, unachieved: np.ndarray) -> np.ndarray:
        """The part of an error (3,) whose feedback is achieved."""
        asked = self._feedback(error)
        size = float(np.linalg.norm(asked))
        if size == 0.0:
            return error
        return (asked - unachieved) * (float(np.linalg.norm(error)) / size)

    def _size(self, segment: int) -> Meters:
        A = self._points[segment]
        B = self._points[segment + 1]
        turn = None
        if self._turns is not None:
            turn = rotation_error(self._turns[segment], self._turns[segment + 1])
        return pose_distance(B - A, turn)


class TargetFollower:
    """A point mass that is drawn to a target, with limited speed and acceleration.

    Nothing of it jumps with the target: a new one changes the acceleration alone. From rest it
    takes a straight line; near the target it is a critically damped spring. Only the target itself
    ends the motion. At first it is where the tip is, and the mass goes on with its task velocity
    dx.

    Args:
        task: Has the feedback gain and the tolerances.
        speed: Largest one, also of what feedback adds [m/s]; a turn is ten times as fast.
    """

    def __init__(
        self,
        task: WaypointTask,
        x: Position,
        R: Rotation | None,
        dx: TaskVelocity,
        t: Seconds = 0.0,
        *,
        speed: float,
    ) -> None:
        self._task = task
        self._speed = speed
        self._feedback = partial(_feedback, task.feedback_gain, speed)
        self._x = x
        self._R = R
        self._v = dx[:3]
        self._w = dx[3:]
        self._t = t
        self.set_target(x, R)

    def set_target(self, x: Position, R: Rotation | None) -> None:
        """Go to another pose from here on."""
        self._x_end = x
        self._R_end = R

    def reference(
        self,
        x: Position,
        t: Seconds,
        R: Rotation | None = None,
        *,
        unachieved: TaskVelocity | None = None,
        rate: float = 1.0,
    ) -> Reference:
        """As of Planner; what is unachieved does not count."""
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
        self._w = self._next_velocity(turn, self._w, dt, 1.0 / _LEVER)
        self._R = rotation_matrix(dt * self._w).dot(self._R)
        turn_left = rotation_error(R, self._R)
        twist = np.concatenate((dx, rate * self._w + self._feedback(turn_left)))
        is_there &= _is_short(rotation_error(R, self._R_end), self._task.orientation_tolerance)
        return Reference(twist, self._x, error, 1, is_there, self._R, turn_left)

    def preview(self, t: Seconds, seconds: Seconds, rate: float = 1.0) -> Preview:
        """As of Planner, by the motion of a copy."""
        ahead = copy(self)
        times = np.arange(0.0, seconds + PREVIEW_STEP, PREVIEW_STEP)
        places = [ahead.reference(ahead._x, t + rate * each, ahead._R) for each in times]
        positions = np.array([each.x_d for each in places])
        if self._R is None:
            return Preview(times, positions)
        return Preview(times, positions, np.array([each.R_d for each in places]))

    def time_left(self, t: Seconds) -> Seconds:
        """About how long the motion still takes, whatever the time; 0 beside the target."""
        turn = None
        if self._R is not None and self._R_end is not None:
            turn = rotation_error(self._R, self._R_end)
        left = pose_distance(self._x_end - self._x, turn)
        return left / self._speed if left > self._task.tolerance else 0.0

    def _next_velocity(
        self, offset: np.ndarray, v: Velocity, dt: Seconds, scale: float
    ) -> Velocity:
        """The velocity after dt, from v at an offset (3,) from the target; scale is of speed and
        acceleration: 1 for lengths, 1 / _LEVER for turns.
        """
        length = float(np.linalg.norm(offset))
        acceleration = scale * _ACCELERATION
        braking = np.sqrt(acceleration * length)  # with half of the acceleration
        speed = min(_GAIN * length, braking, scale * self._speed)
        desired = offset * (speed / length) if length > 0.0 else np.zeros(3)
        change = min(_DAMPING * _GAIN * dt, 1.0) * (desired - v)
        excess = float(np.linalg.norm(change)) / max(acceleration * dt, 1e-12)
        return v + change / max(excess, 1.0)


def pose_distance(line: Position, turn: RotationVector | None) -> Meters:
    """Length of a motion; a turn counts by its arc on a lever of 0.1 m."""
    length = float(np.linalg.norm(line))
    return length if turn is None else max(length, _LEVER * float(np.linalg.norm(turn)))


def _feedback(gain: float, limit: float, error: np.ndarray) -> np.ndarray:
    """The feedback k_P e of Eq. (37), (3,), no longer than the limit, which may be infinite."""
    feedback = gain * error
    x, y, z = feedback.tolist()
    excess = math.sqrt(x * x + y * y + z * z) / limit
    return feedback / excess if excess > 1.0 else feedback


def _is_short(error: np.ndarray, tolerance: float) -> bool:
    return float(np.linalg.norm(error)) < tolerance
