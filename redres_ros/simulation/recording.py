"""A motion as a table, the same whether it was simulated or recorded from the nodes: one row a
tick; and what it demands of the arm.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from redres_ros.command import VALUES, Command, norms
from redres_ros.files.text import writing
from redres_ros.planning.planner import Reference
from redres_ros.resolution import Weight, resolve_one
from redres_ros.robot_model import RobotModel
from redres_ros.robots.joint_limits import JointLimits
from redres_ros.types import Seconds

_BLOCK = 400  # ticks: of more, a tick takes no less time
_NEAR = 1e-2  # ratio of singular values below which their squares have lost too many digits
_ROUNDING = 1e-9  # fraction of a limit by which rounding may exceed it


def columns(n: int, pose: bool = False) -> tuple[str, ...]:
    """Column names, for n joints; positions [rad], velocities [rad/s], lengths [m], torque [Nm],
    time [s].
    """
    joints = range(1, n + 1)
    q = [f'q{i}' for i in joints]
    dq = [f'dq{i}' for i in joints]
    errors = ['task_error', 'orientation_error'] if pose else ['task_error']
    return ('t', *q, *dq, 'x', 'y', 'z', 'x_d', 'y_d', 'z_d', *errors, *VALUES, 'segment')


class MotionRecorder:
    """Collects the ticks of a motion; figures are computed in arrays, many ticks at a time."""

    def __init__(self, model: RobotModel, T: Seconds, pose: bool = False) -> None:
        self._model = model
        self._T = T
        self._pose = pose
        # Of the ticks whose figures are to be computed, one after the other.
        self._weights: list[Weight] = []
        self._scalars: list[float] = []
        self._vectors: list[np.ndarray] = []
        self._blocks: list[np.ndarray] = [np.empty((0, len(columns(model.n, pose))))]

    def add(self, t: Seconds, command: Command, reference: Reference) -> None:
        state = command.state
        turn_left = (reference.orientation_error,) if self._pose else ()
        self._weights.append(command.W)
        self._scalars += (t, command.T, command.s, reference.segment)
        self._vectors += (state.q, state.dq_prev, command.dq)
        self._vectors += (reference.x_d, reference.error, *turn_left, command.J.ravel())
        if len(self._weights) == _BLOCK:
            self._compute()

    def recording(self, ending: str, *, finished: bool = False) -> 'Recording':
        """The motion so far, and how it ended, in words."""
        if self._weights:
            self._compute()
        data = np.concatenate(self._blocks)
        return Recording(data, self._model.n, self._T, finished, ending, self._pose)

    def _compute(self) -> None:
        """Compute the rows of the ticks since the last block; all norms are Euclidean."""
        n = self._model.n
        t, T, s, segment = np.array(self._scalars).reshape(-1, 4).T
        table = np.concatenate(self._vectors).reshape(len(t), -1)
        ends = np.cumsum((n, n, n, 3, 3, 3 if self._pose else 0))
        q, dq_prev, dq, x_d, error, turn_left, J = np.split(table, ends, axis=1)
        ddq = (dq - dq_prev) / T[:, None]  # Eq. (13)
        tau = list(map(self._model.torque, q, dq_prev, ddq))  # Eq. (6)
        null, sigma = _null_velocities(J.reshape(len(t), -1, n), dq, self._weights)
        figures = {
            'joint_velocity_norm': norms(dq),
            'joint_acceleration_norm': norms(ddq),
            'null_velocity_norm': norms(null),
            'joint_torque_norm': norms(tau),
            'min_singular_value': sigma,
            'task_scaling': s,
        }
        errors = [norms(error), norms(turn_left)] if self._pose else [norms(error)]
        ordered = [figures[name] for name in VALUES]
        block = np.column_stack((t, q, dq, x_d - error, x_d, *errors, *ordered, segment))
        self._blocks.append(block)
        self._weights.clear()
        self._scalars.clear()
        self._vectors.clear()


def _null_velocities(
    J: np.ndarray, dq: np.ndarray, weights: Sequence[Weight]
) -> tuple[np.ndarray, np.ndarray]:
    """The null-space terms of Eq. (2), (ticks, n) [rad/s], and the smallest singular values of J,
    (ticks,).

    The terms are dq - J' (J J')^-1 J dq, in arrays, where the weight is the identity and J
    (ticks, m, n) is far from singular.
    """
    squares = J @ J.transpose(0, 2, 1)  # J J', in a quarter of the time of singular values
    eigenvalues = np.linalg.eigvalsh(squares)  # (ticks, m), the least first
    is_near = eigenvalues[:, 0] <= _NEAR**2 * eigenvalues[:, -1]
    sigma = np.sqrt(np.maximum(eigenvalues[:, 0], 0.0))
    sigma[is_near] = np.linalg.svd(J[is_near], compute_uv=False)[:, -1]
    alone = is_near | np.array([W is not None for W in weights])
    far = ~alone
    dx = np.einsum('kmi,ki->km', J[far], dq[far])
    forces = np.linalg.solve(squares[far], dx[..., None])[..., 0]
    null = dq.copy()
    null[far] -= np.einsum('kmi,km->ki', J[far], forces)
    rest = np.zeros(J.shape[1])
    for k in np.flatnonzero(alone).tolist():
        null[k], _ = resolve_one(J[k], rest, dq[k], weights[k])
    return null, sigma


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
    def columns(self) -> tuple[str, ...]:
        """Names of the columns."""
        return columns(self.n, self.pose)

    def __getitem__(self, name: str) -> np.ndarray:
        """One column, (ticks,)."""
        return self.data[:, self.columns.index(name)]

    def vectors(self, first: str) -> np.ndarray:
        """The columns of a vector by its first one: 'q1' and 'dq1' give (ticks, n), 'x' and 'x_d'
        give (ticks, 3).
        """
        start = self.columns.index(first)
        return self.data[:, start : start + (3 if first in ('x', 'x_d') else self.n)]

    def rows_at(self, times: np.ndarray) -> np.ndarray:
        """Indices of the rows at some times (N,) [s], the last one for all later times, (N,)."""
        rows: np.ndarray = np.minimum(np.searchsorted(self['t'], times), len(self.data) - 1)
        return rows

    def peak(self, name: str) -> tuple[float, float]:
        """Largest value of a column and the time [s] at which it occurs."""
        at = int(np.argmax(self[name]))
        return float(self[name][at]), float(self['t'][at])

    def write_csv(self, path: Path) -> None:
        """All rows with a heading, at full precision: reading them back gives the same bits. Raises
        FileError.
        """
        heading = ','.join(self.columns)
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
    def of(cls, recording: Recording, model: RobotModel) -> 'Effort':
        """The effort of a motion of at least one tick, which began at rest."""
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
            violation=_first_violation(recording, JointLimits.of(model.arm)),
            finished=recording.finished,
            ending=recording.ending,
        )


def limit_usage(recording: Recording, model: RobotModel) -> tuple[np.ndarray, np.ndarray]:
    """Velocity and acceleration of the joint nearest to its limit, or beyond, as fractions of it,
    (ticks,) each.
    """
    limits = JointLimits.of(model.arm)
    velocity = np.abs(recording.vectors('dq1')) / limits.velocity
    acceleration = np.abs(_accelerations(recording)) / limits.acceleration
    return velocity.max(axis=1), acceleration.max(axis=1)


def _first_violation(recording: Recording, limits: JointLimits) -> str:
    """The first joint beyond one of its limits, how and when; empty if all are kept."""
    q = recording.vectors('q1')
    tolerance = np.nan_to_num(_ROUNDING * (limits.upper - limits.lower), posinf=0.0)  # (n,)
    more = 1.0 + _ROUNDING
    beyond = {
        'position': (q < limits.lower - tolerance) | (q > limits.upper + tolerance),
        'velocity': np.abs(recording.vectors('dq1')) > more * limits.velocity,
        'acceleration': np.abs(_accelerations(recording)) > more * limits.acceleration,
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


def _accelerations(recording: Recording) -> np.ndarray:
    """(dq_k - dq_{k-1}) / T from rest, Eq. (13), (ticks, n) [rad/s^2]."""
    return np.diff(recording.vectors('dq1'), axis=0, prepend=0.0) / recording.T
