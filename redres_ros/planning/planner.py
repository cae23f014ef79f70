"""What leads the tip: along the points of a task in quintic segments (36) with feedback (37), or to
poses that change while the tip moves. For the position alone or together with the orientation.
"""

import math
from collections.abc import Sequence
from copy import copy
from functools import partial
from itertools import pairwise, repeat
from typing import NamedTuple

import numpy as np

from redres_ros.geometry import (
    PEAK_ACCELERATION,
    PEAK_SPEED,
    quintic,
    quintics,
    rate_matrix,
    rotation_matrix,
)
from redres_ros.kernels.tick import rotation_error
from redres_ros.planning.waypoints import WaypointTask
from redres_ros.preview import Preview
from redres_ros.types import (
    Meters,
    Points,
    Position,
    Rotation,
    RotationVector,
    Seconds,
    TaskVelocity,
    Times,
    Velocity,
)

_LEVER = 0.1  # [m] on which a turn is compared with a length
_START_TOLERANCE = 0.005  # [m] from x_0, at which a task begins without an approach
_ROUNDING = 1e-9  # [s] of the time of a segment
_AHEAD = np.append(np.arange(0.0, 2.2, 0.05), np.arange(2.2, 13.0, 0.4))  # [s] of a preview

# Poses that change
_UNTURNED = np.eye(3)
_SHORTEST = 0.5  # [s] that a motion from rest takes at least
_STILL = 1e-4  # [m/s], [rad/s]
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
        return _pose_distance(self.error, self.orientation_error), f'the tip is {words}'


class Planner:
    """Passes a task's points, one segment after the other, and then holds the last one.

    The next segment begins at the first tick at which this one is over; WaypointTask says when that
    is. A point that can be reached no better, because of what is unachieved, does not keep a
    segment from ending; the last point must still be reached.

    A tip that starts farther than 5 mm from x_0 has a first segment of its own to there, no faster
    than the fastest one of the task. A task without orientations holds the first one.

    The feedback adds no more speed than its limit [m/s], [rad/s] for the orientation: larger
    errors come from an interruption, and a jump in velocity would be the response to them.
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
        turns = () if self._turns is None else self._turns
        approach, *sizes = _lengths(self._points, turns)
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
        """The reference for a tip at x and R, without R for the position alone, at a time t of the
        task, which never goes back, and advances by s T where the arm executes the fraction s of
        the velocity.

        `unachieved` is the part of the last dx that a singularity blocks, `rate` a factor on the
        velocity along the path, for a clock that is going slower.
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
        A, B = self._turns[start : start + 2]
        turn = rotation_error(A, B)
        R_d = rotation_matrix(s * turn).dot(A) if s < 1.0 else B.copy()
        turn_left = rotation_error(R, R_d)
        w = turn * ds + self._feedback(turn_left)  # Eq. (36), (37)
        twist = np.concatenate((dx, w))
        return Reference(twist, x_d, error, start, self._finished, R_d, turn_left)

    def preview(
        self, t: Seconds, seconds: Seconds, rate: float = 1.0, step: Seconds | None = None
    ) -> Preview:
        """The path of the next seconds, for a clock that advances at a rate."""
        times = _AHEAD[: np.searchsorted(_AHEAD, seconds) + 1]
        if step:
            times = np.arange(0.0, seconds + step, step)
        at = t + rate * times
        count = 2 + int(max(at[-1] - self._t_segment, 0.0) / self._task.segment_time)  # at most
        durations = self._times[self._segment : self._segment + count]
        starts = self._t_segment + np.cumsum([0.0, *durations[:-1]])
        segments = np.maximum(np.searchsorted(starts, at, side='right') - 1, 0)
        s = quintics((at - starts[segments]) / np.array(durations)[segments])
        segments += self._segment
        if self._finished:
            s[:] = 1.0
        start = self._points[segments]
        positions = start + s[:, None] * (self._points[segments + 1] - start)
        if self._turns is None:
            return Preview(times, positions)
        ends = zip(self._turns[segments], self._turns[segments + 1], s, strict=True)
        rotations = [rotation_matrix(c * rotation_error(A, B)).dot(A) for A, B, c in ends]
        return Preview(times, positions, np.array(rotations))

    def time_left(self, t: Seconds) -> Seconds:
        """Time left of the current segment; 0 once it is overdue."""
        left = self._t_segment + self._times[self._segment] - t
        return left if left > _ROUNDING else 0.0

    def progress(self, t: Seconds) -> float:
        """The fraction of the nominal duration that is over, before the last point is reached."""
        T_AB = self._task.segment_time  # of all but the first
        elapsed = self._times[0] + self._segment * T_AB - self.time_left(t)
        return elapsed / (self._times[0] + self._task.segments * T_AB)

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


