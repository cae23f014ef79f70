"""solve_constrained(): the box always, then rows, the largest task scaling, the law."""

import numpy as np
import pytest
from doubles import dependent_levels
from nightly import NIGHTLY
from scipy.optimize import linprog, nnls

from redres_ros import RobotModel
from redres_ros.resolution import Factor, Square, resolve, resolve_in_order
from redres_ros.solver import Constrained, solve_constrained

MANY = 100_000 if NIGHTLY else 300
EXACT = 1e-9  # what is asked of shares and optimality residuals; rounding leaves 1e-12
PRECISE = {'primal_feasibility_tolerance': 1e-10, 'dual_feasibility_tolerance': 1e-10}
WEIGHTS = pytest.mark.parametrize('power', [None, 1, 2], ids=['identity', 'M', 'M M'])
STRETCHES = pytest.mark.parametrize('stretch', [1.0, 10.0])
HALVES = (slice(0, 20), slice(20, 40))  # of rows


def weight(power: int | None, n: int, random: np.random.Generator) -> np.ndarray | None:
    """None, or a power of a random inertia of condition 1e3."""
    if power is None:
        return None
    V, _ = np.linalg.qr(random.normal(size=(n, n)))
    M = (V * np.geomspace(1e-3, 1.0, n)) @ V.T
    M = (M + M.T) / 2.0
    return np.linalg.matrix_power(M, power)


class Problem:
    """One of sns_ik's distribution: dx made from a velocity in the box, times a scale.

    At most times all of it can be executed; a `stretch` of 10 makes the share less than one.
    """

    def __init__(self, seed: int, power: int | None = None, stretch: float = 1.0) -> None:
        random = np.random.default_rng(seed)
        self.J = random.uniform(-2.0, 2.0, (3, 7))
        self.box = random.uniform(-5.0, -0.5, 7), random.uniform(0.5, 5.0, 7)
        self.scale = stretch * random.uniform(0.2, 1.2)
        self.dx = self.J @ random.uniform(*self.box) * self.scale
        self.task = self.J, self.dx
        self.b = random.normal(size=7)
        self.W = weight(power, 7, random)
        self.dq_free = resolve(self.J, self.dx, self.b, self.W)

    def bounded(self) -> Constrained:
        return solve_constrained(self.dq_free, self.W, [self.task], self.box)


def largest_share(J, dx, box, C=None, low=None, high=None) -> float:
    """The largest s in [0, 1] with J dq = s dx by linear programming; NaN where there is none."""
    n = J.shape[1]
    inequalities = {}
    if C is not None:
        rows = np.vstack((C, -C))
        inequalities = {
            'A_ub': np.column_stack((rows, np.zeros(len(rows)))),
            'b_ub': np.concatenate((high, -low)),
        }
    found = linprog(
        np.append(np.zeros(n), -1.0),
        A_eq=np.column_stack((J, -dx)),
        b_eq=np.zeros(len(dx)),
        bounds=[*zip(*box, strict=True), (0.0, 1.0)],
        options=PRECISE,
        **inequalities,
    )
    return found.x[-1] if found.status == 0 else np.nan


def unexplained(gradient, equalities, active) -> float:
    """The largest part of a gradient that no multipliers explain, beside its own size.

    equalities: rows whose multipliers may have any sign; active: rows that point out of the limits.
    At the least of a convex function it is zero, and nowhere else.
    """
    rows = np.vstack((equalities, -equalities, active))
    _, residual = nnls(rows.T, -gradient)
    return residual


