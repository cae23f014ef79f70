"""The simulations and experiments of the paper: run when first asked for, and then kept."""

from collections.abc import Callable
from dataclasses import replace
from functools import cached_property
from typing import Any

import numpy as np

from redres_ros.controller import Controller
from redres_ros.laws import make_law
from redres_ros.paper import saturation
from redres_ros.paper.equivalence import (
    SIMULATION_DYNAMICS,
    Convergence,
    Difference,
    convergence,
    difference,
)
from redres_ros.paper.experiment import Experiment, experiment
from redres_ros.paper.saturation import Saturated
from redres_ros.paper.second_order import SecondOrderController, make_scheme
from redres_ros.paper.sensing import as_in_the_paper
from redres_ros.paper.velocity_difference import VelocityDifference
from redres_ros.planning.waypoints import WaypointTask, load_task
from redres_ros.robot_model import RobotModel
from redres_ros.robots import find_arm
from redres_ros.simulation.closed_loop import Client, run
from redres_ros.simulation.parallel import in_parallel
from redres_ros.simulation.recording import Recording

SIMULATION_T = 0.001
EXPERIMENT_T = 0.002  # [s]
SIMULATION_DAMPING = 10.0
EXPERIMENT_DAMPING = 5.0  # k_d [1/s]; lambda = 0.99 at either sampling time
SWITCH_TIME = 0.2  # [s] over which the start of an experiment is blended, as the nodes do it
EXPERIMENT_DYNAMICS = 'identified'  # of arm and controller alike
JOINT_LIMITS = ('position', 'velocity', 'acceleration')
TORQUE_SCALE = 0.2  # share of the torque limits that is allowed where they are shown

Speeds = dict[tuple[str, float], float]  # by law and damping [1/s]


