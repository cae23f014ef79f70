"""A picture of a motion in contact: the force on the tip, and what tip and elbow do."""

from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

from redres_ros.robot_model import RobotModel
from redres_ros.simulation.recording import Recording

_MOST_POINTS = 2000  # of a curve


def draw_contact(
    forces: np.ndarray, recording: Recording, model: RobotModel, title: str, path: Path
) -> None:
    """Draw the picture into a file.

    Args:
        forces: Times [s], and forces of the environment on the tip along its axes [N], (N, 4).
        recording: Of the motion.
        model: The arm.
        title: Says what was run.
        path: With the ending of a picture.
    """
    figure = Figure(figsize=(9.0, 5.5), layout='constrained')
    figure.suptitle(title)
    force, distance = figure.subplots(2, 1, sharex=True)
    force.plot(forces[:, 0], np.linalg.norm(forces[:, 1:], axis=1), color='tab:red')
    force.set_ylabel('force on the tip [N]')
    every = max(len(recording.data) // _MOST_POINTS, 1)
    t = recording['t'][::every]
    positions = recording.vectors('q1')[::every]
    for name, frame in (('tip', model.arm.tip_frame), ('elbow', model.arm.elbow_frame)):
        if frame:
            x = np.array([model.position(q, frame) for q in positions])
            distance.plot(t, 1e3 * np.linalg.norm(x - x[0], axis=1), label=name)
    distance.set(ylabel='distance from its start [mm]', xlabel='time [s]')
    distance.legend(fontsize='small')
    for ax in (force, distance):
        ax.grid(alpha=0.3)
        ax.set_xmargin(0.01)
    figure.savefig(path, dpi=110)
