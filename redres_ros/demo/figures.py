"""The figures of a demo: of its motion, of a force, of an operator's goals, of its endurance."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from redres_ros.planning.waypoints import WaypointTask
from redres_ros.simulation.operators import PATIENCE
from redres_ros.simulation.recording import Recording

Rows = list[tuple[str, ...]]  # of a table; one with a single cell is a heading

STILL = 1e-4  # [rad/s] norm of the joint velocities at which the arm counts as standing still

_MOST_GROWTH = 5.0  # [MB] of a node's memory while it does the same again and again
_START = 0.1  # [s] that count as the start
_SETTLING = 1.0  # [s] from the first touch until the force is judged
_NOTICED = 0.1  # [s] within which a change of goals is published


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
        """The figures of a recording.

        Args:
            recording: Recording of at least one tick.
            task: What was asked for.
            final_error: Distance from the last point at the end [m].
        """
        t = recording['t']
        moves = recording['joint_velocity_norm'] > STILL
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

    def rows(self, goals: 'GoalCounts | None') -> Rows:
        """Rows of a table; for a motion that an operator steered to goals, with these."""
        rows: Rows = [('motion',)]
        if goals:
            rows.append(('goals', f'{goals.reached} reached, {goals.given_up} given up'))
        else:
            rows += self._path_rows()
        for name, unit in (('acceleration', 'rad/s²'), ('velocity', 'rad/s'), ('torque', 'Nm')):
            value, at = getattr(self, name)
            rows.append((f'maximum joint {name}', f'{value:.3f} {unit} (norm) at {at:.3f} s'))
        return [
            *rows,
            ('largest step at the start', f'{self.jump:.2g} rad/s of one joint, in one cycle'),
            ('time at rest', f'{self.still:.3f} s, of which {self.delay:.3f} s at the start'),
        ]

    def _path_rows(self) -> Rows:
        deviation, deviation_at = self.path_deviation
        error, error_at = self.error
        return [
            ('segments started', f'{self.segments} in {self.seconds:.3f} s'),
            ('maximum path deviation', f'{1e3 * deviation:.3f} mm at {deviation_at:.3f} s'),
            (
                'maximum error',
                f'{1e3 * error:.3f} mm at {error_at:.3f} s, along the path or off it',
            ),
            ('final error', f'{1e3 * self.final_error:.3f} mm from the last point'),
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
        """The figures; None without a second of contact.

        Args:
            forces: Times [s], and forces [N], (N, 4).
            desired: Force, (3,) [N].
        """
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

    @property
    def rows(self) -> Rows:
        """Rows of a table."""
        error = f'{self.rms:.3f} N RMS, at most {self.largest:.3f} N'
        return [
            ('pressing',),
            ('error of the force', f'{error}, from {_SETTLING:g} s after the first touch on'),
            ('peak at first', f'{self.peak:.2f} N'),
            ('states without contact', f'{self.contact_lost} after the first touch'),
        ]


@dataclass(frozen=True)
class GoalCounts:
    """How many of an operator's goals were reached, and given up."""

    reached: int
    given_up: int

    @classmethod
    def of(cls, recording: Recording) -> 'GoalCounts':
        """The counts of a recording whose segments are goals; the last one does not count."""
        t = recording['t']
        changes = np.flatnonzero(np.diff(recording['segment']))
        seconds = np.diff(t[changes], prepend=0.0)
        given_up = int(np.count_nonzero(seconds > PATIENCE - _NOTICED))
        return cls(len(changes) - given_up, given_up)


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

    @property
    def rows(self) -> Rows:
        """Rows of a table."""
        rows: Rows = [('endurance',), ('rounds', f'{self.rounds} in {self.seconds:.0f} s')]
        for name, (start, end) in self.memory.items():
            text = f'{start:.1f} MB after the first round, {end:.1f} MB at the end'
            rows.append((f'memory of {name}', text))
        return rows

    @property
    def steady(self) -> bool:
        """Whether no process has grown more than an interpreter usually does."""
        return all(end - start < _MOST_GROWTH for start, end in self.memory.values())
