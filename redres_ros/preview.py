"""The path that the tip is to take in the next seconds, for laws that look ahead."""

from copy import copy
from typing import Any, NamedTuple, Self

import numpy as np

from redres_ros.errors import ArrayError, reason_of
from redres_ros.types import Points, Seconds, Times

_FARTHEST = 1e6  # [m], [s]


class Preview:
    """Where the tip is to be: on straight lines between these times, at rest after the last one.

    Attributes:
        times: From this tick on, increasing; those of the past are negative.
        rotations: The orientations, (N, 9); empty for a path of the position alone.

    Raises ArrayError for other shapes, NaN or infinity, and times that do not increase.
    """

    def __init__(
        self, times: Times, positions: Points, orientations: np.ndarray | None = None
    ) -> None:
        self.times = np.array(times, np.float64, ndmin=1)
        N = len(self.times)
        self.positions = _checked('positions', positions, (N, 3))
        self.rotations = np.empty((0, 9))
        if orientations is not None:
            self.rotations = _checked('orientations', orientations, (N, 3, 3)).reshape(-1, 9)
        _checked('times', self.times, (N,))
        if not N or not (np.diff(self.times) > 0.0).all():
            raise ArrayError('times of a path do not increase; each must be after the last')

    def of_rows(self, m: int) -> Self | None:
        """The path of the position alone for m = 3; for m = 6 None without orientations."""
        has_rotations = len(self.rotations) > 0
        if has_rotations == (m > 3):
            return self
        if m > 3:
            return None
        positions = copy(self)
        positions.rotations = self.rotations[:0]
        return positions

    def after(self, seconds: Seconds) -> Self:
        """The same path as seen that much later."""
        later = copy(self)
        later.times = self.times - seconds
        return later


class Ahead(NamedTuple):
    """What a law that looks ahead knows at a tick."""

    path: Preview
    elapsed: Seconds  # since the last command
    plan: Any  # what the law has planned then


def _checked(name: str, values: np.ndarray, shape: tuple[int, ...]) -> np.ndarray:
    try:
        array = np.array(values, np.float64, order='C')  # as compiled functions read it
    except (TypeError, ValueError) as error:
        raise ArrayError(f'{name} of a path: {reason_of(error)}') from None
    if array.shape != shape:
        raise ArrayError(f'{name} of a path have shape {array.shape}; expected {shape}')
    if not (np.abs(array) <= _FARTHEST).all():
        raise ArrayError(f'{name} of a path hold NaN, infinity or a number beyond {_FARTHEST:g}')
    return array
