"""The outcome of a demo in values: a table for the terminal, and a summary in a file."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, fields
from pathlib import Path
from typing import Any

import numpy as np
from rich.table import Table

from redres_ros.files.text import write_json
from redres_ros.planning.waypoints import WaypointTask
from redres_ros.simulation.recording import Recording
from redres_ros.simulation.report import facts

_Values = Mapping[str, Any]
_Rows = list[tuple[str, ...]]  # of a table; one with a single cell is a heading

_STILL = 1e-4  # [rad/s] norm of the joint velocities at which the arm counts as standing still
_START = 0.1  # [s] that count as the start
_SETTLING = 1.0  # [s] from the first touch until the force is judged
_MOST_GROWTH = 5.0  # [MB] of a node's memory while it does the same again and again
_QUIET = 0.95  # fraction of commands in time on a computer that does nothing else
# What a robot does in its session states.
_MEANS = {'MON': ' (only reports)', 'CMD': ' (takes commands)'}


@dataclass(frozen=True)
class Outcome:
    """The outcome of a demo.

    Attributes:
        recording: Recording of the task.
        stop_reason: Why the robot stopped itself; empty if it did not.
        session: Its states, in order.
        motion: See `motion_values`; None if the task did not begin.
        pressing: See `pressing_values`; None without a desired force, or without contact.
        cycles: See `count_cycles`; None if the task did not begin.
        endurance: Of a repeated task, how many `rounds`, in how many `seconds`, and the `memory` of
            each node after the first round and at the end [MB]; None if it was not repeated.
        planner_missed: Number of states that the planner did not get.
        switches: (time [s], law before, law after).
        interrupted: Whether Ctrl-C ended it.
        forces: Times [s], and forces of the environment on the tip in the base frame [N], (N, 4).
    """

    recording: Recording
    stop_reason: str
    session: tuple[str, ...]
    motion: _Values | None = None
    pressing: _Values | None = None
    cycles: _Values | None = None
    endurance: _Values | None = None
    planner_missed: int = 0
    switches: tuple[tuple[float, str, str], ...] = ()
    interrupted: bool = False
    forces: np.ndarray = field(default_factory=lambda: np.zeros((0, 4)))

    @property
    def ending(self) -> str:
        """How it ended; 'finished' if a robot that was not stopped reached the last point, and no
        node has grown.
        """
        if self.interrupted:
            return 'interrupted'
        if self.stop_reason or not self.recording.finished:
            return 'NOT finished'
        memory = self.endurance['memory'].values() if self.endurance else ()
        if any(end - start >= _MOST_GROWTH for start, end in memory):
            return 'finished, but a node has grown'
        return 'finished'

    def table(self, title: str) -> Table:
        """The summary that ends a demo."""
        rows: _Rows = [
            ('task', self.ending),
            ('robot', f'stopped: {self.stop_reason}' if self.stop_reason else 'not stopped'),
            ("robot's session", ' > '.join(word + _MEANS.get(word, '') for word in self.session)),
        ]
        if self.motion:
            rows += _motion_rows(self.motion)
        if self.pressing:
            rows += _pressing_rows(self.pressing)
        if self.cycles:
            rows += _cycle_rows(self.cycles)
            rows.append(('not seen by the planner', f'{self.planner_missed}'))
        if self.endurance:
            seconds = self.endurance['seconds']
            rows += [('endurance',), ('rounds', f'{self.endurance["rounds"]} in {seconds:.0f} s')]
            for name, (start, end) in self.endurance['memory'].items():
                text = f'{start:.1f} MB after the first round, {end:.1f} MB at the end'
                rows.append((f'memory of {name}', text))
        return facts(rows, title=title)

    def write_json(self, path: Path) -> None:
        """Write the same values in SI units. Raises FileError."""
        others = ('recording', 'interrupted', 'forces')
        names = [each.name for each in fields(self) if each.name not in others]
        write_json({'task': self.ending, **{name: getattr(self, name) for name in names}}, path)


def motion_values(recording: Recording, task: WaypointTask, final_error: float) -> _Values:
    """A recording of at least one tick in a few values; of some, the peak and its time [s].

    `error` is that of the task, also where the arm only lags on its path, and `path_deviation` the
    distance from the straight line from point to point [m]; `jump` is the largest change of a
    joint's velocity within a cycle at the start [rad/s]; `still` is the time without motion, of
    which `delay` at the start [s].
    """
    t = recording['t']
    moves = recording['joint_velocity_norm'] > _STILL
    steps = np.abs(np.diff(recording.vectors('dq1'), axis=0, prepend=0.0))  # (N, n), from rest
    path_deviation = task.path_deviation(recording.vectors('x'), recording['segment'])
    farthest = int(np.argmax(path_deviation))
    return {
        'seconds': float(t[-1]),
        'segments': int(recording['segment'].max()),
        'error': recording.peak('task_error'),
        'path_deviation': (float(path_deviation[farthest]), float(t[farthest])),
        'final_error': final_error,
        'acceleration': recording.peak('joint_acceleration_norm'),
        'velocity': recording.peak('joint_velocity_norm'),
        'torque': recording.peak('joint_torque_norm'),
        'jump': float(steps[t <= _START].max()),
        'delay': float(t[np.argmax(moves)] if moves.any() else t[-1]),
        'still': recording.T * int(np.count_nonzero(~moves)),
    }


def pressing_values(forces: np.ndarray, desired: Sequence[float]) -> _Values | None:
    """How well a desired force was kept, along its direction; None without one, or without a second
    of contact.

    `rms` and `largest` are of its error, from a second after the first touch on [N], `peak` is the
    force before [N], and `contact_lost` the number of states without contact after the first touch.
    The forces (N, 4) come with their times [s]; a moment may follow the desired force.
    """
    direction = np.array(desired[:3])
    size = float(np.linalg.norm(direction))
    if not size:
        return None
    force = forces[:, 1:] @ direction / size
    touched = np.cumsum(force > 0.0) > 0
    t = forces[:, 0] - forces[touched, 0].min(initial=np.inf)
    errors = force[t >= _SETTLING] - size
    if not errors.size:
        return None
    return {
        'rms': float(np.sqrt(np.mean(errors**2))),
        'largest': float(np.abs(errors).max()),
        'peak': float(force[t < _SETTLING].max()),
        'contact_lost': int(np.count_nonzero(force[touched] <= 0.0)),
    }


def _motion_rows(motion: _Values) -> _Rows:
    deviation, deviation_at = motion['path_deviation']
    error, error_at = motion['error']
    rows: _Rows = [
        ('motion',),
        ('segments started', f'{motion["segments"]} in {motion["seconds"]:.3f} s'),
        ('maximum path deviation', f'{1e3 * deviation:.3f} mm at {deviation_at:.3f} s'),
        ('maximum error', f'{1e3 * error:.3f} mm at {error_at:.3f} s, along the path or off it'),
        ('final error', f'{1e3 * motion["final_error"]:.3f} mm from the last point'),
    ]
    for name, unit in (('acceleration', 'rad/s²'), ('velocity', 'rad/s'), ('torque', 'Nm')):
        value, at = motion[name]
        rows.append((f'maximum joint {name}', f'{value:.3f} {unit} (norm) at {at:.3f} s'))
    rest = f'{motion["still"]:.3f} s, of which {motion["delay"]:.3f} s at the start'
    return [
        *rows,
        ('largest step at the start', f'{motion["jump"]:.2g} rad/s of one joint, in one cycle'),
        ('time at rest', rest),
    ]


def _pressing_rows(pressing: _Values) -> _Rows:
    error = f'{pressing["rms"]:.3f} N RMS, at most {pressing["largest"]:.3f} N'
    return [
        ('pressing',),
        ('error of the force', f'{error}, from {_SETTLING:g} s after the first touch on'),
        ('peak at first', f'{pressing["peak"]:.2f} N'),
        ('states without contact', f'{pressing["contact_lost"]} after the first touch'),
    ]


def _cycle_rows(cycles: _Values) -> _Rows:
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
