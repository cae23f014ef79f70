"""The paper's figures by number, computed again."""

from collections.abc import Callable
from functools import partial
from pathlib import Path

from matplotlib.figure import Figure

from redres_ros.paper.figures import differences, motions, norms, sketches
from redres_ros.paper.runs import Runs
from redres_ros.simulation.drawing import save
from redres_ros.simulation.parallel import in_parallel

_ACCELERATION = ('joint_acceleration_norm', 'null_velocity_norm', 'joint_velocity_norm')
_TORQUE = ('joint_torque_norm', 'joint_velocity_norm')

FIGURES: dict[int, Callable[[Runs], Figure]] = {
    1: sketches.figure_1,
    2: sketches.figure_2,
    3: partial(motions.draw, 3, 'simulated_23'),
    4: partial(norms.draw_simulated, 4, 'simulated_23', _ACCELERATION),
    5: partial(differences.draw_simulated, 5, 'simulated_23', 'simulated_22'),
    6: partial(motions.draw, 6, 'simulated_35'),
    7: partial(norms.draw_simulated, 7, 'simulated_35', _TORQUE),
    8: partial(differences.draw_simulated, 8, 'simulated_35', 'simulated_29'),
    9: partial(motions.draw, 9, 'measured_2'),
    10: partial(norms.draw_accelerations, 10, 'measured_2'),
    11: partial(motions.draw, 11, 'measured_23'),
    12: partial(norms.draw_accelerations, 12, 'measured_23'),
    13: partial(differences.draw_measured, 13, 'measured_23_at_once', 'measured_22'),
    14: partial(motions.draw, 14, 'measured_35'),
    15: partial(norms.draw_torques, 15, 'measured_35'),
    16: partial(differences.draw_measured, 16, 'measured_35_at_once', 'measured_29'),
}


def draw_all(out: Path, progress: Callable[[float], None], runs: Runs) -> dict[int, Path]:
    """Write every figure as out/figure_NN.png, on all processors; the files by number.

    Raises RedresError if a file cannot be written; progress receives the completed fraction.
    """
    files = {number: out / f'figure_{number:02d}.png' for number in FIGURES}

    def draw(number: int) -> None:
        save(FIGURES[number](runs), files[number])

    in_parallel(draw, list(FIGURES), progress)
    return files
