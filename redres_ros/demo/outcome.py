"""The outcome of a demo in values, and as a table for the terminal."""

from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np
from rich.table import Table

from redres_ros.planning.waypoints import WaypointTask
from redres_ros.simulation.recording import Recording
from redres_ros.simulation.report import facts

_STILL = 1e-4  # [rad/s] norm of the joint velocities at which the arm counts as standing still


class Outcome(NamedTuple):
    recording: Recording
    summary: Mapping[str, Any]  # how it ended, in words, and `motion_values`
    forces: np.ndarray  # times [s], and forces on the tip in the base frame [N], (N, 4)


def motion_values(
    recording: Recording, task: WaypointTask, final_error: float
) -> dict[str, float | tuple[float, float]]:
    """A recording of at least one tick in a few values; of some, the peak and its time [s].

    `error` is that of the task, also where the arm only lags on its path, and `path_deviation` the
    distance from the straight line from point to point [m]; `still` is the time without motion [s].
    """
    t = recording['t']
    path_deviation = recording['task_error']
    if task.times is None:
        path_deviation = task.path_deviation(recording.vectors('x'), recording['segment'])
    farthest = int(np.argmax(path_deviation))
    still = recording['joint_velocity_norm'] <= _STILL
    return {
        'seconds': float(t[-1]),
        'segments': int(recording['segment'].max()),
        'error': recording.peak('task_error'),
        'path_deviation': (float(path_deviation[farthest]), float(t[farthest])),
        'final_error': final_error,
        'acceleration': recording.peak('joint_acceleration_norm'),
        'velocity': recording.peak('joint_velocity_norm'),
        'torque': recording.peak('joint_torque_norm'),
        'still': recording.T * int(np.count_nonzero(still)),
    }


def summary_table(summary: Mapping[str, Any], title: str) -> Table:
    """The summary that ends a demo."""
    reason = summary['stop_reason']
    rows: list[tuple[str, ...]] = [
        ('task', summary['task']),
        ('robot', f'stopped: {reason}' if reason else 'not stopped'),
        ("robot's session", ' > '.join(summary['session'])),
    ]
    if reason.startswith('timing'):
        rows.append(('why', 'this computer was too busy; --lockstep waits for every command'))
    if motion := summary.get('motion'):
        rows += [
            ('motion',),
            ('segments started', f'{motion["segments"]} in {motion["seconds"]:.3f} s'),
            ('maximum path deviation', _peak(motion['path_deviation'], 1e3, 'mm')),
            ('maximum error', _peak(motion['error'], 1e3, 'mm') + ', along the path or off it'),
            ('final error', f'{1e3 * motion["final_error"]:.3f} mm from the last point'),
            ('maximum joint acceleration', _peak(motion['acceleration'], 1.0, 'rad/s² (norm)')),
            ('maximum joint velocity', _peak(motion['velocity'], 1.0, 'rad/s (norm)')),
            ('maximum joint torque', _peak(motion['torque'], 1.0, 'Nm (norm)')),
            ('time at rest', f'{motion["still"]:.3f} s'),
        ]
    return facts(rows, title=title)


def _peak(value: tuple[float, float], scale: float, unit: str) -> str:
    size, at = value
    return f'{scale * size:.3f} {unit} at {at:.3f} s'
