"""Scaling by components: optimal level by level, within the box, and the direction kept."""

import numpy as np
import pytest
from nightly import NIGHTLY
from scipy.optimize import linprog
from test_constrained import EXACT, PRECISE, WEIGHTS, active_rows, unexplained, weight

from redres_ros import Controller, RobotModel
from redres_ros.geometry import rotation_matrix
from redres_ros.kernels.active_set import DIRECTION_TOLERANCE, SPREAD
from redres_ros.kernels.tick import rotation_error
from redres_ros.limits.component_scaling import Yielding, solve_components
from redres_ros.resolution import resolve
from redres_ros.robot_model import Correction
from redres_ros.solver import Constrained, solve_constrained

MANY = 20_000 if NIGHTLY else 150
SIZES = (3, 3)
BOX = ('position', 'velocity', 'acceleration')
T = 0.002  # [s]
ANY = np.full(7, -100.0), np.full(7, 100.0)  # a box in which nothing is locked
AWAY = 0.1
RIGID = Yielding()

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

    def solved(self, yielding=RIGID, active_set=None, least=np.nan) -> Constrained:
        is_held = np.repeat(self.held, 3)
        correction = Correction(self.dx * is_held, is_held, np.full(6, AWAY))
        problem = self.dq_free, self.W, [(self.J, self.dx)], self.box, [], active_set
        how = (SIZES, correction, None), lambda: ANY, np.zeros(7), yielding, least
        return solve_components(problem, *how)[0]

    @property
    def leading(self) -> int:
        """The component that is asked for, or the larger one."""
        if any(self.held):
            return self.held.index(False)
        return int(np.linalg.norm(self.dx[3:]) > np.linalg.norm(self.dx[:3]))

    @property
    def parts(self) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
        """J and dx of the leading component, and of the other one."""
        lead = slice(3 * self.leading, 3 * self.leading + 3)
        other = slice(3 - lead.start, 6 - lead.start)
        return self.J[lead], self.dx[lead], self.J[other], self.dx[other]

    @property
    def least(self) -> float:
        """The factor that no component may fall below."""
        if any(self.held):
            return 0.0
        return solve_constrained(self.dq_free, self.W, [(self.J, self.dx)], self.box).s


def pyramid(problem: Problem) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """By other means: rows C dq <= 0 that keep the direction of the leading component, rows across
    it, and along it, where 1 is all.
    """
    J, dx, _, _ = problem.parts
    d = dx / np.linalg.norm(dx)
    h = d.copy()
    # The pyramid's edges are where a Householder reflection has them.
    h[0] += np.copysign(1.0, d[0])
    across = (np.eye(3) - 2.0 * np.outer(h, h) / h.dot(h))[1:]
    slope = np.tan(DIRECTION_TOLERANCE) / np.sqrt(2.0)
    C = np.array([sign * u - slope * d for u in across for sign in (1.0, -1.0)])
    return C @ J, across @ J, d @ J / np.linalg.norm(dx)


def largest(row, C, high, equal, bounds) -> float:
    """The largest value of row x under C x <= high, equal x = 0; NaN where there is none."""
    zeros = None if equal is None else np.zeros(len(equal))
    found = linprog(-row, C, high, equal, zeros, bounds=bounds, options=PRECISE)
    return -found.fun if found.status == 0 else np.nan


@pytest.mark.slow
@pytest.mark.parametrize('held', [None, 0, 1])
def test_the_other_component_comes_first_then_the_leading_one_and_then_its_factor(held):
    judged = 0  # by two linear programmes, of dq and beta, one after the other
    for seed in range(MANY):
        problem = Problem(seed, None, held)
        solved = problem.solved()
        if held is None and solved.s == 1.0:
            continue
        _, _, J, c = problem.parts
        C, _, along = pyramid(problem)
        least = max(problem.least - EXACT, 0.0)
        equal = np.column_stack((J, -c))
        rows = np.column_stack((np.vstack((C, along, -along)), np.zeros(6)))
        high = np.array((0.0, 0.0, 0.0, 0.0, 1.0, -least))
        bounds = [*zip(*problem.box, strict=True), (least, 1.0)]
        dq = solved.dq
        beta = J @ dq @ c / (c @ c)
        np.testing.assert_allclose(J @ dq, beta * c, atol=1e-8, err_msg=str(seed))
        a = largest(np.append(along, 0.0), rows, high, equal, bounds)
        assert abs(along @ dq - a) < 1e-6 or np.isnan(a), seed
        high[-1] = EXACT - a
        assert beta > largest(np.eye(8)[7], rows, high, equal, bounds) - 1e-5 or np.isnan(a), seed
        judged += np.isfinite(a)
    assert judged > MANY / 3


