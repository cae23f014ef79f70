"""A motion as a table: one row a tick, the same columns whether it was simulated or recorded from
the nodes.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from redres_ros.command import FIGURES, Command
from redres_ros.files.text import writing
from redres_ros.planning.planner import Reference

_BLOCK = 100  # ticks: so many commands, with their states, stay in a processor's cache
_NEAR = 1e-2  # ratio of singular values below which their squares have lost too many digits


def columns(n: int, pose: bool = False) -> tuple[str, ...]:
    """Column names; positions [rad], velocities [rad/s], lengths [m], torque [Nm], time [s].

    Args:
        n: Number of joints.
        pose: Whether the task has an orientation.
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
        *FIGURES,
        'segment',
    )


class MotionRecorder:
    """Collects the ticks of a motion; figures are computed in arrays, many ticks at a time.

    Args:
        n: Number of joints.
        T: Sampling time [s].
        pose: Whether the task has orientations.
    """

    def __init__(self, n: int, T: float, pose: bool = False) -> None:
        self._n = n
        self._T = T
        self._pose = pose
        self._ticks: list[tuple[float, Command, Reference]] = []  # whose figures are to be computed
        self._blocks: list[np.ndarray] = [np.empty((0, len(columns(n, pose))))]

    def add(self, t: float, command: Command, reference: Reference) -> None:
        """Add a tick.

        Args:
            t: Time [s].
            command: Of this tick.
            reference: Where the task is.
        """
        command.state.x  # noqa: B018 (while the model has the arm there, it costs little)
        self._ticks.append((t, command, reference))
        if len(self._ticks) == _BLOCK:
            self._compute()

    def recording(self, ending: str, *, finished: bool = False) -> 'Recording':
        """The motion so far.

        Args:
            ending: How it ended, in words.
            finished: Whether the last point was reached.
        """
        if self._ticks:
            self._compute()
        data = np.concatenate(self._blocks)
        return Recording(data, self._n, self._T, finished, ending, self._pose)

    def _compute(self) -> None:
        self._blocks.append(_block(self._ticks, self._pose))
        self._ticks.clear()


def _block(ticks: Sequence[tuple[float, Command, Reference]], pose: bool) -> np.ndarray:
    """Ticks in the order of `columns`, (ticks, columns); all norms are Euclidean."""
    times, commands, references = zip(*ticks, strict=True)
    states = [command.state for command in commands]
    T = np.array([[command.T] for command in commands])  # (ticks, 1) [s]
    dq = np.array([command.dq for command in commands])  # (ticks, n)
    ddq = (dq - np.array([state.dq_prev for state in states])) / T  # Eq. (13)
    moves = zip(states, ddq, strict=True)
    tau = [state.model.torque(state.q, state.dq_prev, each) for state, each in moves]  # Eq. (6)
    J = np.array([command.J for command in commands])  # (ticks, m, n)
    squares = J @ J.transpose(0, 2, 1)  # J J', in a quarter of the time of singular values
    eigenvalues = np.linalg.eigvalsh(squares)  # (ticks, m), the least first
    is_near = eigenvalues[:, 0] <= _NEAR**2 * eigenvalues[:, -1]
    sigma = np.sqrt(np.maximum(eigenvalues[:, 0], 0.0))
    sigma[is_near] = np.linalg.svd(J[is_near], compute_uv=False)[:, -1]
    figures = {
        'joint_velocity_norm': _norms(dq),
        'joint_acceleration_norm': _norms(ddq),
        'null_velocity_norm': _norms(_null_velocities(commands, dq, J, squares, is_near)),
        'joint_torque_norm': _norms(tau),
        'min_singular_value': sigma,
        'task_scaling': np.array([command.s for command in commands]),
    }
    turns = [_norms([each.orientation_error for each in references])] if pose else []
    vectors = [
        np.array(times),
        np.array([state.q for state in states]),
        dq,
        np.array([state.x for state in states]),
        np.array([reference.x_d for reference in references]),
        _norms([reference.error for reference in references]),
        *turns,
        *(figures[name] for name in FIGURES),
        np.array([reference.segment for reference in references]),
    ]
    return np.column_stack(vectors)


def _null_velocities(
    commands: Sequence[Command],
    dq: np.ndarray,
    J: np.ndarray,
    squares: np.ndarray,
    is_near: np.ndarray,
) -> np.ndarray:
    """Their null-space terms, (ticks, n) [rad/s]: dq - J' (J J')^-1 J dq in arrays where the weight
    is the identity and J is far from singular.

    Args:
        commands: One a tick.
        dq: Theirs, (ticks, n) [rad/s].
        J: Theirs, (ticks, m, n).
        squares: J J', (ticks, m, m).
        is_near: Whether J is near a singularity, (ticks,).
    """
    alone = is_near | np.array([command.W is not None for command in commands])
    far = ~alone
    dx = np.einsum('kmi,ki->km', J[far], dq[far])
    forces = np.linalg.solve(squares[far], dx[..., None])[..., 0]
    null = dq.copy()
    null[far] -= np.einsum('kmi,km->ki', J[far], forces)
    for k in np.flatnonzero(alone).tolist():
        null[k] = commands[k].null
    return null


def _norms(vectors: Any) -> np.ndarray:
    """Euclidean norms of vectors (ticks, n), (ticks,)."""
    rows = np.asarray(vectors)
    squares = np.einsum('ki,ki->k', rows, rows)
    return np.sqrt(squares)


@dataclass(frozen=True)
class Recording:
    """A motion, one row a tick.

    Attributes:
        data: (ticks, columns).
        n: Number of joints.
        T: Sampling time [s].
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
            path.parent.mkdir(parents=True, exist_ok=True)
            np.savetxt(
                path,
                self.data,
                fmt='%.17g',
                delimiter=',',
                header=','.join(self.columns),
                comments='',
            )