def _vector_rates(turn: RotationVector, w: np.ndarray, dw: np.ndarray) -> tuple[np.ndarray, ...]:
    """Derivatives of a rotation vector at an angular velocity w and acceleration dw."""
    G = rate_matrix(turn).T
    rate = np.linalg.solve(G, w)
    e = 1e-4 * rate  # for dG/dt by the central difference
    dG = (rate_matrix(turn + e) - rate_matrix(turn - e)).T / 2e-4
    return rate, np.linalg.solve(G, dw - dG.dot(rate))


class _Path:
    """Poses (N,) at times of the task, with orientations (N, 3, 3) or (0, 3, 3): quintic between
    them, velocities and accelerations by their neighbours, and at rest at both ends.
    """

    def __init__(self, times: Times, positions: Points, rotations: np.ndarray) -> None:
        self.times = times
        self.positions = positions
        self.rotations = rotations
        steps = np.diff(positions, axis=0)  # (N - 1, 3) or, with rotation vectors, (N - 1, 6)
        turns = [rotation_error(A, B) for A, B in pairwise(rotations)]  # any number in all
        if len(rotations):
            steps = np.hstack((steps, np.reshape(turns, (-1, 3))))
        h = np.diff(times)[:, None]
        slopes = steps / h
        ratio = h[:-1] / h[1:]
        # Beyond a factor of two the longer one counts, which else swings out.
        uneven = ratio / np.clip(ratio, 0.5, 2.0)
        before = h[1:] * uneven**3
        v = np.zeros((len(times), steps.shape[1]))
        a = np.zeros_like(v)
        v[1:-1] = (before * slopes[:-1] + h[:-1] * slopes[1:]) / (before + h[:-1])
        a[1:-1] = 2.0 * np.diff(slopes, axis=0) / (h[1:] + h[:-1])
        a[1:-1] /= np.maximum(uneven, 1.0 / uneven)
        # Coefficients of the powers of xi; a last segment is at rest.
        c_1 = h * v[:-1]
        c_2 = h**2 * a[:-1] / 2.0
        for k, turn in enumerate(turns, 1):  # of the vector from the pose before
            v[k, 3:], a[k, 3:] = _vector_rates(turn, v[k, 3:], a[k, 3:])
        dp = steps - c_1 - c_2
        dv = h * v[1:] - c_1 - 2.0 * c_2
        da = h**2 * a[1:] / 2.0 - c_2
        ends = (10 * dp - 4 * dv + da, -15 * dp + 7 * dv - 2 * da, 6 * dp - 3 * dv + da)
        self._c = np.zeros((6, *v.shape))
        self._c[0, :, :3] = positions
        self._c[1:, :-1] = c_1, c_2, *ends
        self._h = np.append(h, 1.0)

    def at(self, t: Seconds) -> tuple[Position, Rotation | None, TaskVelocity]:
        """Pose and velocity; the first pose before its time, the last one after it."""
        k = max(int(np.searchsorted(self.times, t, side='right')) - 1, 0)
        xi = min(max((t - self.times[k]) / self._h[k], 0.0), 1.0)
        powers = xi ** np.arange(6)
        p = powers.dot(self._c[:, k])
        dp = (np.arange(1, 6) * powers[:5]).dot(self._c[1:, k]) / self._h[k]
        if not len(self.rotations):
            return p, None, dp
        dp[3:] = dp[3:].dot(rate_matrix(p[3:]))
        return p[:3], rotation_matrix(p[3:]).dot(self.rotations[k]), dp


