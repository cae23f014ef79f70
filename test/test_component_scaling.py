"""Scaling by components: optimal level by level, within the box, and the direction kept."""

from collections.abc import Callable

import numpy as np
import pytest
from nightly import NIGHTLY
from scipy.optimize import linprog
from test_constrained import EXACT, PRECISE, WEIGHTS, active_rows, unexplained, weight

from redres_ros import Controller, RobotModel
from redres_ros.errors import UnknownNameError
from redres_ros.geometry import rotation_matrix
from redres_ros.kernels.tick import rotation_error
from redres_ros.limits.component_scaling import DIRECTION_TOLERANCE, solve_components
from redres_ros.resolution import resolve
from redres_ros.solver import Box, Constrained, solve_constrained

MANY = 20_000 if NIGHTLY else 150
SIZES = (3, 3)
BOX = ('position', 'velocity', 'acceleration')
T = 0.002  # [s]
ANY = np.full(7, -100.0), np.full(7, 100.0)  # a box in which nothing is locked

FR3 = RobotModel.named('fr3')
# Postures of it [rad]
FIVE_AT_ENDS = -2.735, 1.775, -2.892, -2.808, -2.798, 3.723, -3.003
FOUR_AT_ENDS = -2.735, -1.106, -2.892, -0.160, -1.603, 0.553, 0.785
OUTSTRETCHED_AT_ENDS = -0.948, -1.775, 0.231, -0.161, -2.798, 4.508, -3.007


class Problem:
    """A pose task of an arm with seven joints, of which two cannot move as they should.

    Its task velocity is that of a random joint velocity, and most of it cannot be executed.
    """

    def __init__(self, seed: int, power: int | None = None, held: int | None = None) -> None:
        random = np.random.default_rng(seed)
        self.J = random.uniform(-2.0, 2.0, (6, 7))
        upper = random.uniform(0.5, 2.0, 7)
        lower = -random.uniform(0.5, 2.0, 7)
        dq = random.normal(size=7)
        blocked = random.permutation(7)[:2]
        upper[blocked] = np.where(dq[blocked] > 0.0, 0.0, upper[blocked])
        lower[blocked] = np.where(dq[blocked] < 0.0, 0.0, lower[blocked])
        self.box = lower, upper
        self.dx = self.J @ dq
        self.held = [False, False]
        if held is not None:
            self.held[held] = True
            self.dx[3 * held : 3 * held + 3] *= 0.01
        self.W = weight(power, 7, random)
        self.dq_free = resolve(self.J, self.dx, random.normal(size=7), self.W)

    def solved(self, steady_box: Box = ANY) -> Constrained:
        tasks = [(self.J, self.dx)]
        active_set = np.zeros(8, np.int64)
        return solve_components(
            *(self.dq_free, self.W, tasks, self.box, [], active_set, SIZES, self.held),
            *(steady_box, np.zeros(7)),
        )

    def components(self):
        """(J, dx, held) of each."""
        return zip(np.split(self.J, 2), np.split(self.dx, 2), self.held, strict=True)

    def cones(self, dq: np.ndarray) -> np.ndarray:
        """|across| / along of each component that is asked for."""
        ratios = []
        for J, dx, held in self.components():
            if not held:
                along = J @ dq @ dx / np.linalg.norm(dx)
                across = np.linalg.norm(J @ dq - along * dx / np.linalg.norm(dx))
                ratios.append(across / max(along, 1e-7))
        return np.array(ratios)


def pyramids(problem: Problem) -> tuple[np.ndarray, np.ndarray]:
    """Rows C dq <= 0 that keep the directions, and the rows across them, by other means."""
    rows = []
    across = []
    for J, dx, held in problem.components():
        if held:
            across.append(J)
            continue
        d = dx / np.linalg.norm(dx)
        U = np.linalg.qr(np.column_stack((d, np.eye(3))))[0][:, 1:].T
        slope = np.tan(DIRECTION_TOLERANCE) / np.sqrt(2.0)
        rows += [(sign * u - slope * d) @ J for u in U for sign in (1.0, -1.0)]
        across.append(U @ J)
    return np.array(rows), np.concatenate(across)


@pytest.mark.slow
@pytest.mark.parametrize('held', [None, 0, 1])
def test_no_other_velocity_within_the_cones_goes_further_along(held):
    """At the least of a convex function its gradient's linear programme has its optimum.

    Of two components that are asked for, neither can have more without less of the other.
    """
    for seed in range(MANY):
        problem = Problem(seed, None, held)
        solved = problem.solved()
        if held is None:
            s = solve_constrained(
                problem.dq_free, problem.W, [(problem.J, problem.dx)], problem.box
            ).s
            assert solved.s == s
            assert min(solved.component_scaling) >= s - EXACT, seed
        gradient = np.zeros(7)
        asked = 0.0
        for (J, dx, is_held), a in zip(problem.components(), solved.component_scaling, strict=True):
            if not is_held:
                gradient += (1.0 - a) * J.T @ dx
                asked += (1.0 - a) * dx @ dx
        if not asked:
            continue
        C, _ = pyramids(problem)
        bounds = [*zip(*problem.box, strict=True)]
        along = [(J.T @ dx, dx @ dx) for J, dx, is_held in problem.components() if not is_held]
        rows = np.vstack((C, [row for row, _ in along], [-row for row, _ in along]))
        least = solved.component_scaling if held is None else (0.0,)
        ends = [
            *np.zeros(len(C)),
            *(size for _, size in along),
            *(-(a - EXACT) * size for a, (_, size) in zip(least, along, strict=True)),
        ]
        found = linprog(-gradient, A_ub=rows, b_ub=ends, bounds=bounds, options=PRECISE)
        if found.status == 0:
            assert -found.fun <= gradient @ solved.dq + 1e-6 * asked, seed