def gap_to_the_largest_share(problem: Problem, bounded: Constrained) -> float:
    """What the largest share can be more than the one found, by weak duality.

    For any multipliers the linear programme's optimum is at most the share plus what the
    multipliers leave of its gradient, times the way there, plus what they weigh of slack.
    """
    lower = np.append(problem.box[0], 0.0)
    upper = np.append(problem.box[1], 1.0)
    z = np.append(bounded.dq, bounded.s)
    task = np.column_stack((problem.J, -problem.dx))
    unit = np.eye(len(z))
    at_upper = upper - z < EXACT
    at_lower = z - lower < EXACT
    rows = np.vstack((task, -task, unit[at_upper], -unit[at_lower]))
    slack = np.concatenate((np.zeros(2 * len(task)), (upper - z)[at_upper], (z - lower)[at_lower]))
    multipliers, rest = nnls(rows.T, unit[-1])
    return rest * np.linalg.norm(upper - lower) + multipliers @ slack


def active_rows(dq, box, near=1e-9) -> np.ndarray:
    """Unit rows of the joints at an end of the box, pointing out of it."""
    lower, upper = box
    unit = np.eye(len(dq))
    return np.vstack((unit[dq >= upper - near], -unit[dq <= lower + near]))


def assert_least_for_law(dq, target, W, equalities, active) -> None:
    W = np.eye(len(dq)) if W is None else W
    terms = np.abs(W).max() * max(np.abs(dq).max(), np.abs(target).max())
    assert unexplained(W @ (dq - target) / terms, equalities, active) < EXACT


def is_relaxed(bounded: Constrained) -> bool:
    """Whether rows or the first task's direction could not be kept."""
    return not bounded.solved or bounded.excess > EXACT or bounded.error > EXACT


def test_a_velocity_that_keeps_every_limit_comes_back_to_rounding():
    problem = Problem(0)
    wide = np.full(7, -100.0), np.full(7, 100.0)
    bounded = solve_constrained(
        problem.dq_free, None, [(problem.J, problem.dx)], wide, [(np.eye(7), *wide)]
    )
    assert bounded.dq == pytest.approx(problem.dq_free, abs=1e-12)
    assert bounded.s == 1.0 and not is_relaxed(bounded)


@WEIGHTS
@STRETCHES
def test_the_share_is_the_largest_in_the_direction_of_the_task_and_then_the_law_is_best(
    power, stretch
):
    for seed in range(MANY):
        problem = Problem(seed, power, stretch)
        bounded = problem.bounded()
        assert not is_relaxed(bounded), seed
        assert problem.J @ bounded.dq == pytest.approx(bounded.s * problem.dx, abs=EXACT), seed
        assert gap_to_the_largest_share(problem, bounded) < EXACT, seed
        if stretch == 1.0:  # made of a velocity within the box
            assert bounded.s >= min(1.0 / problem.scale, 1.0) - EXACT, seed
        if seed % 10 == 0:
            share = largest_share(problem.J, problem.dx, problem.box)
            assert bounded.s == pytest.approx(share, abs=EXACT), seed
        active = active_rows(bounded.dq, problem.box)
        assert_least_for_law(bounded.dq, problem.b, problem.W, problem.J, active)


def test_a_factor_is_as_good_as_its_weight():
    for seed in range(MANY):
        problem = Problem(seed, 1)
        by_weight = solve_constrained(
            problem.dq_free, problem.W @ problem.W, [problem.task], problem.box
        )
        factor = Factor(problem.W)
        by_factor = solve_constrained(problem.dq_free, factor, [problem.task], problem.box)
        assert by_factor.dq == pytest.approx(by_weight.dq, abs=1e-6)  # condition 1e6, 1e-10 of it


def test_without_a_velocity_the_share_is_one():
    problem = Problem(1)
    dq_free = resolve(problem.J, np.zeros(3), 10.0 * problem.b)
    bounded = solve_constrained(dq_free, None, [(problem.J, np.zeros(3))], problem.box)
    assert bounded.s == 1.0
    assert problem.J @ bounded.dq == pytest.approx(np.zeros(3), abs=EXACT)


