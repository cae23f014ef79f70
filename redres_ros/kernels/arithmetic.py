"""Sums and comparisons over a few numbers. A loop takes less time than a call of BLAS or numpy."""

import numpy as np
from numba import boolean

from redres_ros.kernels.compiled import compiled, inlined, vector


@inlined
def dot(a: np.ndarray, b: np.ndarray) -> float:
    """a' b."""
    total = 0.0
    for i in range(len(a)):
        total += a[i] * b[i]
    return total


@compiled(boolean(vector(), vector(), vector()))
def within(values: np.ndarray, lower: np.ndarray, upper: np.ndarray) -> bool:
    """Whether lower <= values <= upper, element by element; False for NaN."""
    for i in range(len(values)):  # noqa: SIM110 (numba knows no generators)
        if not lower[i] <= values[i] <= upper[i]:
            return False
    return True
