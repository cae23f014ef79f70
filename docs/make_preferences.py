"""Draws docs/preferences.png: the quantity of each preference, without and with it.

Run it with: python docs/make_preferences.py
"""

from collections.abc import Callable
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

from redres_ros import Controller, RobotModel, load_task, make_law, make_preference
from redres_ros.simulation.closed_loop import run
from redres_ros.simulation.colours import law_colour
from redres_ros.simulation.recording import Recording

T = 0.004  # sampling time [s]
LAW = 'minimum_acceleration'
EVERY = 10  # ticks
GAINS = {'joint_centering': 400.0, 'posture': 4.0, 'manipulability': 20.0, 'elbow_height': 40.0}


def main() -> None:
    """Run the motions and draw them."""
    task = load_task('lwr4_square')
    model = RobotModel.named(task.robot)
    alone = follow(model)
    figure = Figure(figsize=(9.0, 5.5), layout='constrained')
    for ax, name in zip(figure.subplots(2, 2).flat, GAINS, strict=True):
        label, measure = MEASURES[name]
        for recording, color, text in (
            (alone, '0.6', 'no preference'),
            (follow(model, name), law_colour(LAW), f'{name} = {GAINS[name]:g}'),
        ):
            q = recording.vectors('q1')[::EVERY]
            values = [measure(model, each, q[0]) for each in q]
            ax.plot(recording['t'][::EVERY], values, color=color, label=text)
        ax.set(xlabel='time [s]', ylabel=label)
        ax.grid(alpha=0.3)
        ax.legend(fontsize='small', loc='lower center', bbox_to_anchor=(0.5, 1.0), ncols=2)
    figure.savefig(Path(__file__).with_name('preferences.png'), dpi=110)


def follow(model: RobotModel, name: str = '') -> Recording:
    """The square under least acceleration, with a preference or none."""
    preferences = (make_preference(name, gain=GAINS[name]),) if name else ()
    law = make_law(LAW)
    return run(Controller(model, law, T, preferences=preferences), load_task('lwr4_square'))


def joint_range_cost(model: RobotModel, q: np.ndarray, start: np.ndarray) -> float:
    """H, as joint_centering has it."""
    width = model.q_max - model.q_min
    middle = model.q_min + width / 2.0
    return float((((q - middle) / width) ** 2).sum() / (2 * model.n))


def posture_distance(model: RobotModel, q: np.ndarray, start: np.ndarray) -> float:
    """Distance from the posture of the start [rad]."""
    return float(np.linalg.norm(q - start))


def manipulability(model: RobotModel, q: np.ndarray, start: np.ndarray) -> float:
    """The root of det(J J') of the position."""
    J = model.state(q, np.zeros(model.n)).J[:3]
    return float(np.sqrt(np.linalg.det(J @ J.T)))


def elbow_height(model: RobotModel, q: np.ndarray, start: np.ndarray) -> float:
    """[m]."""
    return float(model.position(q, model.elbow_frame)[2])


Measure = Callable[[RobotModel, np.ndarray, np.ndarray], float]
MEASURES: dict[str, tuple[str, Measure]] = {
    'joint_centering': ('distance from mid-range, H [-]', joint_range_cost),
    'posture': ('distance from start posture [rad]', posture_distance),
    'manipulability': ('manipulability [-]', manipulability),
    'elbow_height': ('height of the elbow [m]', elbow_height),
}


if __name__ == '__main__':
    main()
