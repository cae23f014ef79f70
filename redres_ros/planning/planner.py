"""Task velocities along the points of a task: quintic segments (36) with feedback (37), for the
position of the tip alone or together with its orientation.
"""

import math
from typing import NamedTuple, Protocol

import numpy as np

from redres_ros.interpolation import quintic
from redres_ros.kernels.tick import rotation_error
from redres_ros.planning.waypoints import WaypointTask
from redres_ros.rotation import rotation_matrix

LEVER = 0.1  # [m] on which a turn is compared with a length
_START_TOLERANCE = 0.005  # [m] from x_0, at which a task begins without an approach
_ROUNDING = 1e-9  # [s] of the time of a segment


class Reference(NamedTuple):
    """The reference of the planner at one tick.

    Attributes:
        dx: Task velocity, (3,) [m/s], or (6,) with the angular part [rad/s] below.
        x_d: Desired position, (3,) [m].
        error: x_d - x, (3,) [m].
        segment: 1 for the segment to x_1 and so on, 0 for an approach to x_0.
        finished: The last point is reached and held.
        R_d: Desired orientation, (3, 3); None for a position alone.
        orientation_error: The turn that is left, (3,) [rad]; None likewise.
    """

    dx: np.ndarray
    x_d: np.ndarray
    error: np.ndarray
    segment: int
    finished: bool
    R_d: np.ndarray | None = None
    orientation_error: np.ndarray | None = None


class ReferenceSource(Protocol):
    """What leads the tip: points, a target that moves, an operator."""

    @property
    def duration(self) -> float:
        """How long it takes [s]."""

    def reference(
        self,
        x: np.ndarray,
        t: float,
        R: np.ndarray | None = None,
        *,
        unachieved: np.ndarray | None = None,
        rate: float = 1.0,
    ) -> Reference:
        """The reference at this time.

        Args:
            x: (3,) where the tip is [m].
            t: Time of the task [s] since it began; it never goes back. Where the arm executes the
                fraction s of the velocity, it goes on by s T.
            R: (3, 3) how the tip is turned; None for the position alone.
            unachieved: (m,), the part of the last dx that a singularity blocks.
            rate: Factor on the velocity along the path, for a clock that is going slower.
        """

    def time_left(self, t: float) -> float:
        """Time left of the current segment at a time t of the task [s]; 0 once it is overdue."""

    def elapsed(self, t: float) -> float:
        """How much of the duration is over at a time t of the task [s]."""


