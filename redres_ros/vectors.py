"""Checks of users' vectors: length, real and finite."""

import math
from typing import Any

import numpy as np

from redres_ros.errors import ArrayError, quoted

FLOAT64 = np.dtype(np.float64)


def finite_vector(values: np.ndarray, size: int, name: str) -> np.ndarray:
    """A copy of the values as (size,) float64.

    Args:
        values: Anything that numpy takes for an array.
        size: Its length.
        name: What an error calls it.

    Raises:
        ArrayError: Another shape, no numbers, or NaN or infinity.
    """
    vector = as_vector(values, size, name)
    check_finite(vector, name)
    return vector.copy()


def as_vector(values: np.ndarray, size: int, name: str) -> np.ndarray:
    """The values as (size,) float64: the array itself if it is one.

    NaN and infinity are looked for later.

    Args:
        values: Anything that numpy takes for an array.
        size: Its length.
        name: What an error calls it.

    Raises:
        ArrayError: Another shape, or no numbers.
    """
    if type(values) is not np.ndarray or values.dtype is not FLOAT64:
        values = _as_floats(values, size, name)
    if values.shape != (size,):
        raise ArrayError(f'{name} has shape {values.shape}; expected ({size},)')
    return values


def check_finite(vector: np.ndarray, name: str) -> None:
    """Refuse a vector that is not finite.

    Args:
        vector: Vector of any length.
        name: What an error calls it.

    Raises:
        ArrayError: It holds NaN or infinity.
    """
    if not all(map(math.isfinite, vector.tolist())):  # half the time of np.isfinite().all()
        raise ArrayError(f'{name} is {vector.tolist()}; every value must be finite')


def _as_floats(values: Any, size: int, name: str) -> np.ndarray:
    """A copy of the values as an array of float64, whatever they are."""
    try:
        _check_real(values, size, name)
        return np.array(values, np.float64)
    except (TypeError, ValueError, OverflowError):
        raise ArrayError(f'{name} is {quoted(values)}; expected {size} numbers') from None


def _check_real(values: Any, size: int, name: str) -> None:
    """Refuse arrays whose mask or imaginary part numpy would drop."""
    problem = ''
    if np.ma.is_masked(values):
        problem = 'has masked values'
    elif np.asarray(values).dtype.kind not in 'iufO':
        problem = f'is {quoted(values)}'
    if problem:
        raise ArrayError(f'{name} {problem}; expected {size} real numbers')
