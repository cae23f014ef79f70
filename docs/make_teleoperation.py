"""Writes the table of docs/teleoperation.md from a bench.json, and draws docs/teleoperation.png.

Run it with: python docs/make_teleoperation.py redres_bench/bench.json
"""

import json
import sys
from pathlib import Path

import numpy as np
from make_numbers import replaced
from matplotlib.figure import Figure

from redres_ros import RobotModel
from redres_ros.bench.teleoperation import (
    HEADS,
    OperatorFigures,
    T,
    cells,
    our_follower,
    steered,
)
from redres_ros.simulation.operators import GoalOperator

PAGE = Path(__file__).with_name('teleoperation.md')
DRAWN = 45.0  # [s]
EVERY = 10  # ticks


class WatchedOperator(GoalOperator):
    """One whose distance from the goal is recorded.

    Args:
        model: As of GoalOperator.
        seed: As of GoalOperator.
    """

    def __init__(self, model: RobotModel, seed: int) -> None:
        super().__init__(model, T, seed)
        self.distances: list[float] = []  # [m], of each tick

    def intended(self, t: float, x: np.ndarray, R: np.ndarray) -> np.ndarray:
        """The same; arguments as of GoalOperator."""
        self.distances.append(float(np.linalg.norm(self.goal.x - x)))
        return super().intended(t, x, R)


def table(content: dict) -> str:
    """The runs of a bench.json as a table, one row each."""
    lines = [f'| operator, arm | controller | {" | ".join(HEADS)} |']
    lines.append('|' + '---|' * (len(HEADS) + 2))
    for name, figures in content['runs'].items():
        operator, arm, controller = name.split(', ', 2)
        row = ' | '.join(cells(OperatorFigures(**figures)))
        lines.append(f'| {operator}, {arm} | {controller} | {row} |')
    lines.append('')
    lines.append(f'*{content["duration_s"]:g} s each, seeds: {content["seeds"]}.*')
    return '\n'.join(lines) + '\n'


def draw() -> Figure:
    """The same operator's distance from the goal by both kinds of scaling."""
    model = RobotModel.named('fr3')
    figure = Figure(figsize=(9.0, 4.0), layout='constrained')
    ax = figure.add_subplot()
    for scaling, color in (('task', '0.55'), ('components', 'tab:blue')):
        operator = WatchedOperator(model, 0)
        steered(operator, model, our_follower(model, scaling), DRAWN, lambda done: None)
        distances = np.array(operator.distances[::EVERY])
        label = f'scaling: {scaling}, {operator.reached} goals reached'
        ax.plot(EVERY * T * np.arange(len(distances)), distances, color=color, label=label)
    ax.set(xlabel='time [s]', ylabel='distance from the goal [m]')
    ax.grid(alpha=0.3)
    ax.legend()
    return figure


def main() -> None:
    """Write the table and draw."""
    content = json.loads(Path(sys.argv[1]).read_text(encoding='utf-8'))['teleoperation']
    page = PAGE.read_text(encoding='utf-8')
    PAGE.write_text(replaced(page, 'teleoperation', table(content)), encoding='utf-8')
    draw().savefig(PAGE.with_suffix('.png'), dpi=110)


if __name__ == '__main__':
    main()