class TargetFollower:
    """A point mass on a path, drawn to it with limited speed and acceleration if it is beside.

    Nothing of it jumps with the path: a new one changes the acceleration alone. Near the path it is
    a critically damped spring. Only the end of the path ends the motion. At first that is where the
    tip is, and the mass goes on with its task velocity dx. `speed` is the largest towards the path,
    and of what feedback adds [m/s]; a turn is ten times as fast.
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
        self._dx = dx if R is not None else dx[:3]
        self._t = t
        self._is_there = True
        self._turn = _UNTURNED
        self._w = self._v = self._offset = np.zeros(3)
        self._lead(self._at_rest())

    def set_target(self, x: Position, R: Rotation | None) -> None:
        """Go to a pose: from rest in one quintic, else as soon as possible."""
        turns = () if R is None or self._R is None else (self._R, R)
        points = np.stack((self._x, x))
        [distance] = _lengths(points, turns)
        time = max(PEAK_SPEED * distance / self._speed, _SHORTEST)
        rests = self._is_there and bool(np.linalg.norm(self._dx) < _STILL)
        times = np.array((0.0, time)) if rests else np.array((-time, 0.0))
        self.set_path(Preview(times, points, np.array(turns) if turns else None))
        self._is_there = rests

    def set_path(self, path: Preview) -> None:
        """Pass poses, each at its time from now on. Before the first one the old path goes on, and
        leads there; if that is too fast, the old path is moved there and draws the mass along.
        """
        old = self._path if self._t < self._path.times[-1] else self._at_rest()
        times = self._t + path.times
        begin = times[0]
        apart = np.diff(times[:2]).sum() / 2.0  # from the first new pose
        count = int(np.searchsorted(old.times, begin - apart))  # of the old ones that stay
        now = int(np.searchsorted(old.times, self._t))
        stay = slice(max(min(now, count) - 2, 0), count)  # those before do not matter any more
        x, R, _ = old.at(begin)
        positions = old.positions[stay]
        rotations = old.rotations[stay]
        new = path.rotations.reshape(-1, 3, 3)
        [distance] = _lengths(np.stack((x, path.positions[0])), () if R is None else (R, new[0]))
        h = begin - old.times[stay][-1] if count else 0.0
        if distance > h * min(self._speed / PEAK_SPEED, _ACCELERATION * h / PEAK_ACCELERATION):
            positions = positions + (path.positions[0] - x)
            if R is not None:
                rotations = rotation_matrix(rotation_error(R, new[0])) @ rotations
        self._is_there = False
        x_all = np.concatenate((positions, path.positions))
        R_all = np.concatenate((rotations, new))
        self._lead(_Path(np.append(old.times[stay], times), x_all, R_all))

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
        self._advance(t)
        error = self._x - x
        dx = rate * self._dx[:3] + self._feedback(error)  # Eq. (37)
        turn_left = None
        if R is not None and self._R is not None:
            turn_left = rotation_error(R, self._R)
            dx = np.concatenate((dx, rate * self._dx[3:] + self._feedback(turn_left)))
        self._is_there = self.is_reached(x, R)
        return Reference(dx, self._x, error, 1, self._is_there, self._R, turn_left)

    def is_reached(self, x: Position, R: Rotation | None) -> bool:
        """Whether a tip is at the end of a path whose time is over, or was there already."""
        end = self._path
        is_over = self._is_there or self._t >= end.times[-1]
        is_there = is_over and _is_short(end.positions[-1] - x, self._task.tolerance)
        if not is_there or R is None or self._R is None:
            return is_there
        return _is_short(rotation_error(R, end.rotations[-1]), self._task.orientation_tolerance)

    def preview(self, t: Seconds, seconds: Seconds, rate: float = 1.0) -> Preview:
        """As of Planner, by the motion of a copy."""
        ahead = copy(self)
        times = _AHEAD[: np.searchsorted(_AHEAD, seconds) + 1]
        poses = [ahead._advance(t + rate * each) for each in times]
        x, R = map(np.array, zip(*poses, strict=True))
        return Preview(times, x, None if self._R is None else R)

    def progress(self, t: Seconds) -> float:
        """The fraction of the path's time that is over."""
        begin, end = self._path.times[[0, -1]]
        return float(np.clip((t - begin) / (end - begin), 0.0, 1.0)) if end > begin else 0.0

    def time_left(self, t: Seconds) -> Seconds:
        """About how long the motion still takes; 0 beside the end."""
        turn = rotation_error(self._turn, _UNTURNED) if self._R is not None else None
        beside = _pose_distance(self._offset, turn)
        left = beside / self._speed if beside > self._task.tolerance else 0.0
        return max(left, self._path.times[-1] - t)

    def _advance(self, t: Seconds) -> tuple[Position, Rotation | None]:
        """Let the mass move until a time; returns where it is then."""
        dt = max(t - self._t, 0.0)
        self._t = t
        self._x, self._R, self._dx = self._path.at(t)
        self._v = self._next_velocity(-self._offset, self._v, dt, 1.0)
        self._offset = self._offset + dt * self._v
        self._x = self._x + self._offset
        self._dx[:3] += self._v
        if self._R is not None:
            to_path = rotation_error(self._turn, _UNTURNED)
            self._w = self._next_velocity(to_path, self._w, dt, 1.0 / _LEVER)
            self._turn = rotation_matrix(dt * self._w).dot(self._turn)
            self._R = self._turn.dot(self._R)
            self._dx[3:] = self._w + self._turn.dot(self._dx[3:])
        return self._x, self._R

    def _at_rest(self) -> _Path:
        """Where the mass is."""
        rotations = np.empty((0, 3, 3)) if self._R is None else self._R[None]
        return _Path(np.array([self._t]), self._x[None], rotations)

    def _lead(self, path: _Path) -> None:
        """Take another path; the mass keeps its pose and its velocity."""
        self._path = path
        x, R, dx = path.at(self._t)
        self._offset = self._x - x
        self._v = self._dx[:3] - dx[:3]
        if R is not None and self._R is not None:
            # Not R_mass R': its rounding errors would double with each new path.
            self._turn = rotation_matrix(rotation_error(R, self._R))
            self._w = self._dx[3:] - self._turn.dot(dx[3:])

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


