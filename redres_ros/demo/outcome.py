"""The outcome of a demo: figures, text, and a file."""

import json
import math
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field
from pathlib import Path

import numpy as np
from rich.table import Table

from redres_ros.demo.cycles import CycleCounts
from redres_ros.files.text import writing
from redres_ros.planning.waypoints import WaypointTask
from redres_ros.simulation.operators import PATIENCE
from redres_ros.simulation.recording import Recording
from redres_ros.simulation.report import facts

MOST_GROWTH = 5.0  # [MB] of a node's memory while it does the same again and again
STILL = 1e-4  # [rad/s] norm of the joint velocities at which the arm counts as standing still

_START = 0.1  # [s] that count as the start
_SETTLING = 1.0  # [s] from the first touch until the force is judged
_NOTICED = 0.1  # [s] within which a change of goals is published
_QUIET = 0.95  # of the commands are in time on a computer that does nothing else

# What a robot does in its session states, for those who do not know their names.
_MEANS = {'MON': ' (only reports)', 'CMD': ' (takes commands)'}


@dataclass(frozen=True)
class Endurance:
    """The outcome of a repeated task.

    Attributes:
        rounds: How often.
        seconds: For how long, on the robot's clock.
        memory: Of each node's process after the first round and at the end [MB].
    """

    rounds: int
    seconds: float
    memory: Mapping[str, tuple[float, float]]

    @property
    def steady(self) -> bool:
        """Whether no process has grown more than an interpreter usually does."""
        return all(end - start < MOST_GROWTH for start, end in self.memory.values())


@dataclass(frozen=True)
class Ending:
    """How a run ended.

    Attributes:
        endurance: Where the task was repeated to the end.
        interrupted: By Ctrl-C.
        last: Stamp of the last state that counts [ns].
    """

    endurance: Endurance | None
    interrupted: bool
    last: float = math.inf


@dataclass(frozen=True)
class MotionFigures:
    """A recording in a few figures; a peak is (value, time [s]).

    Attributes:
        seconds: How long it took.
        segments: How many the task has been on.
        error: Of the task, also where the arm only lags on its path [m].
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
            recording: Of at least one tick.
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


@dataclass(frozen=True)
class PressingFigures:
    """How well a desired force was kept, along its direction.

    Attributes:
        rms: Of its error, from a second after the first touch on [N].
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


@dataclass(frozen=True)
class GoalCounts:
    """What became of an operator's goals."""

    reached: int
    given_up: int

    @classmethod
    def of(cls, recording: Recording) -> 'GoalCounts':
        """Of a recording, in which each goal is a segment. The last one counts for neither."""
        t = recording['t']
        changes = np.flatnonzero(np.diff(recording['segment']))
        seconds = np.diff(t[changes], prepend=0.0)
        given_up = int(np.count_nonzero(seconds > PATIENCE - _NOTICED))
        return cls(len(changes) - given_up, given_up)


@dataclass(frozen=True)
class Outcome:
    """The outcome of a demo.

    Attributes:
        recording: Of the task.
        motion: Its figures; None where it did not begin.
        cycles: What became of the robot's cycles; None where the task did not begin.
        stop_reason: The robot's own words; empty if it was not stopped.
        session: Its states, as they were passed through.
        planner_missed: States that the planner did not get.
        switches: (time [s], law before, law after).
        endurance: Where the task was repeated to the end.
        interrupted: By Ctrl-C.
        goals: Of an operator; None for a task.
        forces: Times [s], and forces of the environment on the tip in the base frame [N], (N, 4);
            none without a controller that yields.
        desired_force: Of them; empty: none.
    """

    recording: Recording
    motion: MotionFigures | None
    cycles: CycleCounts | None
    stop_reason: str
    session: tuple[str, ...]
    planner_missed: int = 0
    switches: tuple[tuple[float, str, str], ...] = ()
    endurance: Endurance | None = None
    interrupted: bool = False
    goals: GoalCounts | None = None
    forces: np.ndarray = field(default_factory=lambda: np.zeros((0, 4)))
    desired_force: Sequence[float] = ()

    @property
    def pressing(self) -> PressingFigures | None:
        """How well the desired force was kept; None without one, or without contact."""
        if not any(self.desired_force):
            return None
        return PressingFigures.of(self.forces, np.array(self.desired_force[:3]))

    @property
    def succeeded(self) -> bool:
        """Whether the last point was reached by a robot that was not stopped, and no node has
        grown.
        """
        steady = self.endurance is None or self.endurance.steady
        return self.recording.finished and not self.stop_reason and not self.interrupted and steady

    @property
    def ending(self) -> str:
        """How it ended, in a word or two."""
        if self.interrupted:
            return 'interrupted'
        if self.stop_reason or not self.recording.finished:
            return 'NOT finished'
        if not self.succeeded:
            return 'finished, but a node has grown'
        return 'finished'

    def table(self, title: str) -> Table:
        """The summary that ends a demo."""
        rows: list[tuple[str, ...]] = [
            ('task', self.ending),
            ('robot', f'stopped: {self.stop_reason}' if self.stop_reason else 'not stopped'),
            (
                "robot's session",
                ' > '.join(f'{word}{_MEANS.get(word, "")}' for word in self.session),
            ),
        ]
        if self.motion:
            rows += _motion_rows(self.motion, self.goals)
        if self.pressing:
            rows += _pressing_rows(self.pressing)
        if self.cycles:
            rows += _cycle_rows(self.cycles)
            rows.append(('not seen by the planner', str(self.planner_missed)))
        if self.endurance:
            rows += _endurance_rows(self.endurance)
        return facts(rows, title=title)

    def write_json(self, path: Path) -> None:
        """The same figures, in SI units.

        Raises:
            FileError: it cannot be written.
        """
        content = {
            'task': self.ending,
            'stop_reason': self.stop_reason,
            'session': self.session,
            'switches': self.switches,
            'motion': asdict(self.motion) if self.motion else None,
            'pressing': asdict(self.pressing) if self.pressing else None,
            'goals': asdict(self.goals) if self.goals else None,
            'cycles': asdict(self.cycles) if self.cycles else None,
            'planner_missed': self.planner_missed,
            'endurance': asdict(self.endurance) if self.endurance else None,
        }
        with writing(path):
            path.write_text(json.dumps(content, indent=2) + '\n', encoding='utf-8')