class Planner(ReferenceSource):
    """Passes a task's points, one segment after the other, and then holds the last one."""

    def __init__(
        self,
        task: WaypointTask,
        x_start: np.ndarray | None = None,
        R_start: np.ndarray | None = None,
        *,
        feedback_limit: float = np.inf,
    ) -> None:
        """A planner at the beginning of a task.

        Args:
            task: Points, and how to pass them.
            x_start: (3,) where the tip is [m]. Unless it is x_0 to within 5 mm, a first
                segment of its own leads to x_0, no faster than the fastest one of the task. None
                begins at x_0.
            R_start: (3, 3) how the tip is turned; None begins as at x_0. A task that says nothing
                of orientations holds the one with which it begins.
            feedback_limit: Largest speed that the feedback may add [m/s], and [rad/s] for the
                orientation. Errors that need more come from an interruption, and a jump in velocity
                would be the response to them.
        """
        self._task = task
        self._approach_time = task.segment_time  # [s]
        self._feedback = task.feedback_gain, feedback_limit
        self._points = task.waypoints.copy()  # (N, 3)
        self._turns = task.orientations  # (N, 3, 3), None until one is known
        self._first_segment = 1
        if self._is_away(x_start, R_start):
            self._approach_from(x_start, R_start)
        if self._turns is None and R_start is not None:
            self._hold(R_start)
        self._t_segment = 0.0
        self._begin_segment(0)

    def reference(
        self,
        x: np.ndarray,
        t: float,
        R: np.ndarray | None = None,
        *,
        unachieved: np.ndarray | None = None,
        rate: float = 1.0,
    ) -> Reference:
        """The reference at this time; arguments as of ReferenceSource.reference().

        The next segment begins at the first tick at which this one is over, WaypointTask.switching
        saying when that is. A point that can be reached no better, because of what is unachieved,
        does not keep a segment from ending; the last point must still be reached.
        """
        if R is not None and self._turns is None:
            self._hold(R)
        while not self._finished and self._is_over(x, t, R, unachieved):
            self._t_segment = t
            self._begin_segment(self._index + 1)
        T_AB = self._T_AB
        s, ds = (1.0, 0.0) if self._finished else quintic((t - self._t_segment) / T_AB)
        start = min(self._index, len(self._points) - 2)
        ds *= rate / T_AB  # [1/s]
        end = self._points[start + 1]
        way = end - self._points[start]
        x_d = self._points[start] + way * s if s < 1.0 else end.copy()  # Eq. (36)
        error = x_d - x
        dx = limited(*self._feedback, error) + way * ds  # Eq. (37)
        segment = start + self._first_segment
        if R is None or self._turns is None:
            return Reference(dx, x_d, error, segment, self._finished)
        R_d, turn = self._on_the_arc(self._turns, start, s)
        turn_left = rotation_error(R, R_d)
        w = turn * ds + limited(*self._feedback, turn_left)  # Eq. (36), (37)
        twist = np.concatenate((dx, w))
        return Reference(twist, x_d, error, segment, self._finished, R_d, turn_left)

    def time_left(self, t: float) -> float:
        """Time left of the current segment at a time t of the task [s]."""
        left = self._t_segment + self._T_AB - t
        return left if left > _ROUNDING else 0.0

    @property
    def duration(self) -> float:
        """How long all segments take on a path that is followed exactly [s]."""
        return self._time_before(len(self._points) - 1)

    def elapsed(self, t: float) -> float:
        """How much of the duration is over at a time t of the task [s]."""
        if self._finished:
            return self.duration
        return self._time_before(self._index + 1) - self.time_left(t)

    def _time_before(self, index: int) -> float:
        """How long the segments before a point take [s]."""
        if index == 0:
            return 0.0
        first = self._approach_time if self._first_segment == 0 else self._task.segment_time
        return first + (index - 1) * self._task.segment_time

    def _begin_segment(self, index: int) -> None:
        """Go over to a segment; after the last one all is finished."""
        self._index = index
        self._finished = index == len(self._points) - 1
        is_approach = index + self._first_segment == 0
        self._T_AB = self._approach_time if is_approach else self._task.segment_time  # [s]

    def _on_the_arc(self, turns: np.ndarray, start: int, s: float) -> tuple[np.ndarray, np.ndarray]:
        """R_d, (3, 3), at the fraction s of the turn to the next point, and that turn, (3,)."""
        A = turns[start]
        B = turns[start + 1]
        turn = rotation_error(A, B)
        R_d = rotation_matrix(s * turn).dot(A) if s < 1.0 else B.copy()
        return R_d, turn

    def _is_over(
        self, x: np.ndarray, t: float, R: np.ndarray | None, unachieved: np.ndarray | None
    ) -> bool:
        is_early = self.time_left(t) > 0.0
        if (is_early and self._task.switching == 'at_rest') or t <= self._t_segment:
            return False
        end = self._index + 1
        errors = [self._points[end] - x]
        tolerances = [self._task.tolerance]
        if R is not None and self._turns is not None:
            errors.append(rotation_error(R, self._turns[end]))
            tolerances.append(self._task.orientation_tolerance)
        is_last = end == len(self._points) - 1
        if unachieved is not None and not is_last and not is_early:
            errors = [self._reachable(error, part) for error, part in _pairs(errors, unachieved)]
        return all(
            float(np.linalg.norm(error)) < tolerance
            for error, tolerance in zip(errors, tolerances, strict=True)
        )

    def _reachable(self, error: np.ndarray, unachieved: np.ndarray) -> np.ndarray:
        """The part of an error (3,) whose feedback is achieved."""
        asked = limited(*self._feedback, error)
        size = float(np.linalg.norm(asked))
        if size == 0.0:
            return error
        return (asked - unachieved) * (float(np.linalg.norm(error)) / size)

    def _is_away(self, x_start: np.ndarray | None, R_start: np.ndarray | None) -> bool:
        """Whether the tip has to go to x_0 first."""
        if x_start is not None and np.linalg.norm(x_start - self._points[0]) > _START_TOLERANCE:
            return True
        if R_start is None or self._turns is None:
            return False
        turn = rotation_error(R_start, self._turns[0])
        return bool(np.linalg.norm(turn) * LEVER > _START_TOLERANCE)

    def _approach_from(self, x_start: np.ndarray | None, R_start: np.ndarray | None) -> None:
        """Add a segment to x_0 before the task."""
        x = self._points[0] if x_start is None else x_start
        self._points = np.vstack((x, self._points))
        self._first_segment = 0
        if self._turns is not None:
            R = self._turns[0] if R_start is None else R_start
            self._turns = np.concatenate((R[None], self._turns))
        approach, *others = map(self._size, range(len(self._points) - 1))
        longest = max(others) or approach
        self._approach_time = self._task.segment_time * max(approach / longest, 1.0)

    def _size(self, start: int) -> float:
        """Length of a segment [m]; a turn counts by its arc at a radius of 0.1 m."""
        size = float(np.linalg.norm(self._points[start + 1] - self._points[start]))
        if self._turns is None:
            return size
        _, turn = self._on_the_arc(self._turns, start, 1.0)
        return max(size, LEVER * float(np.linalg.norm(turn)))

    def _hold(self, R: np.ndarray) -> None:
        """Hold this orientation at every point."""
        self._turns = np.tile(R, (len(self._points), 1, 1))


def _pairs(errors: list[np.ndarray], unachieved: np.ndarray) -> list[tuple[np.ndarray, np.ndarray]]:
    """Each error (3,) with the part of `unachieved` that belongs to it."""
    return [(error, unachieved[3 * i : 3 * i + 3]) for i, error in enumerate(errors)]


def limited(gain: float, limit: float, error: np.ndarray) -> np.ndarray:
    """The feedback k_P e of Eq. (37), (3,), no longer than the limit, which may be infinite."""
    feedback = gain * error
    x, y, z = feedback.tolist()
    excess = math.sqrt(x * x + y * y + z * z) / limit
    return feedback / excess if excess > 1.0 else feedback
