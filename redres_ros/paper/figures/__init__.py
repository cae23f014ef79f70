"""The paper's figures by number, computed anew."""

from collections.abc import Callable
from pathlib import Path

from matplotlib.figure import Figure

from redres_ros.paper.figures import differences, motions, norms, pictorial
from redres_ros.paper.figures.convergence import figure_convergence
from redres_ros.paper.figures.runs import Runs
from redres_ros.simulation.plots import save

FIGURES: dict[int, Callable[[Runs], Figure]] = {
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
}  # Figure 1 is a block diagram


def draw_all(
    out: Path, progress: Callable[[float], None] | None = None, runs: Runs | None = None
) -> dict[int, Path]:
    """Write every figure as out/figure_NN.png, and convergence.png, which the paper does not have;
    the files by number.

    progress is told the share that is done; runs: what to draw, so that it can be used for more
    than that. Raises FileError.
    """
    runs = runs or Runs()
    files = {}
    for done, (number, draw) in enumerate(FIGURES.items(), start=1):
        files[number] = out / f'figure_{number:02d}.png'
        save(draw(runs), files[number])
        if progress:
            progress(done / len(FIGURES))
    save(figure_convergence(runs), out / 'convergence.png')
    return files


__all__ = ['FIGURES', 'Runs', 'draw_all']
