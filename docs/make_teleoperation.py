"""Writes the table of docs/teleoperation.md from a bench.json, draws docs/teleoperation.png, and
films docs/teleoperation.webp.

Run it with: python docs/make_teleoperation.py redres_bench/bench.json
"""

import json
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
from make_numbers import markdown, write
from matplotlib.figure import Figure

from redres_ros import RobotModel
from redres_ros.bench.teleoperation import (
    HEADS,
    OperatorFigures,
    SteeredMotion,
    T,
    cells,
    our_follower,
    steered,
)
from redres_ros.planning.waypoints import task_for
from redres_ros.simulation.colours import law_colour
from redres_ros.simulation.operators import GoalOperator, task_of_goals
from redres_ros.simulation.recording import Recording, columns
from redres_ros.view.film import FilmedMotion, write_film

PAGE = Path(__file__).with_name('teleoperation.md')
DRAWN = 45.0  # [s]
FILMED = 17.0  # [s]
EVERY = 10  # ticks
COLOURED_AS = {'task': '', 'components': 'minimum_acceleration'}  # laws, whose colours these get


class WatchedOperator(GoalOperator):
    """One whose goals are recorded.

    Args:
        model: As of GoalOperator.
        seed: As of GoalOperator.
    """

    def __init__(self, model: RobotModel, seed: int) -> None:
        super().__init__(model, T, seed)
        self.goals: list[np.ndarray] = []  # positions [m], of each tick
        self.numbers: list[int] = []

    def intended(self, t: float, x: np.ndarray, R: np.ndarray) -> np.ndarray:
        """The same; arguments as of GoalOperator."""
        self.goals.append(self.goal.x)
        self.numbers.append(self.reached + self.given_up)
        return super().intended(t, x, R)


def table(content: dict) -> str:
    """The runs of a bench.json as a table, one row each."""
    rows = []
    for name, figures in content['runs'].items():
        operator, arm, controller = name.split(', ', 2)
        rows.append((f'{operator}, {arm}', controller, *cells(OperatorFigures(**figures))))
    runs = markdown(' | '.join(('operator, arm', 'controller', *HEADS)), rows)
    return f'{runs}\n*{content["duration_s"]:g} s each, seeds: {content["seeds"]}.*\n'


def recorded(scaling: str, model: RobotModel) -> Recording:
    """The motion under an operator.

    Args:
        scaling: What limits scale.
        model: The arm.
    """
    operator = WatchedOperator(model, 0)
    motion = steered(operator, model, our_follower(model, scaling), DRAWN, lambda done: None)
    return recording(operator, motion, model.n)


def recording(operator: WatchedOperator, motion: SteeredMotion, n: int) -> Recording:
    """A motion as a recording, with the goals as the reference.

    Args:
        operator: Who steered.
        motion: Tick by tick.
        n: Number of joints.
    """
    made = Recording(np.zeros((len(motion.q), len(columns(n)))), n, T, finished=True, ending='')
    made['t'][:] = T * np.arange(len(motion.q))
    made['segment'][:] = operator.numbers
    made['task_error'][:] = np.linalg.norm(np.array(operator.goals) - motion.x, axis=1)
    made.vectors('q1')[:] = motion.q
    made.vectors('x')[:] = motion.x
    made.vectors('x_d')[:] = operator.goals
    return made


def film(motions: dict[str, Recording], model: RobotModel) -> None:
    """Film the beginning of both motions side by side.

    Args:
        motions: By what limits scale.
        model: The arm.
    """
    filmed = []
    for scaling, whole in motions.items():
        data = whole.data[: round(FILMED / T)]
        goals = int(data[-1, whole.columns.index('segment')])
        is_stuck = scaling == 'task'
        ending = 'stuck' if is_stuck else f'{goals} goals reached'
        part = replace(whole, data=data, ending=ending, finished=not is_stuck)
        filmed.append(FilmedMotion(part, f'scaling: {scaling}', COLOURED_AS[scaling]))
    task = task_of_goals(filmed[-1].recording, task_for(model.arm, 'fr3'))
    write_film(filmed, model, task, PAGE.with_suffix('.webp'), compared='task_error')


def draw(motions: dict[str, Recording]) -> Figure:
    """The distance from the goal in both motions.

    Args:
        motions: By what limits scale.
    """
    figure = Figure(figsize=(9.0, 4.0), layout='constrained')
    ax = figure.add_subplot()
    for scaling, motion in motions.items():
        colour = law_colour(COLOURED_AS[scaling])
        error = motion['task_error'][::EVERY]
        ax.plot(motion['t'][::EVERY], error, color=colour, label=f'scaling: {scaling}')
    ax.set(xlabel='time [s]', ylabel='distance from the goal [m]')
    ax.grid(alpha=0.3)
    ax.legend()
    return figure


def main() -> None:
    """Write the table and draw."""
    content = json.loads(Path(sys.argv[1]).read_text(encoding='utf-8'))['teleoperation']
    write({'teleoperation': table(content)}, [PAGE])
    model = RobotModel.named('fr3')
    motions = {scaling: recorded(scaling, model) for scaling in COLOURED_AS}
    draw(motions).savefig(PAGE.with_suffix('.png'), dpi=110)
    film(motions, model)


if __name__ == '__main__':
    main()