@WEIGHTS
@pytest.mark.parametrize('held', [None, 1])
def test_the_box_and_the_direction_are_kept_and_what_goes_across_is_the_least(held, power):
    for seed in range(MANY // 2):
        problem = Problem(seed, power, held)
        dq = problem.solved().dq
        lower, upper = problem.box
        assert (lower <= dq).all() and (dq <= upper).all(), seed
        C, across, along = pyramid(problem)
        assert (C @ dq <= 1e-7).all(), seed
        active = np.vstack((active_rows(dq, problem.box), C[np.abs(C @ dq) < 1e-9]))
        settled = np.vstack((along, problem.parts[2]))
        assert unexplained(across.T @ (across @ dq), settled, active) < 1e3 * EXACT, seed


@pytest.mark.slow
def test_what_gives_way_keeps_its_bounds():
    for seed in range(MANY):
        problem = Problem(seed, None, 1)
        dq = problem.solved(Yielding(weight=1.0)).dq
        _, _, J, c = problem.parts
        lower, upper = problem.box
        assert (lower <= dq).all() and (dq <= upper).all(), seed
        assert np.linalg.norm(J @ dq - c) <= SPREAD + 1e-7, seed
        assert -c @ J @ dq <= AWAY * np.linalg.norm(c) + 1e-7, seed


def test_components_that_lock_each_other_give_way_to_the_larger_one():
    """With two joints at rest five are left, of which six rows in fixed directions ask too much."""
    unlocked = 0
    for seed in range(MANY):
        problem = Problem(seed)
        first = problem.leading
        if problem.solved().component_scaling[first] < 1e-6:
            solved = problem.solved(Yielding(weight=1.0))
            unlocked += solved.component_scaling[first] > 0.05
    assert unlocked > MANY / 30


def test_where_a_search_begins_has_no_say_in_where_it_ends():
    for seed in range(40):
        sides = np.random.default_rng(seed).integers(-1, 2, 31)  # of limits that are held
        dq = Problem(seed).solved(active_set=sides).dq
        assert dq == pytest.approx(Problem(seed).solved().dq, abs=EXACT), seed


def test_a_component_that_is_held_counts_as_executed():
    problem = Problem(0)
    problem.held = [True, True]
    assert problem.solved(least=0.0).component_scaling == (1.0, 1.0)


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


def steered(q, velocity, ticks, task='pose', correction=None):
    """Where the tip of an FR3 is after some ticks of a task velocity by its position and
    orientation.
    """
    controller = Controller(
        FR3, 'minimum_acceleration', T, task=task, limits=BOX, scaling='components'
    )
    for _ in range(ticks):
        q = controller.update(q, velocity(*FR3.tip(q)), correction=correction).q_ref
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


def test_the_tip_slides_before_an_orientation_that_is_only_held_gives_way():
    q = np.array((-1.1, -1.214, 2.664, -0.161, 0.458, 1.466, 2.752))  # two joints near their ends
    _, begin = FR3.tip(q)
    hold = Correction(np.zeros(6), np.repeat((False, True), 3), np.ones(6, np.float32))
    dx = np.array((0.04, -0.045, -0.238, 0.0, 0.0, 0.0))
    _, R = steered(q, lambda *_: dx, 500, correction=hold)
    assert np.linalg.norm(rotation_error(R, begin)) < np.radians(1.0)


@pytest.mark.parametrize(('scaling', 'executed'), [('task', 0.0), ('components', 0.11)])
def test_at_a_singularity_a_translation_is_not_locked_by_the_turn_with_it(scaling, executed):
    model = RobotModel.named('lwr4')
    controller = Controller(model, 'minimum_velocity', T, task='pose', scaling=scaling)
    q = np.array((0.0, 0.0, 0.0, -1.2, 0.0, 0.0, 0.0))
    for _ in range(300):
        command = controller.update(q, np.array((0.0, 0.11, 0.0, 0.013, 0.0, 0.034)))
    assert (command.J @ command.dq)[1] == pytest.approx(executed, abs=1e-3)


def test_what_resists_is_a_limit_and_not_what_keeps_the_direction():
    settings = {'task': 'pose', 'limits': BOX, 'scaling': 'components'}
    controller = Controller(FR3, 'minimum_velocity', T, **settings)
    for _ in range(100):
        command = controller.update(FR3.arm.start, np.array((2.5, 1.0, 0.0, 4.0, 2.0, 3.0)))
        assert command.active_limits.startswith('fr3_joint')