def off_zero(seed: int) -> Problem:
    """A problem whose box holds no rest: the arm cannot brake as fast as the task would like."""
    problem = Problem(seed)
    middle = np.random.default_rng((seed, 1)).normal(size=7)
    problem.box = middle - 0.1, middle + 0.1
    return problem


@pytest.mark.slow
def test_where_no_share_will_do_the_error_is_least_and_then_the_share_largest():
    relaxed = 0
    for seed in range(MANY):
        problem = off_zero(seed)
        J, dx, box = problem.J, problem.dx, problem.box
        bounded = problem.bounded()
        error = J @ bounded.dq - bounded.s * dx
        assert bounded.error == pytest.approx(np.linalg.norm(error), abs=EXACT)
        if not is_relaxed(bounded):
            continue
        relaxed += 1
        A = np.column_stack((J, -dx))
        ends = np.append(box[0], 0.0), np.append(box[1], 1.0)
        z = np.append(bounded.dq, bounded.s)
        assert unexplained(A.T @ error, np.zeros((0, 8)), active_rows(z, ends)) < EXACT, seed
        best = linprog(
            -np.eye(8)[7], A_eq=A, b_eq=error, bounds=np.column_stack(ends), options=PRECISE
        )
        if best.status == 0:  # the error of six digits that it allows itself may empty the set
            assert bounded.s == pytest.approx(best.x[-1], abs=1e-6), seed
        assert_least_for_law(bounded.dq, problem.b, None, J, active_rows(bounded.dq, box))
    assert relaxed > MANY / 2


def test_a_lower_task_has_the_least_error_and_leaves_the_upper_one_alone():
    for seed in range(MANY):
        problem = Problem(seed, 1)
        problem.dq_free *= 10.0  # out of the box
        random = np.random.default_rng((seed, 2))
        second = random.uniform(-2.0, 2.0, (2, 7)), random.normal(size=2)
        third = random.uniform(-2.0, 2.0, (1, 7)), random.normal(size=1)
        tasks = [(problem.J, problem.dx), second, third]
        bounded = solve_constrained(problem.dq_free, problem.W, tasks, problem.box)
        assert bounded.s == pytest.approx(problem.bounded().s, abs=EXACT)
        assert problem.J @ bounded.dq == pytest.approx(bounded.s * problem.dx, abs=EXACT)
        active = active_rows(bounded.dq, problem.box)
        above = problem.J
        for J, dx in (second, third):
            gradient = J.T @ (J @ bounded.dq - dx)
            assert unexplained(gradient, above, active) < 1e2 * EXACT, seed
            above = np.vstack((above, J))


@WEIGHTS
@pytest.mark.parametrize('arm', ['fr3', 'gen3', 'iiwa7'])
def test_a_third_task_is_best_below_a_second_one_that_the_first_decides(arm, power):
    """Position, the same position with another velocity, orientation: within a box that acts."""
    model = RobotModel.named(arm)
    random = np.random.default_rng(0)
    acted = 0
    for seed in range(50):
        levels, b, M = dependent_levels(model, seed)
        W = (M, Square(M))[power - 1] if power else None
        dq_free, _ = resolve_in_order(levels, b, W)
        tasks = [levels[0]] + [(J, J @ dq_free) for J, _ in levels[1:]]
        box = random.uniform(-1.0, -0.3, model.n), random.uniform(0.3, 1.0, model.n)
        bounded = solve_constrained(dq_free, W, tasks, box)
        J, dx = levels[-1]
        gradient = J.T @ (J @ bounded.dq - dx)
        active = active_rows(bounded.dq, box)
        acted += len(active) > 0
        assert unexplained(gradient, levels[0][0], active) < 1e2 * EXACT, seed
    assert acted > 20


