"""The paper's simulations and experiments by name, and their results."""

from collections.abc import Callable
from dataclasses import KW_ONLY, dataclass, replace
from itertools import product
from typing import Any, ClassVar

import numpy as np

from redres_ros.controller import Controller
from redres_ros.fake_robot.command_validator import ValidatorSettings
from redres_ros.laws import make_law
from redres_ros.paper.equivalence import SIMULATION_DYNAMICS, Difference, convergence, difference
from redres_ros.paper.experiment import Experiment, VelocityDifference, as_in_the_paper, experiment
from redres_ros.paper.saturation import (
    LWR,
    LWR_DAMPED,
    PLANAR,
    PLANAR_CHOICES,
    Benchmark,
    run_benchmark,
)
from redres_ros.paper.second_order import SecondOrderController, make_scheme
from redres_ros.planning.waypoints import WaypointTask, load_task
from redres_ros.preferences import JointCentering, Preference
from redres_ros.robot_model import RobotModel
from redres_ros.robots import find_arm
from redres_ros.simulation.closed_loop import Client, run
from redres_ros.simulation.parallel import in_parallel
from redres_ros.simulation.recording import Recording

SIMULATION_T = 0.001
_EXPERIMENT_T = 0.002  # [s]
SIMULATION_DAMPING = 10.0
_EXPERIMENT_DAMPING = 5.0  # k_d [1/s]; lambda = 0.99 at either sampling time
SWITCH_TIME = 0.2  # [s] over which the start of an experiment is blended, as the nodes do it
EXPERIMENT_DYNAMICS = 'identified'  # of arm and controller alike
_JOINT_LIMITS = ('position', 'velocity', 'acceleration')
TORQUE_SCALE = 0.2  # fraction of the torque limits that is allowed where they are shown
PREFERENCE = JointCentering(gain=400.0)  # with which law (19) and scheme (18) are compared

TORQUE_LAWS = ('minimum_weighted_torque', 'dynamically_consistent', 'minimum_torque')
CONVERGING_LAWS = ('minimum_acceleration', 'minimum_weighted_torque', 'dynamically_consistent')

_NO_STOP = ValidatorSettings(acceleration_scale=100.0)  # far beyond what any law commands


class Runs(dict[str, Any]):
    """Results by the names of RUNS; each is computed when first asked for, and kept.

    Args:
        task: The paper's, unless another is given.
        reversed_task: The same in reverse order.
    """

    def __init__(
        self, task: WaypointTask | None = None, reversed_task: WaypointTask | None = None
    ) -> None:
        super().__init__()
        self.task = task or load_task('rectangle')
        self.reversed_task = reversed_task or load_task('rectangle_reversed')
        self.model = RobotModel.named(self.task.robot, dynamics=SIMULATION_DYNAMICS)
        self.experiment_model = RobotModel.named(self.task.robot, dynamics=EXPERIMENT_DYNAMICS)

    def __missing__(self, name: str) -> Any:
        self[name] = RUNS[name].run(self)
        return self[name]

    def prepare(self, progress: Callable[[float], None]) -> None:
        """Run everything on all processors, the longest runs first; progress receives the completed
        fraction.
        """
        names = sorted(RUNS, key=lambda name: RUNS[name].seconds, reverse=True)

        def compute(name: str) -> Any:
            return self[name]

        self.update(zip(names, in_parallel(compute, names, progress), strict=True))

    def difference(self, law: str, scheme: str) -> VelocityDifference:
        """The difference of two experiments.

        Args:
            law: Name of the law's run.
            scheme: Name of the run of the scheme of second order.
        """
        return VelocityDifference.between(self[law], self[scheme])


@dataclass(frozen=True)
class Setup:
    """A law on the paper's task, or the scheme of second order that the law comes from.

    Args:
        equation: The paper's number of it.
        law: Name of a law in LAWS.
        damping: k_d [1/s]; None for a law that has none.
        is_scheme: The scheme runs, not the law.
        is_reversed: The points are in reverse order.
        T: Sampling time [s].
    """

    equation: str
    law: str
    damping: float | None = None
    _: KW_ONLY
    is_scheme: bool = False
    is_reversed: bool = False
    T: float = SIMULATION_T

    @property
    def parameters(self) -> str:
        """Damping and sampling time, for a title."""
        damping = ''
        if self.damping is not None:
            factor = 1.0 - self.damping * self.T
            damping = rf', $k_d$ = {self.damping:g} s$^{{-1}}$ ($\lambda$ = {factor:.4g})'
        return f'{damping}, T = {1e3 * self.T:g} ms'

    def task(self, runs: Runs) -> WaypointTask:
        """What is executed."""
        return runs.reversed_task if self.is_reversed else runs.task

    def _client(self, model: RobotModel, **options: Any) -> Client:
        """What responds to the robot's states; the options are of a Controller."""
        damping = self.damping or 0.0
        if self.is_scheme:
            return SecondOrderController(model, make_scheme(self.law, damping), self.T)
        return Controller(model, make_law(self.law, damping=damping), self.T, **options)


