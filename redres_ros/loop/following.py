"""Whether the arm follows its references: by its lag, and by whether it moves at all."""

from collections import deque

import numpy as np

_LAG_TIME = 0.1  # [s] by which a servo may be behind a moving reference
_DECAY_TIME = 0.2  # [s] for which a reference counts as moving after it has stopped
_DELAY = 0.03  # [s] of dead time that is allowed for
_SHORTEST = 0.02  # [s] between two looks at whether the arm has moved
_LONGEST = 1.0  # [s]
_COMMANDED = 1e-3  # [rad] that a joint must be commanded to move before it is judged
_MOVED = 0.1  # of that, which shows that it moves
_NOISE = 1e-4  # [rad] of a measurement


class FollowingMonitor:
    """Compares what was measured with what was commanded.

    Args:
        T: The robot's cycle [s].
        n: Number of joints.
    """

    def __init__(self, T: float, n: int) -> None:
        self._T = T
        self._fast = np.zeros(n)  # recent speed of the reference, (n,) [rad/s]
        self._references: deque[np.ndarray] = deque(maxlen=max(round(_DELAY / T), 1))
        self.clear()

    def clear(self) -> None:
        """The arm is at rest, at its reference."""
        self._references.clear()
        self._commanded = _Range()
        self._moved = _Range()
        self._elapsed = 0.0  # [s] of these
        self._fast[:] = 0.0

    def lag(self, q: np.ndarray, q_ref: np.ndarray) -> tuple[float, int]:
        """How far the joint furthest behind is from its reference [rad], and which one it is.

        What a servo may be behind a moving reference does not count.

        Args:
            q: Measured, (n,) [rad].
            q_ref: Published last, (n,) [rad].
        """
        behind = np.abs(q_ref - q) - _LAG_TIME * self._fast
        joint = int(behind.argmax())
        return float(behind[joint]), joint

    def enter(self, q: np.ndarray, q_ref: np.ndarray, dq: np.ndarray, cycles: int) -> bool:
        """Whether the arm moves, as far as it was commanded to.

        Args:
            q: Measured, (n,) [rad].
            q_ref: Published last, (n,) [rad].
            dq: Velocity of that, (n,) [rad/s].
            cycles: Since the state before.
        """
        seconds = cycles * self._T
        self._fast = np.maximum(np.abs(dq), self._fast * max(1.0 - seconds / _DECAY_TIME, 0.0))
        delayed = self._references[0] if self._references else q_ref
        self._references.append(q_ref)
        self._elapsed += seconds
        commanded = self._commanded.extended(delayed)
        moved = self._moved.extended(q)
        if self._elapsed < _SHORTEST or (commanded.max() < _COMMANDED and self._elapsed < _LONGEST):
            return True
        self._commanded = _Range(delayed)
        self._moved = _Range(q)
        self._elapsed = 0.0
        return bool(commanded.max() < _COMMANDED or (moved > _MOVED * commanded + _NOISE).any())


class _Range:
    """The range of positions that joints have passed through."""

    def __init__(self, q: np.ndarray | None = None) -> None:
        self._lower = q
        self._upper = q

    def extended(self, q: np.ndarray) -> np.ndarray:
        """Its width, (n,) [rad], with another position q (n,) [rad]."""
        self._lower = q if self._lower is None else np.minimum(self._lower, q)
        self._upper = q if self._upper is None else np.maximum(self._upper, q)
        return self._upper - self._lower
