"""Draws docs/collision.png: a planar arm and a sphere in its path, without and with the limit.

Run it with: python docs/make_collision.py
"""

from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Circle

from redres_ros import Controller, RobotModel, load_task, make_law
from redres_ros.limits.distance import CollisionLimit
from redres_ros.simulation.closed_loop import run
from redres_ros.simulation.colours import law_colour
from redres_ros.simulation.recording import Recording

T = 0.01  # sampling time [s]
LAW = 'minimum_acceleration'
JOINTS = ('position', 'velocity', 'acceleration')
SPHERE = (0.463, 0.0, -0.343, 0.05)  # centre and radius [m]
OBSTACLE = ' '.join(('sphere', *map(str, SPHERE)))
SNAPSHOTS = 14
LINKS = ('link_1', 'link_2', 'link_3', 'link_4', 'tool0')


def main() -> None:
    """Run the two motions and draw them."""
    task = load_task('planar4r_hexagon')
    model = RobotModel.named(task.robot)
    law = make_law(LAW)
    kept = CollisionLimit(model, obstacles=OBSTACLE)
    runs = {
        'joint limits': (JOINTS, '0.6'),
        'joint limits and collision': ((*JOINTS, kept), law_colour(LAW)),
    }
    figure = Figure(figsize=(10.0, 4.0), layout='constrained')
    axes = figure.subplots(1, 3)
    for ax, (label, (limits, color)) in zip(axes, runs.items(), strict=False):
        recording = run(Controller(model, law, T, limits=limits), task)
        draw_arm(ax, model, recording, color)
        ax.set_title(label, fontsize='medium')
        axes[2].plot(recording['t'], 1e3 * distances(model, recording), color=color, label=label)
    axes[2].axhline(1e3 * kept.clearance, color='k', ls=':', lw=1.0, label='clearance')
    axes[2].set(xlabel='time [s]', ylabel='distance to the sphere [mm]', ylim=(-50.0, 320.0))
    axes[2].grid(alpha=0.3)
    axes[2].legend(fontsize='small', loc='lower center', bbox_to_anchor=(0.5, 1.0))
    figure.savefig(Path(__file__).with_name('collision.png'), dpi=110)


def draw_arm(ax: Axes, model: RobotModel, recording: Recording, color: str) -> None:
    """Some postures from the side, the path of the tip, and the sphere."""
    q = recording.vectors('q1')
    for k in np.linspace(0, len(q) - 1, SNAPSHOTS).astype(int):
        points = np.array([model.position(q[k], link) for link in LINKS])
        ax.plot(points[:, 0], points[:, 2], color=color, lw=3.0, alpha=0.25, solid_capstyle='round')
    ax.plot(recording['x'], recording['z'], color='k', lw=1.0)
    ax.add_patch(Circle((SPHERE[0], SPHERE[2]), SPHERE[3], color='0.3'))
    ax.set(xlabel='x [m]', ylabel='z [m]', aspect='equal')


def distances(model: RobotModel, recording: Recording) -> np.ndarray:
    """Of the arm from the sphere, (ticks,) [m]."""
    seen = CollisionLimit(model, obstacles=OBSTACLE)
    found = []
    for q in recording.vectors('q1'):
        _, distance, who = seen.approaches(q, 1.0)
        found.append(distance[seen._scene.pairs[who, 1] >= len(model.bodies.links)].min())
    return np.array(found)


if __name__ == '__main__':
    main()
