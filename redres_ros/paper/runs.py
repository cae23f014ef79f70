"""The paper's simulations and experiments by name, and their results."""

from collections.abc import Callable
from dataclasses import KW_ONLY, dataclass, replace
from itertools import product
from typing import Any

import numpy as np

from redres_ros.controller import Controller
from redres_ros.laws import make_law
from redres_ros.paper.experiment import Experiment, experiment
from redres_ros.paper.second_order import Scheme, SecondOrderController
from redres_ros.planning.waypoints import WaypointTask, load_task
from redres_ros.robot_model import RobotModel
from redres_ros.simulation.batch import in_parallel
from redres_ros.simulation.closed_loop import Client, run
from redres_ros.simulation.recording import Recording

SIMULATION_T = 0.001  # [s]
SIMULATION_DYNAMICS = 'cylinders'  # the equal links of Section 5.2
EXPERIMENT_DYNAMICS = 'identified'  # of arm and controller alike

_DAMPING = 10.0  # k_d [1/s]; lambda = 0.99 at either sampling time
_EXPERIMENT_T = 0.002  # [s]
_EXPERIMENT_DAMPING = 5.0  # k_d [1/s]
_SWITCH_TIME = 0.2  # [s] over which the start of an experiment is blended, as the nodes do it


class Runs(dict[Any, Any]):
    """Results by the names of MOTIONS; each is computed when first asked for, and kept."""

    def __init__(
        self, task: WaypointTask | None = None, reversed_task: WaypointTask | None = None
    ) -> None:
        super().__init__()
        self.task = task or load_task('rectangle')
        self.reversed_task = reversed_task or load_task('rectangle_reversed')
        self.model = RobotModel.named(self.task.robot, dynamics=SIMULATION_DYNAMICS)
        self.experiment_model = RobotModel.named(self.task.robot, dynamics=EXPERIMENT_DYNAMICS)

    def __missing__(self, name: Any) -> Any:
        self[name] = MOTIONS[name](self)
        return self[name]

    def prepare(self, progress: Callable[[float], None]) -> None:
        """Run everything on all processors; progress receives the completed fraction."""
        results = in_parallel(self.__getitem__, list(MOTIONS), progress)
        self.update(zip(MOTIONS, results, strict=True))


@dataclass(frozen=True)
class _Setup:
    """A law on the paper's task, or the scheme of second order that the law comes from."""

    equation: str  # the paper's number of it
    law: str
    damping: float | None = None  # k_d [1/s]; None for a law that has none
    _: KW_ONLY
    is_scheme: bool = False
    is_reversed: bool = False  # the points are in reverse order
    T: float = SIMULATION_T

    def task(self, runs: Runs) -> WaypointTask:
        return runs.reversed_task if self.is_reversed else runs.task

    def _client(self, model: RobotModel, switch_time: float = 0.0) -> Client:
        damping = self.damping or 0.0
        if self.is_scheme:
            return SecondOrderController(model, Scheme(self.law, damping), self.T)
        law = make_law(self.law, damping=damping)
        return Controller(model, law, self.T, switch_time=switch_time)


@dataclass(frozen=True, kw_only=True)
class _Simulation(_Setup):
    """Section 5: an ideal arm."""

    dynamics: str = SIMULATION_DYNAMICS
    rounds: int = 1  # how often the task is executed
    switching: str = 'at_rest'  # when the next segment begins

    def __call__(self, runs: Runs) -> Recording:
        task = self.task(runs)
        points = np.vstack([task.waypoints] * self.rounds)
        task = replace(task, waypoints=points, switching=self.switching)
        return run(self._client(RobotModel.named(task.robot, dynamics=self.dynamics)), task)


@dataclass(frozen=True, kw_only=True)
class _RobotRun(_Setup):
    """Section 6: the arm behind the fake robot."""

    seed: int  # of the noise and of the start
    # A scheme of second order starts at once, so a law that is compared with one does so too.
    switch_time: float = _SWITCH_TIME
    stops: bool = True  # at accelerations beyond the arm's limits
    T: float = _EXPERIMENT_T

    def __call__(self, runs: Runs) -> Experiment:
        client = self._client(runs.experiment_model, self.switch_time)
        return experiment(client, self.task(runs), seed=self.seed, stops=self.stops)


