"""The outcome of a demo in figures: a table for the terminal, and a summary in a file."""

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from rich.table import Table

from redres_ros.files.text import write_json
from redres_ros.planning.waypoints import WaypointTask
from redres_ros.simulation.recording import Recording
from redres_ros.simulation.report import facts

_Rows = list[tuple[str, ...]]  # of a table; one with a single cell is a heading

_STILL = 1e-4  # [rad/s] norm of the joint velocities at which the arm counts as standing still
_START = 0.1  # [s] that count as the start
_SETTLING = 1.0  # [s] from the first touch until the force is judged
_MOST_GROWTH = 5.0  # [MB] of a node's memory while it does the same again and again
_QUIET = 0.95  # fraction of commands in time on a computer that does nothing else
# What a robot does in its session states.
_MEANS = {'MON': ' (only reports)', 'CMD': ' (takes commands)'}


@dataclass(frozen=True)
class MotionFigures:
    """A recording in a few figures; a peak is (value, time [s]).

    Attributes:
        seconds: How long it took.
        segments: How many the task has been on.
        error: Error of the task, also where the arm only lags on its path [m].
        path_deviation: Distance from the straight line from point to point [m].
        final_error: Distance from the last point when the run ended [m].
        acceleration: Norm over the joints [rad/s^2].
        velocity: Norm over the joints [rad/s].
        torque: Norm over the joints [Nm].
        jump: Largest change of a joint's velocity within a cycle at the start [rad/s].
        delay: Until the arm began to move [s].
        still: Time without motion, that included [s].
    """

    seconds: float
    segments: int
    error: tuple[float, float]
    path_deviation: tuple[float, float]
    final_error: float
    acceleration: tuple[float, float]
    velocity: tuple[float, float]
    torque: tuple[float, float]
    jump: float
    delay: float
    still: float

    @classmethod
    def of(cls, recording: Recording, task: WaypointTask, final_error: float) -> 'MotionFigures':
        """The figures of a recording of at least one tick."""
        t = recording['t']
        moves = recording['joint_velocity_norm'] > _STILL
        dq = recording.vectors('dq1')  # (N, n)
        steps = np.abs(np.diff(dq, axis=0, prepend=0.0))  # from rest
        path_deviation = task.path_deviation(recording.vectors('x'), recording['segment'])
        farthest = int(np.argmax(path_deviation))
        return cls(
            seconds=float(t[-1]),
            segments=int(recording['segment'].max()),
            error=recording.peak('task_error'),
            path_deviation=(float(path_deviation[farthest]), float(t[farthest])),
            final_error=final_error,
            acceleration=recording.peak('joint_acceleration_norm'),
            velocity=recording.peak('joint_velocity_norm'),
            torque=recording.peak('joint_torque_norm'),
            jump=float(steps[t <= _START].max()),
            delay=float(t[np.argmax(moves)] if moves.any() else t[-1]),
            still=recording.T * int(np.count_nonzero(~moves)),
        )

    def rows(self) -> _Rows:
        """Rows of a table."""
        deviation, deviation_at = self.path_deviation
        error, error_at = self.error
        rows: _Rows = [
            ('motion',),
            ('segments started', f'{self.segments} in {self.seconds:.3f} s'),
            ('maximum path deviation', f'{1e3 * deviation:.3f} mm at {deviation_at:.3f} s'),
            (
                'maximum error',
                f'{1e3 * error:.3f} mm at {error_at:.3f} s, along the path or off it',
            ),
            ('final error', f'{1e3 * self.final_error:.3f} mm from the last point'),
        ]
        for name, unit in (('acceleration', 'rad/s²'), ('velocity', 'rad/s'), ('torque', 'Nm')):
            value, at = getattr(self, name)
            rows.append((f'maximum joint {name}', f'{value:.3f} {unit} (norm) at {at:.3f} s'))
        return [
            *rows,
            ('largest step at the start', f'{self.jump:.2g} rad/s of one joint, in one cycle'),
            ('time at rest', f'{self.still:.3f} s, of which {self.delay:.3f} s at the start'),
        ]


@dataclass(frozen=True)
class PressingFigures:
    """How well a desired force was kept, along its direction.

    Attributes:
        rms: RMS of its error, from a second after the first touch on [N].
        largest: Error then [N].
        peak: Force before [N].
        contact_lost: Number of states without contact after the first touch.
    """

    rms: float
    largest: float
    peak: float
    contact_lost: int

    @classmethod
    def of(cls, forces: np.ndarray, desired: np.ndarray) -> 'PressingFigures | None':
        """The figures of times [s] and forces [N], (N, 4); None without a second of contact."""
        size = float(np.linalg.norm(desired))
        force = forces[:, 1:] @ desired / size
        touched = np.cumsum(force > 0.0) > 0
        t = forces[:, 0] - forces[touched, 0].min(initial=np.inf)
        errors = force[t >= _SETTLING] - size
        if not errors.size:
            return None
        return cls(
            rms=float(np.sqrt(np.mean(errors**2))),
            largest=float(np.abs(errors).max()),
            peak=float(force[t < _SETTLING].max()),
            contact_lost=int(np.count_nonzero(force[touched] <= 0.0)),
        )

    def rows(self) -> _Rows:
        """Rows of a table."""
        error = f'{self.rms:.3f} N RMS, at most {self.largest:.3f} N'
        return [
            ('pressing',),
            ('error of the force', f'{error}, from {_SETTLING:g} s after the first touch on'),
            ('peak at first', f'{self.peak:.2f} N'),
            ('states without contact', f'{self.contact_lost} after the first touch'),
        ]