def source_of(
    task: WaypointTask, x: Position | None, R: Rotation | None, feedback_limit: float = np.inf
) -> Planner | TargetFollower:
    """As Planner, or of points with times a follower, which holds R without orientations."""
    if task.times is None:
        return Planner(task, x, R, feedback_limit=feedback_limit)
    turns = task.orientations
    if turns is None and R is not None:
        turns = np.tile(R, (len(task.times), 1, 1))
    first = None if turns is None else turns[0]
    follower = TargetFollower(task, task.waypoints[0], first, np.zeros(6), speed=feedback_limit)
    follower.set_path(Preview(task.times - task.times[0], task.waypoints, turns))
    return follower


def _pose_distance(line: Position, turn: RotationVector | None) -> Meters:
    """Length of a motion; a turn counts by its arc on a lever of 0.1 m."""
    length = float(np.linalg.norm(line))
    return length if turn is None else max(length, _LEVER * float(np.linalg.norm(turn)))


def top_speed(path: Preview) -> float:
    """Largest mean speed from a pose to the next [m/s]; a turn counts by its arc on a lever."""
    lengths = _lengths(path.positions, path.rotations.reshape(-1, 3, 3))
    return float(max(lengths / np.diff(path.times), default=0.0))


def _lengths(positions: Points, rotations: Sequence[Rotation] | np.ndarray) -> list[Meters]:
    """From each pose to the next; without rotations of the positions alone."""
    turns = [rotation_error(A, B) for A, B in pairwise(rotations)]
    return list(map(_pose_distance, np.diff(positions, axis=0), turns or repeat(None)))


def _feedback(gain: float, limit: float, error: np.ndarray) -> np.ndarray:
    """The feedback k_P e of Eq. (37), (3,), no longer than the limit, which may be infinite."""
    feedback = gain * error
    x, y, z = feedback.tolist()
    excess = math.sqrt(x * x + y * y + z * z) / limit
    return feedback / excess if excess > 1.0 else feedback


def _is_short(error: np.ndarray, tolerance: float) -> bool:
    return float(np.linalg.norm(error)) < tolerance
