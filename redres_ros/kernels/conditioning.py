"""Whether a task is far from its singularities, for what is done beside them."""

import numpy as np
from numba import boolean, float64

from redres_ros.kernels.closed_form import SINGULAR_RATIO, is_regular
from redres_ros.kernels.compiled import compiled, direct, matrix
from redres_ros.kernels.factors import make_orthonormal


@direct
@compiled(boolean(matrix(), float64))
def is_far(J: np.ndarray, ratio: float) -> bool:
    """Whether each singular value of J (m, n) is above a share of the largest one.

    False also where it is a close call.
    """
    m = len(J)
    Q = J.copy()
    R = np.zeros((m, m))
    make_orthonormal(Q, R)
    square = 0.0
    for k in range(m):
        for j in range(k + 1):
            square += R[k, j] ** 2
    return is_regular(R, 0, m, ratio / SINGULAR_RATIO * np.sqrt(square))
