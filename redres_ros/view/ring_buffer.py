"""A ring buffer of values with their times."""

from collections import deque
from typing import Any

import numpy as np


class RingBuffer:
    """The newest values of a signal, each with its time.

    Args:
        span: How long they are kept [s].
    """

    def __init__(self, span: float) -> None:
        self._span = span
        self._kept: deque[tuple[float, Any]] = deque()

    def add(self, time: float, value: Any) -> None:
        """Append a value; a clock that went back clears the buffer.

        Args:
            time: [s].
            value: At that time.
        """
        if self._kept and time < self._kept[-1][0]:
            self._kept.clear()
        self._kept.append((time, value))
        while time - self._kept[0][0] > self._span:
            self._kept.popleft()

    def clear(self) -> None:
        """Forget all."""
        self._kept.clear()

    @property
    def times(self) -> np.ndarray:
        """(N,) [s]."""
        return np.array([time for time, _ in self._kept])

    @property
    def values(self) -> list[Any]:
        """In their order."""
        return [value for _, value in self._kept]
