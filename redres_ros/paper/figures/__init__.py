"""The paper's figures by number, computed anew."""

from collections.abc import Callable
from pathlib import Path

from matplotlib.figure import Figure

from redres_ros.paper.figures import (
    architecture,
    convergence,
    differences,
    limits,
    motions,
    norms,
    pictorial,
)
from redres_ros.paper.figures.runs import Runs
from redres_ros.simulation.parallel import in_parallel
from redres_ros.simulation.plots import save

FIGURES: dict[int, Callable[[Runs], Figure]] = {
    1: architecture.figure_1,
    2: pictorial.figure_2,
    3: motions.figure_3,
    4: norms.figure_4,
    5: differences.figure_5,
    6: motions.figure_6,
    7: norms.figure_7,
    8: differences.figure_8,
    9: motions.figure_9,
    10: norms.figure_10,
    11: motions.figure_11,
    12: norms.figure_12,
    13: differences.figure_13,
    14: motions.figure_14,
    15: norms.figure_15,
    16: differences.figure_16,
    # Beyond the paper:
    17: limits.figure_17,
    18: limits.figure_18,
    19: convergence.figure_19,
}


def draw_all(out: Path, progress: Callable[[float], None], runs: Runs) -> dict[int, Path]:
    """Write every figure as out/figure_NN.png, on all processors; the files by number.

    Args:
        out: The folder, which is made if need be.
        progress: Is told the share that is done.
        runs: What to draw.

    Raises:
        RedresError: A file cannot be written.
    """
    files = {number: out / f'figure_{number:02d}.png' for number in FIGURES}

    def draw(number: int, _: Callable[[float], None]) -> None:
        save(FIGURES[number](runs), files[number])

    in_parallel(draw, list(FIGURES), progress)
    return files


__all__ = ['FIGURES', 'Runs', 'draw_all']