def title(number: int, name: str, scheme: str = '') -> str:
    """The title of a run's figure, or of a law's run beside that of a scheme."""
    run = MOTIONS[name]
    kind = 'Simulation' if isinstance(run, _Simulation) else 'Experiment'
    other = f' and scheme ({MOTIONS[scheme].equation})' if scheme else ''
    damping = ''
    if run.damping is not None:
        factor = 1.0 - run.damping * run.T
        damping = rf', $k_d$ = {run.damping:g} s$^{{-1}}$ ($\lambda$ = {factor:.4g})'
    period = f', T = {1e3 * run.T:g} ms'
    order = ',\npoints in reverse order' if run.is_reversed else ''
    return f'Figure {number}. {kind}: {run.law} ({run.equation}){other}{damping}{period}{order}'


_LEAST_VELOCITY = _RobotRun('2', 'minimum_velocity', seed=1)
_LEAST_ACCELERATION = _RobotRun('23', 'minimum_acceleration', _EXPERIMENT_DAMPING, seed=2)
_CONSISTENT = _RobotRun('35', 'dynamically_consistent', 1.0 / _EXPERIMENT_T, seed=6)

# Longer tasks, of which Section 4.1 speaks, by dynamics, law and damping
TWO_ROUNDS = {
    (dynamics, law, damping): _Simulation(equation, law, damping, dynamics=dynamics, rounds=2)
    for dynamics, (law, equation), damping in product(
        (EXPERIMENT_DYNAMICS, SIMULATION_DYNAMICS),
        (('minimum_weighted_torque', '27'), ('minimum_torque', '7')),
        (0.0, _DAMPING),
    )
}

# A number in a name is that of the paper's equation.
MOTIONS: dict[Any, _Simulation | _RobotRun] = {
    'simulated_23': _Simulation('23', 'minimum_acceleration', _DAMPING),
    'simulated_22': _Simulation('22', 'minimum_acceleration', _DAMPING, is_scheme=True),
    'simulated_15': _Simulation('15', 'minimum_acceleration', 0.0),
    'simulated_16': _Simulation('16', 'minimum_acceleration', 0.0, is_scheme=True),
    'simulated_35': _Simulation('35', 'dynamically_consistent', 1.0 / SIMULATION_T),
    'simulated_29': _Simulation('29', 'dynamically_consistent', 1.0 / SIMULATION_T, is_scheme=True),
    # At the sampling time of the experiments, by an arm that nothing stops:
    'ideal_2': _Simulation('2', 'minimum_velocity', T=_EXPERIMENT_T),
    'ideal_23': _Simulation('23', 'minimum_acceleration', _EXPERIMENT_DAMPING, T=_EXPERIMENT_T),
    'ideal_15': _Simulation('15', 'minimum_acceleration', 0.0, T=_EXPERIMENT_T),
    # The next point as soon as the error is below 1 mm:
    'early_23': _Simulation('23', 'minimum_acceleration', _DAMPING, switching='within_tolerance'),
    'early_15': _Simulation('15', 'minimum_acceleration', 0.0, switching='within_tolerance'),
    'measured_2': _LEAST_VELOCITY,
    'measured_2_without_stop': replace(_LEAST_VELOCITY, stops=False),
    'measured_23': _LEAST_ACCELERATION,
    'measured_23_at_once': replace(_LEAST_ACCELERATION, switch_time=0.0, seed=3),
    'measured_22': replace(_LEAST_ACCELERATION, equation='22', is_scheme=True, seed=4),
    'measured_35': replace(_CONSISTENT, is_reversed=True, seed=5),
    'measured_35_forward': _CONSISTENT,
    'measured_35_at_once': replace(_CONSISTENT, is_reversed=True, switch_time=0.0, seed=7),
    'measured_29': replace(_CONSISTENT, equation='29', is_scheme=True, is_reversed=True, seed=8),
    **TWO_ROUNDS,
}