@dataclass(frozen=True, kw_only=True)
class Simulation(Setup):
    """Section 5: an ideal arm.

    Args:
        dynamics: Dynamics of the model.
        rounds: How often the task is executed.
        switching: When the next segment begins, WaypointTask.switching.
    """

    dynamics: str = SIMULATION_DYNAMICS
    rounds: int = 1
    switching: str = 'at_rest'

    @property
    def seconds(self) -> float:
        """Processor time, roughly."""
        return 0.001 * self.rounds / self.T

    def run(self, runs: Runs) -> Recording:
        """The motion, until the last point is reached."""
        task = self.task(runs)
        points = np.vstack([task.waypoints] * self.rounds)
        task = replace(task, waypoints=points, switching=self.switching)
        model = RobotModel.named(task.robot, dynamics=self.dynamics)
        return run(self._client(model), task)


@dataclass(frozen=True, kw_only=True)
class RobotRun(Setup):
    """Section 6: the arm behind the fake robot.

    Args:
        seed: Seed of the noise and of the start.
        switch_time: Over which the start is blended [s]. A scheme of second order starts at once,
            so a law that is compared with one does so too.
        limits: Names in LIMITS that the law keeps.
        torque_scale: Factor on the torque limits.
        stops: Whether the robot stops at accelerations beyond its limits.
    """

    seed: int
    switch_time: float = SWITCH_TIME
    limits: tuple[str, ...] = ()
    torque_scale: float = 1.0
    stops: bool = True

    T: float = _EXPERIMENT_T
    seconds: ClassVar[float] = 2.0

    def run(self, runs: Runs) -> Experiment:
        """The motion, until the last point is reached or the robot stops."""
        client = self._client(
            runs.experiment_model,
            switch_time=self.switch_time,
            limits=self.limits,
            torque_scale=self.torque_scale,
        )
        return experiment(
            client,
            self.task(runs),
            find_arm(runs.task.robot, dynamics=EXPERIMENT_DYNAMICS),
            sensing=as_in_the_paper(self.seed),
            guard=None if self.stops else _NO_STOP,
        )


@dataclass(frozen=True)
class Computation:
    """Anything else.

    Args:
        compute: The result for the tasks and arms of the runs.
        seconds: Processor time, roughly.
    """

    compute: Callable[[Runs], Any]
    seconds: float

    def run(self, runs: Runs) -> Any:
        """The result."""
        return self.compute(runs)


def title(number: int, name: str, scheme: str = '') -> str:
    """The title of a run's figure, or of a law's run beside a scheme's.

    Args:
        number: Number in the paper, or beyond the paper's last.
        name: Name of the run.
        scheme: Name of the run of the scheme.
    """
    run = MOTIONS[name]
    kind = 'Simulation' if isinstance(run, Simulation) else 'Experiment'
    other = f' and scheme ({MOTIONS[scheme].equation})' if scheme else ''
    order = ',\npoints in reverse order' if run.is_reversed else ''
    return f'Figure {number}. {kind}: {run.law} ({run.equation}){other}{run.parameters}{order}'


def two_rounds(law: str, damping: float, dynamics: str) -> str:
    """The name of a run of two rounds of the rectangle.

    Args:
        law: Name of a law in LAWS.
        damping: k_d [1/s].
        dynamics: Dynamics of the model.
    """
    return f'two_rounds_{dynamics}_{law}_{damping:g}'


def _difference(
    law: str,
    damping: float = SIMULATION_DAMPING,
    dynamics: str = SIMULATION_DYNAMICS,
    preference: Preference | None = None,
) -> Computation:
    """A law beside its scheme, both with the same damping [1/s] and preference."""

    def compute(runs: Runs) -> Difference:
        model = RobotModel.named(runs.task.robot, dynamics=dynamics)
        return difference(law, damping, SIMULATION_T, runs.task, model=model, preference=preference)

    return Computation(compute, seconds=4.0)


