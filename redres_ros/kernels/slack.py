"""Limits that are rows, in a level of their own: w is by how much each of them is exceeded."""

import numpy as np

from redres_ros.kernels.arithmetic import dot
from redres_ros.kernels.basis import hold
from redres_ros.kernels.compiled import compiled
from redres_ros.kernels.search import FREE, LOWER, ROUNDING, STATE, UPPER, Search


@compiled()
def open_slack(search: Search, begin: int, length: np.ndarray, A: np.ndarray, slack: int) -> None:
    """Bring in the limits from `begin` on, as many as A has rows: lower <= G z - w <= upper.

    w are the variables of z from `slack` on. A receives the rows that ask for the least |length w|.
    """
    z = search.z
    for r in range(len(A)):
        i = begin + r
        value = 0.0
        noise = 0.0
        for j in range(slack):
            value += search.G[i, j] * z[j]
            noise += abs(search.G[i, j] * z[j])
        above = value - search.ends[UPPER, i]
        below = search.ends[LOWER, i] - value
        A[r, slack + r] = length[i]
        search.G[i, slack + r] = -1.0
        search.marks[STATE, i] = FREE
        if max(above, below) > ROUNDING * noise:
            z[slack + r] = above if above > below else -below
            hold(search, i, z[slack + r])


@compiled()
def close_slack(search: Search, begin: int, length: np.ndarray, A: np.ndarray, slack: int) -> float:
    """Move the ends of limits that remain in excess to where they are.

    Returns:
        The sum of squares of the excess.
    """
    z = search.z
    square = 0.0
    for r in range(len(A)):
        i = begin + r
        square += (length[i] * z[slack + r]) ** 2
        z[slack + r] = 0.0
        search.G[i, slack + r] = 0.0
        value = dot(search.G[i], z)
        search.ends[UPPER, i] = max(search.ends[UPPER, i], value)
        search.ends[LOWER, i] = min(search.ends[LOWER, i], value)
    return square
