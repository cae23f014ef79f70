"""A motion as a table: one row a tick, the same columns whether it was simulated or recorded from
the nodes.
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
from redres_ros.types import Seconds

_BLOCK = 400  # ticks: of more, a tick takes no less time
_NEAR = 1e-2  # ratio of singular values below which their squares have lost too many digits


def columns(n: int, pose: bool = False) -> tuple[str, ...]:
    """Column names, for n joints; positions [rad], velocities [rad/s], lengths [m], torque [Nm],
    time [s].
    """
    joints = range(1, n + 1)
    return (
        't',
        *(f'q{i}' for i in joints),
        *(f'dq{i}' for i in joints),
        'x',
        'y',
        'z',
        'x_d',
        'y_d',
        'z_d',
        'task_error',
        *(('orientation_error',) if pose else ()),
        *VALUES,
        'segment',
    )


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
    """A motion, one row a tick: data (ticks, columns) of n joints.

    Attributes:
        finished: Whether the last point was reached.
        ending: How it ended, in words.
        pose: Whether the task has orientations.
    """

    data: np.ndarray
    n: int
    T: float
    finished: bool
    ending: str
    pose: bool = False

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

    @property
    def accelerations(self) -> np.ndarray:
        """(dq_k - dq_{k-1}) / T from rest, Eq. (13), (ticks, n) [rad/s^2]."""
        return np.diff(self.vectors('dq1'), axis=0, prepend=0.0) / self.T

    def peak(self, name: str) -> tuple[float, float]:
        """Largest value of a column and the time [s] at which it occurs."""
        at = int(np.argmax(self[name]))
        return float(self[name][at]), float(self['t'][at])

    def write_csv(self, path: Path) -> None:
        """All rows with a heading, at full precision: reading them back gives the same bits. Raises
        FileError.
        """
        with writing(path):
            np.savetxt(
                path,
                self.data,
                fmt='%.17g',
                delimiter=',',
                header=','.join(self.columns),
                comments='',
            )
