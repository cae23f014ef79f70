"""The quintic of Eq. (36): from rest to rest."""

import math

PEAK_SPEED = 15.0 / 8.0  # largest ds/dxi
PEAK_ACCELERATION = 10.0 / math.sqrt(3.0)  # largest d2s/dxi2


def quintic(xi: float) -> tuple[float, float]:
    """s(xi) and ds/dxi of Eq. (36): from 0 to 1, velocity and acceleration 0 at both ends; xi is
    clipped to [0, 1].
    """
    xi = min(max(xi, 0.0), 1.0)
    return xi**3 * (10.0 + xi * (6.0 * xi - 15.0)), 30.0 * xi**2 * (1.0 - xi) ** 2