class Runs:
    """Recordings of Section 5, with an ideal arm, and experiments of Section 6, with the arm behind
    the fake robot.

    A number in a name is that of the paper's equation. The schemes of second order, (22) and (29),
    start at once, so the laws that are compared with them in an experiment do so too: those
    are the runs called `unblended`.

    Args:
        task: The paper's, unless another is given.
        reversed_task: The same in reverse order.
    """

    def __init__(
        self, task: WaypointTask | None = None, reversed_task: WaypointTask | None = None
    ) -> None:
        self.task = task or load_task('rectangle')
        self.reversed_task = reversed_task or load_task('rectangle_reversed')
        self.model = RobotModel.named(self.task.robot, dynamics=SIMULATION_DYNAMICS)
        self.experiment_model = RobotModel.named(self.task.robot, dynamics=EXPERIMENT_DYNAMICS)

    def prepare(self, progress: Callable[[float], None]) -> None:
        """Run everything at once, on all processors. progress is told the share that is done."""
        names = names_of_runs()
        for name, result in zip(names, in_parallel(self._make, names, progress), strict=True):
            self.__dict__[name] = result  # where a cached property looks first

    # --- with an ideal arm ------------------------------------------------------------------------

    @cached_property
    def ideal_damped(self) -> Recording:
        """Law (23), lambda = 0.99."""
        return self._simulate('minimum_acceleration', SIMULATION_DAMPING)

    @cached_property
    def ideal_22(self) -> Recording:
        """The scheme from which law (23) comes, with damping."""
        return self._simulate_scheme('minimum_acceleration', SIMULATION_DAMPING)

    @cached_property
    def ideal_undamped(self) -> Recording:
        """Law (23), lambda = 1, which is law (15)."""
        return self._simulate('minimum_acceleration', 0.0)

    @cached_property
    def ideal_35(self) -> Recording:
        """Law (35)."""
        return self._simulate('dynamically_consistent', 1.0 / SIMULATION_T)

    @cached_property
    def ideal_29(self) -> Recording:
        """Scheme (29) with damping (34), from which law (35) comes."""
        return self._simulate_scheme('dynamically_consistent', 1.0 / SIMULATION_T)

    @cached_property
    def ideal_minimum_velocity(self) -> Recording:
        """Law (2) at the sampling time of the experiments, by an arm that nothing stops."""
        return run(self._law('minimum_velocity'), self.task)

    # --- with the arm behind the fake robot -------------------------------------------------------

    @cached_property
    def experiment_minimum_velocity(self) -> Experiment:
        """Law (2) with dq_N = 0."""
        return self._try(self._law('minimum_velocity'), seed=1)

    @cached_property
    def experiment_damped(self) -> Experiment:
        """Law (23), lambda = 0.99."""
        return self._try(self._law('minimum_acceleration', EXPERIMENT_DAMPING), seed=2)

    @cached_property
    def experiment_damped_unblended(self) -> Experiment:
        """The same, for comparison with (22)."""
        law = self._law('minimum_acceleration', EXPERIMENT_DAMPING, switch_time=0.0)
        return self._try(law, seed=3)

    @cached_property
    def experiment_22(self) -> Experiment:
        """The scheme from which law (23) comes."""
        return self._try(self._scheme('minimum_acceleration', EXPERIMENT_DAMPING), seed=4)

    @cached_property
    def experiment_35(self) -> Experiment:
        """Law (35), points in reverse order."""
        law = self._law('dynamically_consistent', 1.0 / EXPERIMENT_T)
        return self._try(law, self.reversed_task, seed=5)

    @cached_property
    def experiment_35_forward(self) -> Experiment:
        """Law (35), points in the order of the other runs."""
        return self._try(self._law('dynamically_consistent', 1.0 / EXPERIMENT_T), seed=6)

    @cached_property
    def experiment_35_unblended(self) -> Experiment:
        """Law (35), points in reverse order, for comparison with (29)."""
        law = self._law('dynamically_consistent', 1.0 / EXPERIMENT_T, switch_time=0.0)
        return self._try(law, self.reversed_task, seed=7)

    @cached_property
    def experiment_29(self) -> Experiment:
        """Scheme (29) with damping (34), points in reverse order."""
        scheme = self._scheme('dynamically_consistent', 1.0 / EXPERIMENT_T)
        return self._try(scheme, self.reversed_task, seed=8)

    @cached_property
    def experiment_within_limits(self) -> Experiment:
        """Law (2) within the limits of the joints. Not in the paper."""
        return self._try(self._law('minimum_velocity', limits=JOINT_LIMITS), seed=1)

    @cached_property
    def experiment_within_torques(self) -> Experiment:
        """The same with a share of the torque limits."""
        limits = (*JOINT_LIMITS, 'torque')
        law = self._law('minimum_velocity', limits=limits, torque_scale=TORQUE_SCALE)
        return self._try(law, seed=1)

    # --- what others published --------------------------------------------------------------------

    @cached_property
    def saturated_lwr(self) -> Saturated:
        """The LWR there and back."""
        return saturation.run(saturation.LWR)

    @cached_property
    def saturated_lwr_damped(self) -> Saturated:
        """The same with its self-motion damped."""
        return saturation.run(saturation.LWR_DAMPED)

    @cached_property
    def saturated_planar(self) -> Saturated:
        """The planar arm twice around a hexagon."""
        return saturation.run(saturation.PLANAR)

    @property
    def difference_23(self) -> VelocityDifference:
        """Law (23) and scheme (22) in experiments of their own."""
        return VelocityDifference.of(self.experiment_damped_unblended, self.experiment_22)

    @property
    def difference_35(self) -> VelocityDifference:
        """Law (35) and scheme (29) in experiments of their own."""
        return VelocityDifference.of(self.experiment_35_unblended, self.experiment_29)

    # --- laws beside their schemes ----------------------------------------------------------------

    @cached_property
    def convergence_minimum_acceleration(self) -> Convergence:
        """At several sampling times, against the scheme in continuous time, first segment."""
        return convergence('minimum_acceleration', SIMULATION_DAMPING, self.task)

    @cached_property
    def convergence_minimum_weighted_torque(self) -> Convergence:
        """As of least acceleration."""
        return convergence('minimum_weighted_torque', SIMULATION_DAMPING, self.task)

    @cached_property
    def convergence_dynamically_consistent(self) -> Convergence:
        """As of least acceleration."""
        return convergence('dynamically_consistent', SIMULATION_DAMPING, self.task)

    @property
    def convergences(self) -> dict[str, Convergence]:
        """All of them, by law."""
        return {
            'minimum_acceleration': self.convergence_minimum_acceleration,
            'minimum_weighted_torque': self.convergence_minimum_weighted_torque,
            'dynamically_consistent': self.convergence_dynamically_consistent,
        }

    @cached_property
    def difference_undamped(self) -> Difference:
        """Law (15) and scheme (16), whose loop amplifies rounding."""
        return difference('minimum_acceleration', 0.0, SIMULATION_T, self.task)

    @cached_property
    def difference_minimum_weighted_torque(self) -> Difference:
        """With the identified dynamics."""
        return self._difference('minimum_weighted_torque')

    @cached_property
    def difference_dynamically_consistent(self) -> Difference:
        """With the identified dynamics."""
        return self._difference('dynamically_consistent')

    @cached_property
    def difference_minimum_torque(self) -> Difference:
        """With the identified dynamics."""
        return self._difference('minimum_torque')

    @cached_property
    def two_rounds_identified(self) -> Speeds:
        """With the identified dynamics."""
        return self._two_rounds(self.experiment_model)

    @cached_property
    def two_rounds_cylinders(self) -> Speeds:
        """With the equal links of Section 5.2."""
        return self._two_rounds(self.model)

    def _make(self, name: str, _: Callable[[float], None]) -> Any:
        return getattr(self, name)

    def _two_rounds(self, model: RobotModel) -> Speeds:
        """Largest |dq| [rad/s] over two rounds of the task, without and with damping."""
        points = np.vstack((self.task.waypoints, self.task.waypoints))
        twice = replace(self.task, waypoints=points)
        found = {}
        for name in ('minimum_weighted_torque', 'minimum_torque'):
            for damping in (0.0, SIMULATION_DAMPING):
                controller = Controller(model, make_law(name, damping=damping), SIMULATION_T)
                found[name, damping], _ = run(controller, twice).peak('joint_velocity_norm')
        return found

    def _difference(self, law: str) -> Difference:
        return difference(
            law, SIMULATION_DAMPING, SIMULATION_T, self.task, model=self.experiment_model
        )

    def _simulate(self, law: str, damping: float = 0.0) -> Recording:
        return run(Controller(self.model, make_law(law, damping=damping), SIMULATION_T), self.task)

    def _simulate_scheme(self, law: str, damping: float) -> Recording:
        return run(
            SecondOrderController(self.model, make_scheme(law, damping), SIMULATION_T), self.task
        )

    def _law(
        self,
        law: str,
        damping: float = 0.0,
        *,
        switch_time: float = SWITCH_TIME,
        limits: tuple[str, ...] = (),
        torque_scale: float = 1.0,
    ) -> Controller:
        return Controller(
            self.experiment_model,
            make_law(law, damping=damping),
            EXPERIMENT_T,
            switch_time=switch_time,
            limits=limits,
            torque_scale=torque_scale,
        )

    def _scheme(self, law: str, damping: float) -> SecondOrderController:
        return SecondOrderController(self.experiment_model, make_scheme(law, damping), EXPERIMENT_T)

    def _try(
        self,
        client: Client,
        task: WaypointTask | None = None,
        *,
        seed: int,
    ) -> Experiment:
        arm = find_arm(self.task.robot, dynamics=EXPERIMENT_DYNAMICS)
        sensing = as_in_the_paper(seed)
        return experiment(client, task or self.task, arm, sensing=sensing)


def names_of_runs() -> list[str]:
    """What is run once and kept, the longest runs first. They stand last in the class."""
    kept = [name for name, value in vars(Runs).items() if isinstance(value, cached_property)]
    return kept[::-1]
