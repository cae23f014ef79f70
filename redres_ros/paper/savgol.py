"""Velocities and accelerations from measured positions by a Savitzky-Golay filter, as in the
paper's experiments.
"""

from dataclasses import dataclass

import numpy as np

from redres_ros.errors import ArrayError

WINDOW = 400  # W, samples
FINER = 100  # one that shows events of a tenth of a second
_DEGREE = 5
LEFT_OUT = WINDOW // 2  # samples at either end that get no estimate


@dataclass(frozen=True)
class MeasuredMotion:
    """What measured positions show of a motion.

    Attributes:
        t: (N,) [s].
        q: (N, n) [rad].
        dq: (N, n) [rad/s].
        ddq: (N, n) [rad/s^2].
    """

    t: np.ndarray
    q: np.ndarray
    dq: np.ndarray
    ddq: np.ndarray


def differentiate(q: np.ndarray, T: float, window: int = WINDOW) -> MeasuredMotion:
    """The motion of positions sampled from t = 0 on, without the first and last half window.

    Each sample gets the derivatives of the polynomial of fifth degree that fits it and half a
    window of samples on either side best. That is W + 1 samples: with an even number the estimates
    would belong to instants half a cycle beside the samples. Polynomials up to the fifth degree are
    differentiated exactly.

    Args:
        q: Measured positions, (N, n) [rad].
        T: Sampling time [s].
        window: W, an even number of samples.

    Raises:
        ArrayError: Fewer than W + 1 samples.
    """
    from scipy.signal import savgol_filter  # an extra, which takes a while to load

    if len(q) <= window:
        raise ArrayError(
            f'{len(q)} positions; expected at least {window + 1} for the Savitzky-Golay filter'
        )
    left_out = window // 2
    inner = slice(left_out, len(q) - left_out)
    dq, ddq = (
        savgol_filter(q, window + 1, _DEGREE, deriv=order, delta=T, axis=0)[inner]
        for order in (1, 2)
    )
    return MeasuredMotion(T * np.arange(len(q))[inner], q[inner], dq, ddq)