@dataclass(frozen=True)
class Endurance:
    """The outcome of a repeated task.

    Attributes:
        rounds: How often.
        seconds: Duration on the robot's clock.
        memory: Memory of each node's process after the first round and at the end [MB].
    """

    rounds: int
    seconds: float
    memory: Mapping[str, tuple[float, float]]

    def rows(self) -> _Rows:
        """Rows of a table."""
        rows: _Rows = [('endurance',), ('rounds', f'{self.rounds} in {self.seconds:.0f} s')]
        for name, (start, end) in self.memory.items():
            text = f'{start:.1f} MB after the first round, {end:.1f} MB at the end'
            rows.append((f'memory of {name}', text))
        return rows

    def is_steady(self) -> bool:
        """Whether no process has grown more than an interpreter usually does."""
        return all(end - start < _MOST_GROWTH for start, end in self.memory.values())


@dataclass(frozen=True)
class Outcome:
    """The outcome of a demo.

    Attributes:
        recording: Recording of the task.
        motion: Its figures; None if it did not begin.
        cycles: The robot's cycles by outcome, see `count_cycles`; None if the task did not begin.
        stop_reason: Why the robot stopped itself; empty if it did not.
        session: Its states, in order.
        planner_missed: Number of states that the planner did not get.
        switches: (time [s], law before, law after).
        endurance: Figures of a repeated task; None if it was not repeated.
        interrupted: Whether Ctrl-C ended it.
        forces: Times [s], and forces of the environment on the tip in the base frame [N], (N, 4);
            none without a controller that yields.
        desired_force: Desired force; empty: none.
    """

    recording: Recording
    motion: MotionFigures | None
    cycles: Mapping[str, float] | None
    stop_reason: str
    session: tuple[str, ...]
    planner_missed: int = 0
    switches: tuple[tuple[float, str, str], ...] = ()
    endurance: Endurance | None = None
    interrupted: bool = False
    forces: np.ndarray = field(default_factory=lambda: np.zeros((0, 4)))
    desired_force: Sequence[float] = ()

    @property
    def succeeded(self) -> bool:
        """Whether a robot that was not stopped reached the last point, and no node has grown."""
        steady = self.endurance is None or self.endurance.is_steady()
        return self.recording.finished and not self.stop_reason and not self.interrupted and steady

    def table(self, title: str) -> Table:
        """The summary that ends a demo."""
        rows: _Rows = [
            ('task', self._ending()),
            ('robot', f'stopped: {self.stop_reason}' if self.stop_reason else 'not stopped'),
            ("robot's session", ' > '.join(word + _MEANS.get(word, '') for word in self.session)),
        ]
        for figures in (self.motion, self._pressing()):
            rows += figures.rows() if figures else []
        if self.cycles:
            rows += [
                *_cycle_rows(self.cycles),
                ('not seen by the planner', f'{self.planner_missed}'),
            ]
        if self.endurance:
            rows += self.endurance.rows()
        return facts(rows, title=title)

    def write_json(self, path: Path) -> None:
        """Write the same figures in SI units. Raises FileError."""
        content: dict[str, Any] = {
            'task': self._ending(),
            'stop_reason': self.stop_reason,
            'session': self.session,
            'switches': self.switches,
            'planner_missed': self.planner_missed,
            'cycles': self.cycles,
        }
        figures = {'motion': self.motion, 'pressing': self._pressing(), 'endurance': self.endurance}
        content |= {name: asdict(each) if each else None for name, each in figures.items()}
        write_json(content, path)

    def _ending(self) -> str:
        if self.interrupted:
            return 'interrupted'
        if self.stop_reason or not self.recording.finished:
            return 'NOT finished'
        return 'finished' if self.succeeded else 'finished, but a node has grown'

    def _pressing(self) -> PressingFigures | None:
        if not any(self.desired_force):
            return None
        return PressingFigures.of(self.forces, np.array(self.desired_force[:3]))


def _cycle_rows(cycles: Mapping[str, float]) -> _Rows:
    labels = {
        'in_time': 'commands in time',
        'waited_for': 'late, and the clock waited',
        'late': 'commands too late',
        'missed': 'commands missing',
    }
    total = sum(cycles[kind] for kind in labels)
    rows: _Rows = [
        ('cycles of the robot',),
        ('total', f'{total}; the simulated clock paused for {cycles["stood_still"]:.3f} s'),
    ]
    for kind, label in labels.items():
        rows.append((label, f'{cycles[kind]} ({cycles[kind] / max(total, 1):.2%})'))
    if cycles['in_time'] < _QUIET * total:
        rows.append(('why', 'this computer was busy; no motion is lost while the clock pauses'))
    return rows