def _motion_rows(motion: MotionFigures, goals: GoalCounts | None) -> list[tuple[str, ...]]:
    """Of a motion along a path, or of one that an operator steered to goals.

    Args:
        motion: The figures.
        goals: Of an operator; None for a path.
    """
    rows: list[tuple[str, ...]] = [('motion',)]
    if goals:
        rows.append(('goals', f'{goals.reached} reached, {goals.given_up} given up'))
    else:
        rows += _path_rows(motion)
    for name, unit in (('acceleration', 'rad/s²'), ('velocity', 'rad/s'), ('torque', 'Nm')):
        value, at = getattr(motion, name)
        rows.append((f'maximum joint {name}', f'{value:.3f} {unit} (norm) at {at:.3f} s'))
    return [
        *rows,
        ('largest step at the start', f'{motion.jump:.2g} rad/s of one joint, in one cycle'),
        ('time at rest', f'{motion.still:.3f} s, of which {motion.delay:.3f} s at the start'),
    ]


def _pressing_rows(pressing: PressingFigures) -> list[tuple[str, ...]]:
    error = f'{pressing.rms:.3f} N RMS, at most {pressing.largest:.3f} N'
    return [
        ('pressing',),
        ('error of the force', f'{error}, from {_SETTLING:g} s after the first touch on'),
        ('peak at first', f'{pressing.peak:.2f} N'),
        ('states without contact', f'{pressing.contact_lost} after the first touch'),
    ]


def _path_rows(motion: MotionFigures) -> list[tuple[str, ...]]:
    path_deviation, deviation_at = motion.path_deviation
    error, error_at = motion.error
    return [
        ('segments started', f'{motion.segments} in {motion.seconds:.3f} s'),
        ('maximum path deviation', f'{1e3 * path_deviation:.3f} mm at {deviation_at:.3f} s'),
        ('maximum error', f'{1e3 * error:.3f} mm at {error_at:.3f} s, along the path or off it'),
        ('final error', f'{1e3 * motion.final_error:.3f} mm from the last point'),
    ]


def _cycle_rows(cycles: CycleCounts) -> list[tuple[str, ...]]:
    kinds = {
        'commands in time': cycles.in_time,
        'late, and the clock waited': cycles.waited_for,
        'commands too late': cycles.late,
        'commands missing': cycles.missed,
    }
    total = max(cycles.total, 1)
    rows: list[tuple[str, ...]] = [
        ('cycles of the robot',),
        ('in all', f'{cycles.total}, and the clock stood still for {cycles.stood_still:.3f} s'),
    ]
    rows += [(name, f'{count} ({count / total:.2%})') for name, count in kinds.items()]
    if cycles.in_time < _QUIET * total:
        rows.append(('why', 'this computer was busy; while the clock waits, no motion is lost'))
    return rows


def _endurance_rows(endurance: Endurance) -> list[tuple[str, ...]]:
    rows: list[tuple[str, ...]] = [
        ('endurance',),
        ('rounds', f'{endurance.rounds} in {endurance.seconds:.0f} s'),
    ]
    for name, (start, end) in endurance.memory.items():
        text = f'{start:.1f} MB after the first round, {end:.1f} MB at the end'
        rows.append((f'memory of {name}', text))
    return rows
