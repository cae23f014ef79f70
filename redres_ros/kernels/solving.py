"""What is solved with the factor of a weight, for what is done beside singularities.

LAPACK does the same. But scipy, which brings it, takes a third of a second to load, and its library
starts threads for some of these calls, which takes milliseconds on a busy machine.
"""

import numpy as np
from numba import boolean, float64, int64

from redres_ros.kernels.compiled import compiled, matrix
from redres_ros.kernels.factors import cholesky, solve_factor, solve_transposed_factor


@compiled(boolean(matrix(), float64[:, ::1]))
def fill_factor(W: np.ndarray, F: np.ndarray) -> bool:
    """Fill in the upper triangle of F, W = F'F; whether W (n, n) is positive definite."""
    return cholesky(W, F)


@compiled((matrix(), int64, boolean, float64[:, ::1]))
def solve_rows(F: np.ndarray, form: int, transposed: bool, X: np.ndarray) -> None:
    """Each row x of X becomes F^-1 x, or F'^-1 x.

    Args:
        F: (n, n) upper triangular.
        form: FACTOR, or SQUARE for F'F in the place of F.
        transposed: Whether F' is meant.
        X: (k, n).
    """
    for k in range(len(X)):
        if transposed:
            solve_transposed_factor(F, form, X[k])
        else:
            solve_factor(F, form, X[k])
