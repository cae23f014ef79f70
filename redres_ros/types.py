"""Arrays: shapes and units as part of the type, and checks of vectors that users give.

n is the number of joints, m that of the task's rows. All arrays are of float64, all units SI; a
sliding joint has metres where a turning one has radians.
"""

import math
from contextlib import suppress
from typing import Annotated, Any

import numpy as np

from redres_ros.errors import ArrayError, quoted

FLOAT64 = np.dtype(np.float64)

JointPositions = Annotated[np.ndarray, '(n,) [rad]']
JointVelocities = Annotated[np.ndarray, '(n,) [rad/s]']
JointAccelerations = Annotated[np.ndarray, '(n,) [rad/s^2]']
JointTorques = Annotated[np.ndarray, '(n,) [Nm]']
InertiaMatrix = Annotated[np.ndarray, '(n, n) [kg m^2]']

TaskVelocity = Annotated[np.ndarray, '(m,) [m/s], then [rad/s]']
TaskAcceleration = Annotated[np.ndarray, '(m,) [m/s^2], then [rad/s^2]']
Jacobian = Annotated[np.ndarray, '(m, n)']
JacobianDerivatives = Annotated[np.ndarray, '(n, m, n), dJ/dq_i']
Position = Annotated[np.ndarray, '(3,) [m]']
Points = Annotated[np.ndarray, '(N, 3) [m]']
Rotation = Annotated[np.ndarray, '(3, 3)']
RotationVector = Annotated[np.ndarray, '(3,) [rad]']
Quaternion = Annotated[np.ndarray, '(4,), as x, y, z, w']
Velocity = Annotated[np.ndarray, '(3,) [m/s]']
Twist = Annotated[np.ndarray, '(6,) [m/s], then [rad/s]']
Force = Annotated[np.ndarray, '(3,) [N]']
Wrench = Annotated[np.ndarray, '(6,) [N], then [Nm]']

Seconds = Annotated[float, '[s]']
Times = Annotated[np.ndarray, '(N,) [s]']
Nanoseconds = Annotated[int, '[ns]']
Cycles = Annotated[int, 'cycles of the robot']
Meters = Annotated[float, '[m]']
Radians = Annotated[float, '[rad]']


def finite_vector(values: Any, size: int, name: str) -> np.ndarray:
    """A copy of the values as (size,) float64.

    Raises ArrayError, which calls it by its name: for another shape, no numbers, NaN or infinity.
    """
    vector = as_vector(values, size, name)
    check_finite(vector, name)
    return vector.copy()


def as_vector(values: Any, size: int, name: str) -> np.ndarray:
    """The values as (size,) float64: the array itself if it is one; NaN and infinity may be in it.

    Raises ArrayError for another shape, or no numbers.
    """
    if type(values) is not np.ndarray or values.dtype is not FLOAT64:
        values = _as_floats(values, size, name)
    if values.shape != (size,):
        raise ArrayError(f'{name} has shape {values.shape}; expected ({size},)')
    return values


def check_finite(vector: np.ndarray, name: str) -> None:
    """Raise ArrayError for NaN or infinity in a vector of any length."""
    if not all(map(math.isfinite, vector.tolist())):  # half the time of np.isfinite().all()
        raise ArrayError(f'{name} is {vector.tolist()}; every value must be finite')


def _as_floats(values: Any, size: int, name: str) -> np.ndarray:
    with suppress(TypeError, ValueError, OverflowError):
        if not np.ma.is_masked(values) and np.asarray(values).dtype.kind in 'iufO':
            return np.array(values, np.float64)
    raise ArrayError(f'{name} is {quoted(values)}; expected {size} real numbers')
