"""Laws side by side on one task: what each demands of the arm, and whether the arm could do it."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass

import numpy as np
from matplotlib.figure import Figure
from rich.table import Table

from redres_ros.laws import Law, law_name
from redres_ros.robot_model import RobotModel
from redres_ros.robots.joint_limits import JointLimits
from redres_ros.simulation.colours import line_styles
from redres_ros.simulation.plots import NORMS, in_symbols, legend_below
from redres_ros.simulation.recording import Recording
from redres_ros.simulation.report import PEAKS, table

# A norm is drawn on a logarithmic scale where its largest peak is so many times the median one
_WIDE = 10.0
_SHOWN = 1e4  # the range of such a scale

_ROUNDING = 1e-9  # fraction of a limit by which rounding may exceed it
_ALIKE = 1.05  # ratio of two peaks that hardly differ

_WHOLE = {  # figures of Effort, and their heads
    'squared_acceleration': 'int ddq^2 [rad^2/s^3]',
    'squared_torque': 'int tau^2 [Nm^2 s]',
    'kinetic_energy': 'int energy [J s]',
    'elbow': 'elbow path [m]',
}


@dataclass(frozen=True)
class Effort:
    """What a motion demands of the arm.

    Args:
        acceleration: Largest norm [rad/s^2].
        velocity: Largest norm [rad/s].
        torque: Largest norm [Nm].
        squared_acceleration: Integral of the squared norm over time [rad^2/s^3].
        squared_torque: Integral of the squared norm over time [Nm^2 s].
        kinetic_energy: Integral of 1/2 dq' M dq over time [J s].
        elbow: Length of the elbow's path [m].
        violation: The first joint that goes beyond a limit, how and when; empty for none.
        finished: The last point was reached.
        ending: How the motion ended, in words.
    """

    acceleration: float
    velocity: float
    torque: float
    squared_acceleration: float
    squared_torque: float
    kinetic_energy: float
    elbow: float
    violation: str
    finished: bool
    ending: str

    @classmethod
    def of(cls, recording: Recording, model: RobotModel) -> 'Effort':
        """That of a motion.

        Args:
            recording: Of at least one tick.
            model: Of the arm.
        """
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
            violation=first_violation(recording, JointLimits.of(model.arm)),
            finished=recording.finished,
            ending=recording.ending,
        )


def first_violation(recording: Recording, limits: JointLimits) -> str:
    """The first joint beyond one of its limits, how and when; empty where all are kept.

    Args:
        recording: Of a motion that began at rest.
        limits: Of the same arm.
    """
    found = [
        (float(recording['t'][tick]), f'{limits.joint_names[joint]} {kind}')
        for kind, (tick, joint) in _violations(recording, limits)
    ]
    if not found:
        return ''
    t, what = min(found)
    return f'{what}, {t:.2f} s'


def _violations(recording: Recording, limits: JointLimits) -> Iterator[tuple[str, tuple[int, int]]]:
    """Each kind of limit that is broken, and the tick and the joint where it is first."""
    q = recording.vectors('q1')
    dq = recording.vectors('dq1')
    ddq = np.diff(dq, axis=0, prepend=0.0) / recording.T  # (ticks, n), Eq. (13)
    tolerance = np.nan_to_num(_ROUNDING * (limits.upper - limits.lower), posinf=0.0)  # (n,)
    more = 1.0 + _ROUNDING
    beyond = {
        'position': (q < limits.lower - tolerance) | (q > limits.upper + tolerance),
        'velocity': np.abs(dq) > more * limits.velocity,
        'acceleration': np.abs(ddq) > more * limits.acceleration,
    }
    for kind, where in beyond.items():
        if where.any():
            tick, joint = np.argwhere(where)[0]
            yield kind, (int(tick), int(joint))


def tables(efforts: Mapping[str, Effort], title: str) -> tuple[Table, Table]:
    """The worst moments, with the arm's limits, and the whole motion; one row a law.

    Args:
        efforts: By law.
        title: Says what was compared.
    """
    marked = {name: _marked(efforts, name) for name in (*PEAKS, *_WHOLE)}
    worst = []
    whole = []
    for law, effort in efforts.items():
        worst.append([law, *(marked[name][law] for name in PEAKS), _within(effort)])
        whole.append([law, *(marked[name][law] for name in _WHOLE)])
    notes = filter(None, ('* least', conclusion(efforts)))
    unfinished = [f'{law}: {each.ending}' for law, each in efforts.items() if not each.finished]
    return (
        table(['law', *PEAKS.values(), 'within the limits?'], worst, title=title),
        table(['law', *_WHOLE.values()], whole, note='\n'.join([*notes, *unfinished])),
    )


def _within(effort: Effort) -> str:
    """Whether it stayed within the limits, as text."""
    return f'no: {effort.violation}' if effort.violation else 'yes'


def _marked(efforts: Mapping[str, Effort], name: str) -> dict[str, str]:
    """One figure of every law as text, the least of them with a star."""
    values = {law: getattr(effort, name) for law, effort in efforts.items()}
    shown = {law: f'{value:.4g}' for law, value in values.items()}
    least = shown[min(values, key=values.__getitem__)]
    return {law: f'{text}{"*" if text == least else " "}' for law, text in shown.items()}


def conclusion(efforts: Mapping[str, Effort]) -> str:
    """The conclusion of a comparison, in a line; empty for a single law.

    Args:
        efforts: By law.
    """
    finished = {law: effort for law, effort in efforts.items() if effort.finished}
    if len(finished) < 2:
        return ''
    peaks = {law: effort.acceleration for law, effort in finished.items()}
    best = min(peaks, key=peaks.__getitem__)
    worst = max(peaks, key=peaks.__getitem__)
    if peaks[worst] < _ALIKE * peaks[best]:
        return (
            'The peaks of acceleration hardly differ: on this task the law does not matter. '
            'It may where a path passes a singularity in motion.'
        )
    ratio = peaks[worst] / peaks[best]
    return f'The largest acceleration with {worst} is {ratio:.2g} times that with {best}.'


def label(law: Law) -> str:
    """The label of a law in tables and plots, such as 'minimum_acceleration, k_d = 5 1/s'."""
    if not law.has_memory:
        return law_name(law)
    return f'{law_name(law)}, k_d = {plain(law.damping)} 1/s'


def plain(number: float) -> str:
    """The shortest text that identifies the number."""
    return repr(float(number)).removesuffix('.0')


def picture(recordings: Mapping[str, Recording], title: str) -> Figure:
    """The norms of all laws over time, one panel a norm.

    Args:
        recordings: By law.
        title: Says what was compared.
    """
    figure = Figure(figsize=(11.0, 9.0), layout='constrained')
    figure.suptitle(title)
    axes = figure.subplots(len(NORMS), 1, sharex=True)
    styles = line_styles(list(recordings))
    for ax, (norm, label) in zip(axes, NORMS.items(), strict=True):
        for name, recording in recordings.items():
            ax.plot(recording['t'], recording[norm], label=in_symbols(name), **styles[name])
        ax.set_ylabel(label, fontsize='small')
        ax.grid(alpha=0.3)
        peaks = [recording.peak(norm)[0] for recording in recordings.values()]
        if max(peaks) > _WIDE * np.median(peaks):
            ax.set_yscale('log')
            ax.set_ylim(bottom=max(peaks) / _SHOWN)
        ax.set_xmargin(0.01)
    axes[-1].set_xlabel('time [s]')
    legend_below(axes[-1], axes[0], fontsize='small')
    return figure
