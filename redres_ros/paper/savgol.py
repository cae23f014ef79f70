"""Velocities and accelerations from measured positions by a Savitzky-Golay filter, as in the
paper's experiments.
"""

from dataclasses import dataclass

import numpy as np
from scipy.signal import savgol_filter

from redres_ros.errors import ArrayError

WINDOW = 400  # W, samples
DEGREE = 5
LEFT_OUT = WINDOW // 2  # samples at either end that get no estimate


@dataclass(frozen=True)
class MeasuredMotion:
    """t: (N,) [s]; q, dq, ddq: (N, n) [rad], [rad/s], [rad/s^2]."""

    t: np.ndarray
    q: np.ndarray
    dq: np.ndarray
    ddq: np.ndarray


def differentiate(q: np.ndarray, T: float) -> MeasuredMotion:
    """The motion of positions q (N, n) [rad], sampled every T [s] from t = 0 on, but for the first
    and last W/2.

    Each sample gets the derivatives of the polynomial of fifth degree that fits it and W/2 samples
    on either side best. That is W + 1 samples: with an even number the estimates would belong to
    instants half a cycle beside the samples. Polynomials up to the fifth degree are differentiated
    exactly. Raises ArrayError for fewer than W + 1 samples.
    """
    if len(q) <= WINDOW:
        raise ArrayError(
            f'{len(q)} positions; expected at least {WINDOW + 1} for the Savitzky-Golay filter'
        )
    inner = slice(LEFT_OUT, len(q) - LEFT_OUT)
    dq, ddq = (
        savgol_filter(q, WINDOW + 1, DEGREE, deriv=order, delta=T, axis=0)[inner]
        for order in (1, 2)
    )
    return MeasuredMotion(T * np.arange(len(q))[inner], q[inner], dq, ddq)
