"""Laws side by side on one task: what each asks of the arm at its worst, and over the whole motion."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

from redres_ros.robot_model import RobotModel
from redres_ros.simulation.plots import NORMS, save
from redres_ros.simulation.recording import Recording

# where the largest peak is that many times the median one, a norm is drawn on a logarithmic scale
_WIDE = 10.0
_SHOWN = 1e4  # the range of such a scale


@dataclass(frozen=True)
class Effort:
    """Peaks of the norms and integrals over the motion.

    acceleration [rad/s^2], velocity [rad/s], torque [Nm]: largest norms; squared_acceleration
    [rad^2/s^3] and squared_torque [Nm^2 s]: integrals of the squared norms over time;
    kinetic_energy [J s]: the integral of 1/2 dq' M dq; elbow [m]: the length of the elbow's path.
    """

    acceleration: float
    velocity: float
    torque: float
    squared_acceleration: float
    squared_torque: float
    kinetic_energy: float
    elbow: float
    ending: str

    @classmethod
    def of(cls, recording: Recording, model: RobotModel) -> 'Effort':
        """From a recording of at least one tick."""
        T = recording.T
        q = recording.vectors('q1')
        dq = recording.vectors('dq1')
        M = np.array(
            [model.state(position, velocity).M for position, velocity in zip(q, dq, strict=True)]
        )  # (N, n, n)
        elbow = np.array(
            [model.position(position, model.arm.elbow_frame) for position in q]
        )  # (N, 3)
        return cls(
            *(
                recording.peak(f'joint_{name}_norm')[0]
                for name in ('acceleration', 'velocity', 'torque')
            ),
            squared_acceleration=T * float(np.sum(recording['joint_acceleration_norm'] ** 2)),
            squared_torque=T * float(np.sum(recording['joint_torque_norm'] ** 2)),
            kinetic_energy=T * float(np.einsum('ti,tij,tj->', dq, M, dq)) / 2.0,
            elbow=float(np.linalg.norm(np.diff(elbow, axis=0), axis=1).sum()),
            ending=recording.ending,
        )


def table(efforts: Mapping[str, Effort]) -> str:
    """One line a law; the smallest value of each column is marked."""
    heads = (
        'max |ddq|',
        'max |dq|',
        'max |tau|',
        'int ddq^2',
        'int tau^2',
        'int energy',
        'elbow path',
    )
    units = ('rad/s^2', 'rad/s', 'Nm', 'rad^2/s^3', 'Nm^2 s', 'J s', 'm')
    names = list(Effort.__dataclass_fields__)[: len(heads)]
    values = {law: [getattr(effort, name) for name in names] for law, effort in efforts.items()}
    least = [min(column) for column in zip(*values.values(), strict=True)]
    lines = [
        f'{"law":<40}' + ''.join(f'{head:>13}' for head in heads),
        f'{"":<40}' + ''.join(f'{f"[{unit}]":>13}' for unit in units),
    ]
    for law, row in values.items():
        cells = (
            f'{value:.4g}{"*" if value == best else " "}'
            for value, best in zip(row, least, strict=True)
        )
        lines.append(
            f'{law:<40}' + ''.join(f'{cell:>13}' for cell in cells) + f'  {efforts[law].ending}'
        )
    return '\n'.join([*lines, '* least of its column'])


def draw(recordings: Mapping[str, Recording], title: str, path: Path) -> None:
    """The norms of all laws over time, one panel a norm. Raises FileError."""
    figure = Figure(figsize=(11.0, 9.0), layout='constrained')
    figure.suptitle(title)
    axes = figure.subplots(len(NORMS), 1, sharex=True)
    for ax, (norm, label) in zip(axes, NORMS.items(), strict=True):
        for name, recording in recordings.items():
            ax.plot(recording['t'], recording[norm], lw=1.2, label=name)
        ax.set_ylabel(label, fontsize='small')
        ax.grid(alpha=0.3)
        peaks = [recording.peak(norm)[0] for recording in recordings.values()]
        if max(peaks) > _WIDE * np.median(peaks):
            ax.set_yscale('log')
            ax.set_ylim(bottom=max(peaks) / _SHOWN)
    axes[0].legend(loc='upper left', fontsize='small', ncols=2)
    axes[-1].set_xlabel('time [s]')
    save(figure, path)
