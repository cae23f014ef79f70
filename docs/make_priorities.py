"""Draws docs/priorities.png: a second task that is possible most of the time, and one that is not.

Run it with: python docs/make_priorities.py
"""

from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

from redres_ros import Controller, RobotModel, load_task
from redres_ros.geometry import rotation_vector
from redres_ros.simulation.closed_loop import run
from redres_ros.simulation.colours import law_colour
from redres_ros.simulation.recording import Recording

T = 0.004  # sampling time [s]
LAW = 'minimum_acceleration'
LIMITS = ('position', 'velocity', 'acceleration')
TASKS = {'lwr4_square': 'both, most of the time', 'rectangle': 'they conflict'}
SECOND = {(): '0.6', ('orientation',): law_colour(LAW)}


def main() -> None:
    """Run the motions and draw them."""
    figure = Figure(figsize=(9.0, 5.2), layout='constrained')
    axes = figure.subplots(2, 2, sharex='col')
    for column, (name, title) in enumerate(TASKS.items()):
        task = load_task(name)
        model = RobotModel.named(task.robot)
        for tasks, color in SECOND.items():
            controller = Controller(model, LAW, T, limits=LIMITS, secondary_tasks=tasks)
            recording = run(controller, task)
            t = recording['t']
            label = 'position, then orientation' if tasks else 'position alone'
            axes[0, column].plot(t, turns(model, recording), color=color, label=label)
            axes[1, column].plot(t, 1e3 * recording['task_error'], color=color)
        axes[0, column].set_title(f'{name}: {title}', fontsize='medium')
        axes[1, column].set(xlabel='time [s]', ylim=(0.0, 0.6))
    axes[0, 0].set_ylabel('rotation from the start [deg]')
    axes[1, 0].set_ylabel('position error [mm]')
    figure.legend(*axes[0, 0].get_legend_handles_labels(), loc='outside lower center', ncols=2)
    for ax in axes.flat:
        ax.grid(alpha=0.3)
    figure.savefig(Path(__file__).with_name('priorities.png'), dpi=110)


def turns(model: RobotModel, recording: Recording) -> np.ndarray:
    """How far the tip is turned from its orientation at the start, (ticks,) [deg]."""
    q = recording.vectors('q1')
    _, R_start = model.tip(q[0])
    angles = [np.linalg.norm(rotation_vector(R_start @ model.tip(each)[1].T)) for each in q]
    return np.degrees(angles)


if __name__ == '__main__':
    main()
