"""The simulations and experiments of the paper: run when first asked for, and then kept."""

from functools import cached_property

from redres_ros.controller import Controller
from redres_ros.laws import make_law
from redres_ros.paper.equivalence import SIMULATION_DYNAMICS, Convergence, convergence
from redres_ros.paper.experiment import Experiment, experiment
from redres_ros.paper.second_order import SecondOrderController, make_scheme
from redres_ros.robot_model import RobotModel
from redres_ros.robots import find_arm
from redres_ros.simulation.closed_loop import Client, run
from redres_ros.simulation.recording import Recording
from redres_ros.waypoints import WaypointTask, load_task

SIMULATION_T = 0.001
EXPERIMENT_T = 0.002  # [s]
SIMULATION_DAMPING = 10.0
EXPERIMENT_DAMPING = 5.0  # k_d [1/s]; lambda = 0.99 at either sampling time
SWITCH_TIME = 0.2  # [s] over which the start of an experiment is blended, as the nodes do it
EXPERIMENT_DYNAMICS = 'identified'  # of arm and controller alike


class Runs:
    """Recordings of Section 5, with an ideal arm, and experiments of Section 6, with the arm behind
    the fake robot.

    A number in a name is that of the paper's equation. The schemes of second order, (16), (22) and
    (29), start at once, so the laws that are compared with them in an experiment do so too: those
    are the runs called `unblended`.
    """

    def __init__(self) -> None:
        self.task = load_task('rectangle')
        self.reversed_task = load_task('rectangle_reversed')
        self.model = RobotModel.named(self.task.robot, dynamics=SIMULATION_DYNAMICS)
        self.experiment_model = RobotModel.named(self.task.robot, dynamics=EXPERIMENT_DYNAMICS)

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
    def ideal_16(self) -> Recording:
        """The scheme from which law (15) comes."""
        return self._simulate_scheme('minimum_acceleration', 0.0)

    @cached_property
    def ideal_35(self) -> Recording:
        """Law (35)."""
        return self._simulate('dynamically_consistent', 1.0 / SIMULATION_T)

    @cached_property
    def ideal_29(self) -> Recording:
        """Scheme (29) with damping (34), from which law (35) comes."""
        return self._simulate_scheme('dynamically_consistent', 1.0 / SIMULATION_T)

    @cached_property
    def experiment_minimum_velocity(self) -> Experiment:
        """Law (2) with dq_N = 0."""
        return self._try(self._law('minimum_velocity'))

    @cached_property
    def experiment_damped(self) -> Experiment:
        """Law (23), lambda = 0.99."""
        return self._try(self._law('minimum_acceleration', EXPERIMENT_DAMPING))

    @cached_property
    def experiment_damped_unblended(self) -> Experiment:
        """The same, for comparison with (22)."""
        return self._try(self._law('minimum_acceleration', EXPERIMENT_DAMPING, switch_time=0.0))

    @cached_property
    def experiment_22(self) -> Experiment:
        """The scheme from which law (23) comes."""
        return self._try(self._scheme('minimum_acceleration', EXPERIMENT_DAMPING))

    @cached_property
    def experiment_35(self) -> Experiment:
        """Law (35), points in reverse order."""
        return self._try(
            self._law('dynamically_consistent', 1.0 / EXPERIMENT_T), self.reversed_task
        )

    @cached_property
    def experiment_35_forward(self) -> Experiment:
        """Law (35), points in the order of the other runs."""
        return self._try(self._law('dynamically_consistent', 1.0 / EXPERIMENT_T))

    @cached_property
    def experiment_35_unblended(self) -> Experiment:
        """Law (35), points in reverse order, for comparison with (29)."""
        return self._try(
            self._law('dynamically_consistent', 1.0 / EXPERIMENT_T, switch_time=0.0),
            self.reversed_task,
        )

    @cached_property
    def experiment_29(self) -> Experiment:
        """Scheme (29) with damping (34), points in reverse order."""
        return self._try(
            self._scheme('dynamically_consistent', 1.0 / EXPERIMENT_T), self.reversed_task
        )

    @cached_property
    def convergences(self) -> dict[str, Convergence]:
        """Laws at several sampling times against their schemes in continuous time, on the first
        segment.
        """
        laws = 'minimum_acceleration', 'minimum_weighted_torque', 'dynamically_consistent'
        return {law: convergence(law, SIMULATION_DAMPING, self.task) for law in laws}

    def _simulate(self, law: str, damping: float = 0.0) -> Recording:
        return run(Controller(self.model, make_law(law, damping=damping), SIMULATION_T), self.task)

    def _simulate_scheme(self, law: str, damping: float) -> Recording:
        return run(
            SecondOrderController(self.model, make_scheme(law, damping), SIMULATION_T), self.task
        )

    def _law(self, law: str, damping: float = 0.0, switch_time: float = SWITCH_TIME) -> Controller:
        return Controller(
            self.experiment_model,
            make_law(law, damping=damping),
            EXPERIMENT_T,
            switch_time=switch_time,
        )

    def _scheme(self, law: str, damping: float) -> SecondOrderController:
        return SecondOrderController(self.experiment_model, make_scheme(law, damping), EXPERIMENT_T)

    def _try(self, client: Client, task: WaypointTask | None = None) -> Experiment:
        return experiment(
            client, task or self.task, find_arm(self.task.robot, dynamics=EXPERIMENT_DYNAMICS)
        )