@WEIGHTS
@pytest.mark.parametrize('held', [None, 1])
def test_the_box_and_the_directions_are_kept_and_what_goes_across_is_the_least(held, power):
    for seed in range(MANY // 2):
        problem = Problem(seed, power, held)
        dq = problem.solved().dq
        lower, upper = problem.box
        assert (lower <= dq).all() and (dq <= upper).all(), seed
        assert (problem.cones(dq) <= np.tan(DIRECTION_TOLERANCE) + 1e-6).all(), seed
        C, across = pyramids(problem)
        wanted = np.zeros(len(across))
        if held is not None:
            wanted[-3:] = problem.dx[-3:]
        along = [J.T @ dx for J, dx, is_held in problem.components() if not is_held]
        active = np.vstack((active_rows(dq, problem.box), C[np.abs(C @ dq) < 1e-9]))
        gradient = across.T @ (across @ dq - wanted)
        assert unexplained(gradient, np.array(along), active) < 1e3 * EXACT, seed


def test_components_that_lock_each_other_give_way_to_the_one_that_can_go_on():
    """With two joints at rest five are left, of which six rows in fixed directions ask too much."""
    unlocked = 0
    for seed in range(MANY):
        problem = Problem(seed)
        locked = problem.solved()
        if max(locked.component_scaling) > 1e-6:
            continue
        solved = problem.solved(problem.box)
        lower, upper = problem.box
        assert (lower <= solved.dq).all() and (solved.dq <= upper).all(), seed
        if max(solved.component_scaling) > 0.2:
            unlocked += 1
            first = int(np.argmax(solved.component_scaling))
            assert problem.cones(solved.dq)[first] <= np.tan(DIRECTION_TOLERANCE) + 1e-6, seed
    assert unlocked > MANY / 30


def test_what_can_be_executed_as_a_whole_is():
    for seed in range(MANY):
        problem = Problem(seed)
        problem.box = np.full(7, -20.0), np.full(7, 20.0)
        tasks = [(problem.J, problem.dx)]
        expected = solve_constrained(problem.dq_free, problem.W, tasks, problem.box)
        solved = problem.solved()
        if expected.s == 1.0:
            assert (solved.dq == expected.dq).all()
            assert solved.component_scaling == (1.0, 1.0)


def steered(
    q: np.ndarray, velocity: Callable[[np.ndarray, np.ndarray], np.ndarray], ticks: int, task='pose'
) -> tuple[np.ndarray, np.ndarray]:
    """Where the tip of an FR3 is after some ticks of a task velocity by its position and
    orientation.
    """
    controller = Controller(
        FR3, 'minimum_acceleration', T, task=task, limits=BOX, scaling='components'
    )
    for _ in range(ticks):
        q = controller.update(q, velocity(*FR3.tip(q))).q_ref
    return FR3.tip(q)


def test_an_operator_at_his_position_can_turn_the_tip_where_both_lock_each_other():
    """Joints 1 and 5 of the FR3 are at their ends. Its tip can turn, but leaves the position, to
    which the operator steers back: with either undoing the other it would stand still.
    """
    q = np.array((-2.73, 0.9, -1.94, -2.49, -2.79, 1.69, -2.36))
    x_d, R = FR3.tip(q)
    R_d = rotation_matrix(0.77 * np.array((-0.32, -0.80, 0.51))) @ R

    def back(x: np.ndarray, R: np.ndarray) -> np.ndarray:
        return np.concatenate((1.5 * (x_d - x), 0.8 * rotation_error(R, R_d)))

    _, R = steered(q, back, 1500)
    assert np.linalg.norm(rotation_error(R, R_d)) < 0.6


@pytest.mark.parametrize(
    ('task', 'q', 'dx'),
    [
        ('pose', FIVE_AT_ENDS, (-0.066, -0.136, 0.199, 0.0, 0.0, 0.0)),  # nothing within 30 degrees
        ('pose', FIVE_AT_ENDS, (-0.066, -0.136, 0.199, 1e-6, 0.0, 0.0)),
        ('position', FOUR_AT_ENDS, (-0.221, -0.017, -0.116)),  # nothing within 60 degrees
        # the tip could turn, and go the way back by that
        ('pose', OUTSTRETCHED_AT_ENDS, (0.073, -0.238, -0.024, 0.017, -0.017, -0.019)),
    ],
)
def test_where_nothing_is_possible_in_its_direction_the_tip_slides_along(task, q, dx):
    """Joints of the FR3 are at their ends, and no translation is possible near the direction."""
    q = np.clip(q, FR3.q_min + np.radians(0.5), FR3.q_max - np.radians(0.5))
    begin, _ = FR3.tip(q)
    v = np.array(dx[:3])
    end, _ = steered(q, lambda *_: np.array(dx), 500, task)
    assert (end - begin) @ v > 0.01 * np.linalg.norm(v)


def test_an_unknown_scaling_is_refused(model):
    with pytest.raises(UnknownNameError, match='components, task'):
        Controller(model, 'minimum_velocity', T, scaling='component')
