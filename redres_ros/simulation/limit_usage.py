"""Velocities and accelerations of motions relative to their limits, and the task scaling."""

from collections.abc import Mapping

import numpy as np
from matplotlib.figure import Figure

from redres_ros.robot_model import RobotModel
from redres_ros.robots.joint_limits import JointLimits
from redres_ros.simulation.colours import line_styles
from redres_ros.simulation.plots import in_symbols, legend_below
from redres_ros.simulation.recording import Recording

_HIGHEST = 3.0  # fraction that is shown
_ABOVE = 1.1  # of the highest curve, or of the limit, the axis ends


def velocity_usage(recording: Recording, model: RobotModel) -> np.ndarray:
    """Velocity of the joint that is nearest to its limit, or beyond, as a fraction, (ticks,).

    Args:
        recording: Of commands.
        model: The arm, with its limits.
    """
    velocity: np.ndarray = np.abs(recording.vectors('dq1')) / JointLimits.of(model.arm).velocity
    return velocity.max(axis=1)


def acceleration_usage(recording: Recording, model: RobotModel) -> np.ndarray:
    """The same of the acceleration (dq_k - dq_{k-1}) / T, Eq. (13), (ticks,).

    Args:
        recording: Of commands.
        model: The arm, with its limits.
    """
    ddq = np.diff(recording.vectors('dq1'), axis=0, prepend=0.0) / recording.T  # (ticks, n)
    usage: np.ndarray = np.abs(ddq) / JointLimits.of(model.arm).acceleration
    return usage.max(axis=1)


def draw_limit_usage(
    recordings: Mapping[str, Recording], model: RobotModel, allowed: float, title: str
) -> Figure:
    """Velocity and acceleration as fractions of the limits, and the task scaling, over time.

    Args:
        recordings: By law.
        model: The arm, with its limits.
        allowed: Fraction of them that the motions may use, `limit_scale`.
        title: Says what was compared.
    """
    figure = Figure(figsize=(11.0, 8.0), layout='constrained')
    figure.suptitle(title)
    velocity, acceleration, scaling = figure.subplots(3, 1, sharex=True)
    styles = line_styles(list(recordings))
    for name, recording in recordings.items():
        t = recording['t']
        style = styles[name]
        velocity.plot(t, velocity_usage(recording, model), label=in_symbols(name), **style)
        acceleration.plot(t, acceleration_usage(recording, model), **style)
        scaling.plot(t, recording['task_scaling'], **style)
    for ax, quantity in ((velocity, 'velocity'), (acceleration, 'acceleration')):
        ax.axhline(allowed, color='tab:red', ls='--', lw=1.0, label='allowed')
        highest = max(float(np.max(line.get_ydata())) for line in ax.get_lines())
        ax.set_ylim(0.0, min(_ABOVE * highest, _HIGHEST))
        note = f'\n(up to {highest:.3g})' if highest > _HIGHEST else ''
        ax.set_ylabel(f"largest {quantity}\n[fraction of a joint's limit]{note}", fontsize='small')
    scaling.set_ylim(0.0, 1.05)
    scaling.set_ylabel('task scaling $s$:\nfraction of the task velocity', fontsize='small')
    scaling.set_xlabel('time [s]')
    for ax in (velocity, acceleration, scaling):
        ax.grid(alpha=0.3)
        ax.set_xmargin(0.01)
    legend_below(scaling, velocity, fontsize='small')
    return figure
