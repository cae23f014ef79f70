"""What a motion demands of the arm, and whether the arm could do it."""

from dataclasses import dataclass

import numpy as np

from redres_ros.robot_model import RobotModel
from redres_ros.robots.joint_limits import JointLimits
from redres_ros.simulation.recording import Recording

_ROUNDING = 1e-9  # fraction of a limit by which rounding may exceed it


@dataclass(frozen=True)
class Effort:
    """What a motion demands of the arm."""

    acceleration: float  # largest norm [rad/s^2]
    velocity: float  # largest norm [rad/s]
    torque: float  # largest norm [Nm]
    squared_acceleration: float  # integral of the squared norm over time [rad^2/s^3]
    squared_torque: float  # the same [Nm^2 s]
    kinetic_energy: float  # integral of 1/2 dq' M dq over time [J s]
    elbow: float  # length of the elbow's path [m]
    violation: str  # the first joint that goes beyond a limit, how and when; empty for none
    finished: bool  # whether the last point was reached
    ending: str  # how the motion ended, in words

    @classmethod
    def of(cls, recording: Recording, model: RobotModel) -> 'Effort':
        """The effort of a motion of at least one tick."""
        T = recording.T
        q = recording.vectors('q1')
        dq = recording.vectors('dq1')
        energies, elbow = model.energies_and_positions(q, dq, model.arm.elbow_frame)
        return cls(
            recording.peak('joint_acceleration_norm')[0],
            recording.peak('joint_velocity_norm')[0],
            recording.peak('joint_torque_norm')[0],
            squared_acceleration=T * float(np.sum(recording['joint_acceleration_norm'] ** 2)),
            squared_torque=T * float(np.sum(recording['joint_torque_norm'] ** 2)),
            kinetic_energy=T * float(energies.sum()),
            elbow=float(np.linalg.norm(np.diff(elbow, axis=0), axis=1).sum()),  # (ticks, 3)
            violation=first_violation(recording, JointLimits.of(model.arm)),
            finished=recording.finished,
            ending=recording.ending,
        )


def first_violation(recording: Recording, limits: JointLimits) -> str:
    """The first joint beyond one of its limits, how and when; empty if all are kept. The motion
    began at rest.
    """
    q = recording.vectors('q1')
    tolerance = np.nan_to_num(_ROUNDING * (limits.upper - limits.lower), posinf=0.0)  # (n,)
    more = 1.0 + _ROUNDING
    beyond = {
        'position': (q < limits.lower - tolerance) | (q > limits.upper + tolerance),
        'velocity': np.abs(recording.vectors('dq1')) > more * limits.velocity,
        'acceleration': np.abs(recording.accelerations) > more * limits.acceleration,
    }
    found = []
    for kind, where in beyond.items():
        if where.any():
            tick, joint = np.argwhere(where)[0]
            found.append((float(recording['t'][tick]), f'{limits.joint_names[joint]} {kind}'))
    if not found:
        return ''
    t, what = min(found)
    return f'{what}, {t:.2f} s'


def velocity_usage(recording: Recording, model: RobotModel) -> np.ndarray:
    """Velocity of the joint nearest to its limit, or beyond, as a fraction of it, (ticks,)."""
    usage = np.abs(recording.vectors('dq1')) / JointLimits.of(model.arm).velocity
    return usage.max(axis=1)


def acceleration_usage(recording: Recording, model: RobotModel) -> np.ndarray:
    """Acceleration of the joint nearest to its limit, or beyond, as a fraction of it, (ticks,)."""
    usage = np.abs(recording.accelerations) / JointLimits.of(model.arm).acceleration
    return usage.max(axis=1)