def _convergence(law: str) -> Computation:
    """A law at several sampling times beside its scheme in continuous time, first segment."""
    return Computation(lambda runs: convergence(law, SIMULATION_DAMPING, runs.task), seconds=3.0)


def _published(benchmark: Benchmark) -> Computation:
    """A motion published by others, under one of our laws."""
    return Computation(lambda _: run_benchmark(benchmark), seconds=benchmark.seconds / 4.0)


_LEAST_VELOCITY = RobotRun('2', 'minimum_velocity', seed=1)
_LEAST_ACCELERATION = RobotRun('23', 'minimum_acceleration', _EXPERIMENT_DAMPING, seed=2)
_CONSISTENT = RobotRun('35', 'dynamically_consistent', 1.0 / _EXPERIMENT_T, seed=6)

# A number in a name is that of the paper's equation.
MOTIONS: dict[str, Simulation | RobotRun] = {
    'simulated_23': Simulation('23', 'minimum_acceleration', SIMULATION_DAMPING),
    'simulated_22': Simulation('22', 'minimum_acceleration', SIMULATION_DAMPING, is_scheme=True),
    'simulated_15': Simulation('15', 'minimum_acceleration', 0.0),
    'simulated_35': Simulation('35', 'dynamically_consistent', 1.0 / SIMULATION_T),
    'simulated_29': Simulation('29', 'dynamically_consistent', 1.0 / SIMULATION_T, is_scheme=True),
    # At the sampling time of the experiments, by an arm that nothing stops:
    'ideal_2': Simulation('2', 'minimum_velocity', T=_EXPERIMENT_T),
    'ideal_23': Simulation('23', 'minimum_acceleration', _EXPERIMENT_DAMPING, T=_EXPERIMENT_T),
    'ideal_15': Simulation('15', 'minimum_acceleration', 0.0, T=_EXPERIMENT_T),
    # The next point as soon as the error is below 1 mm:
    'early_23': Simulation(
        '23', 'minimum_acceleration', SIMULATION_DAMPING, switching='within_tolerance'
    ),
    'early_15': Simulation('15', 'minimum_acceleration', 0.0, switching='within_tolerance'),
    'measured_2': _LEAST_VELOCITY,
    'measured_2_without_stop': replace(_LEAST_VELOCITY, stops=False),
    'measured_23': _LEAST_ACCELERATION,
    'measured_23_at_once': replace(_LEAST_ACCELERATION, switch_time=0.0, seed=3),
    'measured_22': replace(_LEAST_ACCELERATION, equation='22', is_scheme=True, seed=4),
    'measured_35': replace(_CONSISTENT, is_reversed=True, seed=5),
    'measured_35_forward': _CONSISTENT,
    'measured_35_at_once': replace(_CONSISTENT, is_reversed=True, switch_time=0.0, seed=7),
    'measured_29': replace(_CONSISTENT, equation='29', is_scheme=True, is_reversed=True, seed=8),
    # Not in the paper:
    'within_limits': replace(_LEAST_VELOCITY, limits=_JOINT_LIMITS),
    'within_torques': replace(
        _LEAST_VELOCITY, limits=(*_JOINT_LIMITS, 'torque'), torque_scale=TORQUE_SCALE
    ),
    # Longer tasks, of which Section 4.1 speaks:
    **{
        two_rounds(law, *rest): Simulation(equation, law, rest[0], dynamics=rest[1], rounds=2)
        for law, equation in {'minimum_weighted_torque': '27', 'minimum_torque': '7'}.items()
        for rest in product((0.0, SIMULATION_DAMPING), (EXPERIMENT_DYNAMICS, SIMULATION_DYNAMICS))
    },
}

COMPUTATIONS: dict[str, Computation] = {
    # Laws beside their schemes:
    'difference_15': _difference('minimum_acceleration', damping=0.0),
    'difference_19': _difference('minimum_acceleration', preference=PREFERENCE),
    'difference_2': _difference('minimum_velocity'),
    **{f'difference_{law}': _difference(law, dynamics=EXPERIMENT_DYNAMICS) for law in TORQUE_LAWS},
    **{f'convergence_{law}': _convergence(law) for law in CONVERGING_LAWS},
    # What others published, and how much it depends on our choices:
    'published_lwr': _published(LWR),
    'published_lwr_damped': _published(LWR_DAMPED),
    'published_planar': _published(PLANAR),
    **{f'published_{name}': _published(benchmark) for name, benchmark in PLANAR_CHOICES.items()},
}

RUNS: dict[str, Simulation | RobotRun | Computation] = {**MOTIONS, **COMPUTATIONS}
