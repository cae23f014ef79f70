"""A motion as a table of one row a tick, simulated or recorded, and what it demands of the arm."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from redres_ros.command import VALUES, Command, norm
from redres_ros.files.text import writing
from redres_ros.planning.planner import Reference
from redres_ros.robot_model import RobotModel
from redres_ros.types import Jacobian, Seconds

_SINGULAR = 'min_singular_value'
_FIGURES = [VALUES[name] for name in VALUES if name not in (_SINGULAR, 'task_scaling')]
_ROUNDING = 1e-9  # fraction of a limit by which rounding may exceed it


def columns(n: int, pose: bool = False) -> tuple[str, ...]:
    """Column names for n joints; figures are in s, rad, m and Nm."""
    joints = range(1, n + 1)
    q = [f'q{i}' for i in joints]
    dq = [f'dq{i}' for i in joints]
    errors = ['task_error', 'orientation_error'] if pose else ['task_error']
    return ('t', *q, *dq, 'x', 'y', 'z', 'x_d', 'y_d', 'z_d', *errors, *VALUES, 'segment')


class MotionRecorder:
    """Collects the ticks of a motion."""

    def __init__(self, model: RobotModel, T: Seconds, pose: bool = False) -> None:
        self._n = model.n
        self._T = T
        self._pose = pose
        self._rows: list[tuple[float, ...]] = []
        self._jacobians: list[Jacobian] = []

    def add(self, t: Seconds, command: Command, reference: Reference, scaling: float) -> None:
        """Record a tick, with the fraction of the nominal task velocity that was executed."""
        errors = [norm(reference.error)]
        if reference.orientation_error is not None:
            errors.append(norm(reference.orientation_error))
        x = reference.x_d - reference.error
        figures = [figure(command) for figure in _FIGURES]
        vectors = np.concatenate((command.state.q, command.dq, x, reference.x_d)).tolist()
        row = (t, *vectors, *errors, *figures, np.nan, scaling, reference.segment)
        self._rows.append(row)  # recording() fills in what is nan
        self._jacobians.append(command.J)

    def recording(self, ending: str, *, finished: bool = False) -> 'Recording':
        """The motion so far, and how it ended, in words."""
        names = columns(self._n, self._pose)
        data = np.array(self._rows).reshape(-1, len(names))
        if self._jacobians:  # all at once takes a third of the time
            sigma = np.linalg.svd(self._jacobians, compute_uv=False)  # (ticks, m)
            data[:, names.index(_SINGULAR)] = sigma[:, -1]
        return Recording(data, self._n, self._T, finished, ending, self._pose)


@dataclass(frozen=True)
class Recording:
    """A motion, one row a tick: data (ticks, columns) of n joints."""

    data: np.ndarray
    n: int
    T: Seconds
    finished: bool  # whether the last point was reached
    ending: str  # how it ended, in words
    pose: bool = False  # whether the task has orientations

    @property
    def _columns(self) -> tuple[str, ...]:
        return columns(self.n, self.pose)

    def __getitem__(self, name: str) -> np.ndarray:
        """One column, (ticks,)."""
        return self.data[:, self._columns.index(name)]

    def vectors(self, first: str) -> np.ndarray:
        """A vector by its first column: 'q1' or 'dq1' give (ticks, n), 'x' or 'x_d' (ticks, 3)."""
        start = self._columns.index(first)
        return self.data[:, start : start + (3 if first in ('x', 'x_d') else self.n)]

    def peak(self, name: str) -> tuple[float, float]:
        """Largest value of a column and the time [s] at which it occurs."""
        at = int(np.argmax(self[name]))
        return float(self[name][at]), float(self['t'][at])

    def write_csv(self, path: Path) -> None:
        """Write all rows at full precision: reading gives the same bits. Raises FileError."""
        heading = ','.join(self._columns)
        with writing(path):
            np.savetxt(path, self.data, '%.17g', delimiter=',', header=heading, comments='')


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
    def of(cls, recording: Recording, model: RobotModel, *, torque: bool = False) -> 'Effort':
        """The effort of a motion from rest, of at least a tick; `torque`: judge torques, too."""
        T = recording.T
        q = recording.vectors('q1')
        dq = recording.vectors('dq1')
        energy = sum(map(model.kinetic_energy, q, dq))
        elbow = np.array([model.position(q_k, model.arm.elbow_frame) for q_k in q])  # (ticks, 3)
        return cls(
            recording.peak('joint_acceleration_norm')[0],
            recording.peak('joint_velocity_norm')[0],
            recording.peak('joint_torque_norm')[0],
            squared_acceleration=T * float(np.sum(recording['joint_acceleration_norm'] ** 2)),
            squared_torque=T * float(np.sum(recording['joint_torque_norm'] ** 2)),
            kinetic_energy=T * energy,
            elbow=float(np.linalg.norm(np.diff(elbow, axis=0), axis=1).sum()),
            violation=_first_violation(recording, model, torque),
            finished=recording.finished,
            ending=recording.ending,
        )


def _first_violation(recording: Recording, model: RobotModel, with_torque: bool) -> str:
    """The first joint beyond one of its limits, how and when; empty if all are kept."""
    q = recording.vectors('q1')
    dq = recording.vectors('dq1')
    ddq = np.diff(dq, axis=0, prepend=0.0) / recording.T  # from rest, Eq. (13)
    tolerance = _ROUNDING * (model.q_max - model.q_min)  # (n,)
    more = 1.0 + _ROUNDING
    beyond = {
        'position': (q < model.q_min - tolerance) | (q > model.q_max + tolerance),
        'velocity': np.abs(dq) > more * model.dq_max,
        'acceleration': np.abs(ddq) > more * np.array(model.arm.acceleration_limit or np.inf),
    }
    if with_torque:
        before = np.vstack((np.zeros_like(dq[:1]), dq[:-1]))
        tau = np.array(list(map(model.torque, q, before, ddq)))  # Eq. (6)
        beyond['torque'] = np.abs(tau) > more * model.tau_max
    found = []
    for kind, where in beyond.items():
        if where.any():
            tick, joint = np.argwhere(where)[0]
            found.append((float(recording['t'][tick]), f'{model.joint_names[joint]} {kind}'))
    if not found:
        return ''
    t, what = min(found)
    return f'{what}, {t:.2f} s'