def torque_like(seed: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Rows as torque limits have them, of two or three digits, between generous and impossible."""
    random = np.random.default_rng((seed, 3))
    C = 500.0 * weight(1, 7, random)
    middle = C @ random.normal(size=7) * random.choice((1.0, 10.0))
    width = random.uniform(0.0, 100.0, 7)
    return C, middle - width, middle + width


def test_rows_have_the_least_excess_that_the_box_allows_and_then_the_share_is_the_largest():
    exceeded = 0
    for seed in range(MANY):
        problem = Problem(seed)
        C, low, high = torque_like(seed)
        tasks = [(problem.J, problem.dx)]
        bounded = solve_constrained(problem.dq_free, None, tasks, problem.box, [(C, low, high)])
        value = C @ bounded.dq
        excess = np.maximum(value - high, 0.0) + np.minimum(value - low, 0.0)
        assert bounded.excess == pytest.approx(np.linalg.norm(excess), abs=1e3 * EXACT), seed
        if bounded.excess < 1e-6:
            share = largest_share(problem.J, problem.dx, problem.box, C, low, high)
            if seed % 3 == 0 and not is_relaxed(bounded) and np.isfinite(share):
                # of HiGHS with rows of 1e3
                assert bounded.s == pytest.approx(share, abs=1e-7), seed
            continue
        exceeded += 1
        gradient = C.T @ excess / np.abs(C).max() / np.linalg.norm(excess)
        active = active_rows(bounded.dq, problem.box)
        assert unexplained(gradient, np.zeros((0, 7)), active) < 1e2 * EXACT, seed
    assert exceeded > MANY / 10


def test_at_rest_beside_limits_the_share_is_the_largest():
    """The search then comes to a corner where all is zero, but for rounding."""
    for seed in range(MANY):
        random = np.random.default_rng(seed)
        m = random.integers(3, 7)
        J = random.uniform(-2.0, 2.0, (m, 7))
        dx = random.normal(size=m)
        upper = random.uniform(0.5, 2.0, 7)
        lower = -random.uniform(0.5, 2.0, 7)
        for i in random.permutation(7)[: random.integers(1, 4)]:  # at an end of its range
            (upper if random.random() < 0.5 else lower)[i] = 0.0
        C = random.normal(size=(8, 7))  # touching
        low, high = np.full(8, -1e3), np.zeros(8)
        box = lower, upper
        s = solve_constrained(resolve(J, dx, np.zeros(7)), None, [(J, dx)], box, [(C, low, high)]).s
        assert abs(s - largest_share(J, dx, box, C, low, high)) < 1e-6, seed


@WEIGHTS
@STRETCHES
def test_where_a_search_begins_has_no_say_in_where_it_ends(power, stretch):
    random = np.random.default_rng(0)
    for seed in range(40):
        problem = Problem(seed, power, stretch)
        rows = [torque_like(seed)] if seed % 2 else []
        arguments = problem.dq_free, problem.W, [problem.task], problem.box, rows
        expected = solve_constrained(*arguments)
        active_set = random.integers(-1, 2, 8)  # the sides of the joints, and whether s is 1
        active_set[-1] = random.choice((-1, 1))
        for begun in ('anywhere', 'where the last one ended'):
            bounded = solve_constrained(*arguments, active_set)
            assert bounded.dq == pytest.approx(expected.dq, abs=EXACT), (seed, begun)
            assert bounded.s == pytest.approx(expected.s, abs=EXACT), (seed, begun)
            assert bounded.limiting == expected.limiting, (seed, begun)


def test_many_rows_have_the_optimum_of_all_at_once(monkeypatch):
    """Some cannot be kept; the search has a few of them, and then those that it has exceeded."""
    random = np.random.default_rng(5)
    for seed in range(60):
        problem = Problem(seed)
        C = random.normal(size=(40, 7)) * 10.0 ** random.uniform(-2.0, 2.0, (40, 1))
        middle = C @ problem.dq_free * random.uniform(0.0, 1.0, 40)
        width = np.abs(C).sum(axis=1) * random.uniform(0.0, 0.3, 40)
        groups = [(C[part], (middle - width)[part], (middle + width)[part]) for part in HALVES]
        arguments = problem.dq_free, problem.W, [problem.task], problem.box, groups
        few = solve_constrained(*arguments)
        with monkeypatch.context() as all_at_once:
            all_at_once.setattr('redres_ros.solver._FEW', len(C))
            expected = solve_constrained(*arguments)
        assert few.dq == pytest.approx(expected.dq, abs=1e-7), seed
        assert few.s == pytest.approx(expected.s, abs=1e-7), seed
        assert few.excess == pytest.approx(expected.excess, rel=1e-7, abs=1e-9), seed
        if expected.limiting >= 0:
            assert few.limiting == expected.limiting, seed


def nasty(random: np.random.Generator) -> tuple:
    """Arguments of bound(), each odd in one of the ways that happen or could."""
    n = int(random.integers(1, 9))
    m = int(random.integers(1, n + 2))
    size = 10.0 ** random.uniform(-4.0, 2.0)
    J = random.normal(size=(m, n)) * 10.0 ** random.uniform(-3.0, 1.0)
    odd = random.integers(6)
    if odd == 0:
        J[:, : n // 2] = 0.0
    elif odd == 1:
        J[-1] = J[0]  # dependent
    elif odd == 2:
        J *= np.geomspace(1.0, 1e-12, m)[:, None]
    dx = J @ random.normal(size=n) * size
    if random.integers(8) == 0:
        dx = np.zeros(m)
    middle = random.normal(size=n) * size * random.integers(2)
    width = np.abs(random.normal(size=n)) * size * 10.0 ** random.uniform(-3.0, 1.0)
    width[random.random(n) < 0.1] = 0.0
    width[random.random(n) < 0.05] = np.inf
    lower = middle - width
    upper = middle + width
    dq_free = np.linalg.pinv(J) @ dx
    if random.integers(4) == 0:
        dq_free = np.clip(dq_free, lower, upper)  # on the limits
        dq_free[random.random(n) < 0.3] *= 1.0 + 1e-15
    if random.integers(4) == 0:
        dq_free = dq_free + size * random.normal(size=n)
    rows = []
    for _ in range(random.integers(3)):
        r = int(random.integers(1, n + 1))
        C = random.normal(size=(r, n)) * 10.0 ** random.uniform(-2.0, 3.0)
        C[random.random(r) < 0.1] = 0.0
        end = np.abs(C).sum(axis=1) * size
        low = end * random.uniform(-1.0, 1.0, r)
        rows.append((C, low, low + end * random.integers(2, size=r)))
    W = weight([None, 1, 2][random.integers(3)], n, random)
    return dq_free, W, [(J, dx)], (lower, upper), rows


def test_every_tick_has_a_velocity_in_the_box():
    random = np.random.default_rng(0)
    unsolved = 0
    for _ in range(1_000_000 if NIGHTLY else 3000):
        arguments = nasty(random)
        bounded = solve_constrained(*arguments)
        lower, upper = arguments[3]
        assert (bounded.dq >= lower).all() and (bounded.dq <= upper).all()
        assert 0.0 <= bounded.s <= 1.0
        unsolved += not bounded.solved
    assert unsolved == 0


@pytest.mark.parametrize('bad', [np.nan, np.inf, -np.inf])
def test_input_that_is_not_finite_brakes_within_the_box(bad):
    problem = Problem(2)
    box = np.full(7, 0.1), np.full(7, 0.5)
    for poisoned in ('dq_free', 'J', 'dx'):
        arguments = {'dq_free': problem.dq_free, 'J': problem.J, 'dx': problem.dx}
        arguments[poisoned] = np.full_like(arguments[poisoned], bad)
        task = arguments['J'], arguments['dx']
        bounded = solve_constrained(arguments['dq_free'], None, [task], box)
        assert (bounded.dq == 0.1).all(), poisoned
        assert is_relaxed(bounded), poisoned
