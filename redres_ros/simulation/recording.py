"""A motion as a table: one row a tick, the same columns whether it was simulated or recorded from
the nodes.
"""

from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from redres_ros.command import FIGURES, Command, norm
from redres_ros.errors import FileError
from redres_ros.planning.planner import Reference


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


def row(t: float, command: Command, reference: Reference) -> list[float]:
    """One tick in the order of `columns`; all norms are Euclidean.

    Args:
        t: Time [s].
        command: Of this tick.
        reference: Where the task is.
    """
    state = command.state
    turn_left = reference.orientation_error
    return [
        t,
        *state.q,
        *command.dq,
        *state.x,
        *reference.x_d,
        norm(reference.error),
        *(() if turn_left is None else (norm(turn_left),)),
        *(figure(command) for figure in FIGURES.values()),
        reference.segment,
    ]


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

    @classmethod
    def of(
        cls,
        rows: Iterable[list[float]],
        n: int,
        T: float,
        finished: bool,
        ending: str,
        pose: bool = False,
    ) -> 'Recording':
        """A recording of rows.

        Args:
            rows: As `row` makes them.
            n: Number of joints.
            T: Sampling time [s].
            finished: Whether the last point was reached.
            ending: How it ended, in words.
            pose: Whether the task has orientations.
        """
        data = np.array(list(rows), dtype=np.float64).reshape(-1, len(columns(n, pose)))
        return cls(data, n, T, finished, ending, pose)

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

    def peak(self, name: str) -> tuple[float, float]:
        """Largest value of a column and the time [s] at which it occurs."""
        at = int(np.argmax(self[name]))
        return float(self[name][at]), float(self['t'][at])

    def write_csv(self, path: Path) -> None:
        """All rows with a heading, at full precision: reading them back gives the same bits. Raises
        FileError.
        """
        try:
            path.parent.mkdir(parents=True, exist_ok=True)
            np.savetxt(
                path,
                self.data,
                fmt='%.17g',
                delimiter=',',
                header=','.join(self.columns),
                comments='',
            )
        except OSError as error:
            raise FileError(f'cannot write {path}: {error.strerror}') from None
