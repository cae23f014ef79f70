"""Shapes and units as part of the type: what an array holds, and in what it is measured.

n is the number of joints, m that of the task's rows. All arrays are of float64, all units SI; a
sliding joint has metres where a turning one has radians.
"""

from typing import Annotated

import numpy as np

JointPositions = Annotated[np.ndarray, '(n,) [rad]']
JointVelocities = Annotated[np.ndarray, '(n,) [rad/s]']
JointAccelerations = Annotated[np.ndarray, '(n,) [rad/s^2]']
JointTorques = Annotated[np.ndarray, '(n,) [Nm]']
InertiaMatrix = Annotated[np.ndarray, '(n, n) [kg m^2]']

TaskVelocity = Annotated[np.ndarray, '(m,) [m/s], then [rad/s]']
Jacobian = Annotated[np.ndarray, '(m, n)']
Position = Annotated[np.ndarray, '(3,) [m]']
Points = Annotated[np.ndarray, '(N, 3) [m]']
Rotation = Annotated[np.ndarray, '(3, 3)']
RotationVector = Annotated[np.ndarray, '(3,) [rad]']
Quaternion = Annotated[np.ndarray, '(4,), as x, y, z, w']
Velocity = Annotated[np.ndarray, '(3,) [m/s]']
Twist = Annotated[np.ndarray, '(6,) [m/s], then [rad/s]']
Wrench = Annotated[np.ndarray, '(6,) [N], then [Nm]']

Seconds = Annotated[float, '[s]']
Times = Annotated[np.ndarray, '(N,) [s]']
Nanoseconds = Annotated[int, '[ns]']
Cycles = Annotated[int, 'cycles of the robot']
Meters = Annotated[float, '[m]']
Radians = Annotated[float, '[rad]']
