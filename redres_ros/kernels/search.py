"""The state of a search under limits: a point, its limits, and what holds it.

Everything is in arrays of fixed size, which the functions beside this file change in place.
"""

from typing import NamedTuple

import numpy as np

# The rows of Search.ends, and the sides of a limit.
LOWER = 0
UPPER = 1

# The layers of Search.basis.
Q = 0  # (d, d) orthonormal rows
R = 1  # (d, d) lower triangular: row k of those along which z may not move is sum_j R[k, j] Q[j]

# The rows of Search.marks.
STATE = 0  # of each limit, one of the four below
SIDE = 1  # of each limit that is held, +1 for its upper end and -1 for its lower one
BEHIND = 2  # the limit behind row k of the basis
COUNT = 3  # how many rows are fixed for good, and how many there are

FREE = 0  # the state of a limit that z may come to,
HELD = 1  # of one whose end z may not leave for now,
FIXED = 2  # or for good,
LATER = 3  # and of one that a later level brings in

ROUNDING = 4e-15  # of a sum, beside the sizes of its terms


class Search(NamedTuple):
    """A point, its limits, and the rows along which it may not move."""

    z: np.ndarray  # (d,)
    G: np.ndarray  # (K, d), of unit length
    ends: np.ndarray  # (2, K), lower <= G z <= upper
    basis: np.ndarray  # (2, d, d)
    marks: np.ndarray  # (4, K + d) of int64
    n: int  # z = (dq, s, slack variables), where dq is (n,)
