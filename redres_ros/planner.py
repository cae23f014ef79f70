"""Task velocities along the points of a task: quintic segments (36) with feedback (37)."""

from dataclasses import dataclass

import numpy as np

from redres_ros.waypoints import Task


def quintic(xi: float) -> tuple[float, float]:
    """s(xi) and ds/dxi of Eq. (36): from 0 to 1, velocity and acceleration 0 at both ends; xi is
    clipped to [0, 1].
    """
    xi = min(max(xi, 0.0), 1.0)
    return xi**3 * (10.0 + xi * (6.0 * xi - 15.0)), 30.0 * xi**2 * (1.0 - xi) ** 2


def orientation_error(R_d: np.ndarray, R: np.ndarray) -> np.ndarray:
    """Angle and axis that turn R (3, 3) into R_d, to first order, (3,) [rad] in the base frame."""
    return 0.5 * np.cross(R.T, R_d.T).sum(axis=0)


@dataclass(frozen=True)
class Reference:
    """What the planner asks for at one tick.

    dx: (3,) task velocity [m/s]; x_d: (3,) desired position [m]; error: x_d - x, (3,) [m]; segment:
    1 for the way to x_1 and so on, 0 for an approach to x_0; finished: the last point is reached
    and held.
    """

    dx: np.ndarray
    x_d: np.ndarray
    error: np.ndarray
    segment: int
    finished: bool


class Planner:
    """Walks through a task's points, one segment after the other, and then holds the last one.

    x_start: (3,) where the tip is when the task begins [m]; unless it is x_0 to within
    start_tolerance [m], a first segment of its own leads to x_0. None begins at x_0. feedback_limit
    [m/s]: largest speed that the feedback may add; errors that need more come from an interruption,
    and a jump in velocity would be the answer to them.
    """

    def __init__(
        self,
        task: Task,
        x_start: np.ndarray | None = None,
        *,
        start_tolerance: float = 0.005,
        feedback_limit: float = np.inf,
    ) -> None:
        self._task = task
        self._feedback_limit = feedback_limit
        approaches = (
            x_start is not None and np.linalg.norm(x_start - task.waypoints[0]) > start_tolerance
        )
        # (N, 3)
        self._points = np.vstack((x_start, task.waypoints)) if approaches else task.waypoints.copy()
        self._first_segment = 0 if approaches else 1
        self._index = 0
        self._t_segment = 0.0
        self._finished = False

    def reference(self, x: np.ndarray, t: float) -> Reference:
        """The reference for the tip at x (3,) [m] and the time t [s] since the task began; t never
        goes back.

        The next segment begins at the first tick at which this one is over, Task.switching saying
        when that is.
        """
        while not self._finished and self._is_over(x, t):
            self._index += 1
            self._t_segment = t
            self._finished = self._index == len(self._points) - 1
        x_d, dx_d = self._desired(t - self._t_segment)
        error = x_d - x
        feedback = self._task.feedback_gain * error
        excess = float(np.linalg.norm(feedback)) / self._feedback_limit
        dx = dx_d + feedback / max(excess, 1.0)  # Eq. (37)
        return Reference(
            dx,
            x_d,
            error,
            min(self._index, len(self._points) - 2) + self._first_segment,
            self._finished,
        )

    def _is_over(self, x: np.ndarray, t: float) -> bool:
        t_s = t - self._t_segment
        if t_s <= 0.0 or (
            self._task.switching == 'at_rest' and t_s < self._task.segment_time - 1e-9
        ):
            return False
        return bool(np.linalg.norm(self._points[self._index + 1] - x) < self._task.tolerance)

    def _desired(self, t_s: float) -> tuple[np.ndarray, np.ndarray]:
        """x_d and dx_d, Eq. (36), both (3,); the last point at rest once it is reached."""
        if self._finished:
            return self._points[-1].copy(), np.zeros(3)
        A = self._points[self._index]
        B = self._points[self._index + 1]
        T_AB = self._task.segment_time
        s, ds = quintic(t_s / T_AB)
        return A + (B - A) * s, (B - A) / T_AB * ds
