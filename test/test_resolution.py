"""resolve(): task executed, optimal in the norm of W, and tame where J loses rank."""

import numpy as np
import pytest
from doubles import dependent_levels
from hypothesis import given
from hypothesis import strategies as st
from scipy.linalg import null_space

from redres_ros import RobotModel
from redres_ros.errors import ArrayError
from redres_ros.resolution import (
    SINGULAR_RATIO,
    Factor,
    Solution,
    Square,
    _resolve_carefully,
    resolve,
    resolve_in_order,
    resolve_one,
)

SHAPES = ((1, 7), (3, 7), (6, 7), (7, 7), (2, 3))
ROUNDING = 1e-11  # 1e-16 times the condition of J and W below, which stays under 1e5


def random_problem(
    m: int, n: int, seed: int
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """J (m, n) and W (n, n), both far from singular, dx (m,) and b (n,)."""
    random = np.random.default_rng((m, n, seed))
    J = with_singular_values(random.uniform(0.3, 2.0, m), n, random)
    L = with_singular_values(random.uniform(0.1, 3.0, n), n, random)
    return J, random.normal(size=m), random.normal(size=n), L @ L.T


def with_singular_values(values: np.ndarray, n: int, random: np.random.Generator) -> np.ndarray:
    """A random matrix with as many rows as there are singular values, and n columns."""
    U, _ = np.linalg.qr(random.normal(size=(len(values), len(values))))
    V, _ = np.linalg.qr(random.normal(size=(n, n)))
    return (U * values) @ V[: len(values)]


PROBLEMS = [random_problem(m, n, seed) for m, n in SHAPES for seed in range(20)]
WEIGHTS = pytest.mark.parametrize('weighted', [False, True], ids=['identity', 'weighted'])


def problems(weighted: bool) -> list[tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray | None]]:
    return [(J, dx, b, W if weighted else None) for J, dx, b, W in PROBLEMS]


@pytest.mark.parametrize('form', ['identity', 'weight', 'factor', 'square'])
def test_it_is_the_formula_of_the_paper_written_plainly(form):
    for J, dx, b, W in PROBLEMS:
        M = np.eye(len(b)) + 0.1 * W  # of a condition so small that inverting loses nothing
        weight, F = {
            'identity': (None, np.eye(len(b))),
            'weight': (M, np.linalg.cholesky(M).T),
            'factor': (Factor(np.linalg.cholesky(M).T), np.linalg.cholesky(M).T),
            'square': (Square(M), M),
        }[form]
        inverse = np.linalg.inv(F.T @ F)
        J_W = inverse @ J.T @ np.linalg.inv(J @ inverse @ J.T)  # Eq. (A.5)
        assert resolve(J, dx, b, weight) == pytest.approx(b + J_W @ (dx - J @ b), abs=1e-12)


@pytest.mark.parametrize('kind', [int, np.float32])
def test_numbers_of_other_types_are_taken(kind):
    J = np.eye(3, 7, dtype=kind)
    W = np.diag(np.arange(1, 8)).astype(kind)
    dx = np.arange(3, dtype=kind)
    b = np.arange(7, dtype=kind)
    expected = resolve(*(given.astype(float) for given in (J, dx, b, W)))
    assert (resolve(J, dx, b, W) == expected).all()


@WEIGHTS
def test_a_planar_arm_is_damped_only_where_it_is_asked_to_leave_its_plane(weighted):
    """Its row of zeros changes nothing of what the others ask for."""
    for J, dx, b, W in problems(weighted):
        if len(J) == len(b):
            continue
        flat = np.insert(J, 1, 0.0, axis=0)
        for out_of_plane in (0.0, 0.5):
            dq, damped = resolve_one(flat, np.insert(dx, 1, out_of_plane), b, W)
            assert dq == pytest.approx(resolve(J, dx, b, W), abs=ROUNDING)
            assert damped is (out_of_plane > 0.0)


def test_arguments_are_left_as_they_are():
    for problem in PROBLEMS:
        before = [array.copy() for array in problem]
        resolve(*problem)
        assert all((array == copy).all() for array, copy in zip(problem, before, strict=True))


def near_singular(ratio: float, largest: float) -> np.ndarray:
    """J (3, 7), always in the same directions, whose smallest singular value is that share of the
    largest one.
    """
    return with_singular_values(largest * np.array((1.0, 0.6, ratio)), 7, np.random.default_rng(5))


@WEIGHTS
@pytest.mark.parametrize('ratio', [1.01, 0.9, 0.3, 0.01, 0.0])
@pytest.mark.parametrize('largest', [0.1, 10.0])
def test_a_lost_direction_is_executed_to_the_share_of_its_singular_value(weighted, ratio, largest):
    """The rest is what the motion without that direction does along it (end of Appendix A)."""
    J = near_singular(ratio * SINGULAR_RATIO, largest)
    W = random_problem(3, 7, 1)[3] if weighted else None
    b = np.linspace(-1.0, 1.0, 7)
    dx = np.array((0.1, -0.2, 0.3))
    U = np.linalg.svd(J)[0]
    lost = U[:, 2]
    without = resolve(U[:, :2].T @ J, U[:, :2].T @ dx, b, W)
    share = min(ratio, 1.0) ** 2
    expected = share * (lost @ dx) + (1.0 - share) * (lost @ J @ without)
    dq = resolve(J, dx, b, W)
    assert lost @ J @ dq == pytest.approx(expected, abs=1e-9)
    change = dq - b if W is None else W @ (dq - b)
    assert null_space(J).T @ change == pytest.approx(0.0, abs=1e-9)  # Section 3: still the least


@pytest.mark.parametrize('W', [None, np.diag(np.arange(1.0, 8.0))])
def test_without_any_task_direction_the_bias_is_followed(W):
    b = np.linspace(-1.0, 1.0, 7)
    assert (resolve(np.zeros((3, 7)), np.ones(3), b, W) == b).all()


@given(st.lists(st.floats(-6.0, 0.0), min_size=1, max_size=6), st.integers(0, 99), st.booleans())
def test_the_quick_way_gives_what_the_careful_one_gives(exponents, seed, weighted):
    """resolve factors where it can prove that nothing is to be damped; the orthogonal
    transformations must agree with it.
    """
    random = np.random.default_rng(seed)
    J = with_singular_values(10.0 ** np.array(exponents), 7, random)
    _, dx, b, W = random_problem(len(J), 7, seed)
    W = W if weighted else None
    careful, _ = _resolve_carefully(J, dx, b, W, 0.0, np.inf)
    # Relative rounding of a solution is the condition of J W^-1 J', at most 1e9, times 1e-16.
    tolerance = 1e-6 * np.linalg.norm(careful)
    assert resolve(J, dx, b, W) == pytest.approx(careful, abs=tolerance)


def test_a_factor_of_condition_a_million_costs_the_task_no_digits():
    """Of its square, of condition 1e12, four digits would be left."""
    random = np.random.default_rng(8)
    for _ in range(50):
        J = with_singular_values(random.uniform(0.3, 2.0, 6), 7, random)
        F = np.linalg.qr(with_singular_values(np.logspace(-3, 3, 7), 7, random))[1]
        dx, b = random.normal(size=6), random.normal(size=7)
        dq = resolve(J, dx, b, Factor(F))
        assert J @ dq == pytest.approx(dx, abs=1e-9)
        slope = (F @ null_space(J)).T @ (F @ (dq - b))
        assert np.abs(slope).max() < 1e-9 * np.linalg.norm(F, 2) * np.linalg.norm(F @ (dq - b))


def test_conditioning_at_a_singularity_is_judged_on_the_jacobian_alone():
    """A weight that makes one direction a million times as heavy is no singularity."""
    J = with_singular_values(np.array((1.0, 0.7, 0.5)), 7, np.random.default_rng(9))
    W = np.diag((1e6, 1.0, 1.0, 1e6, 1.0, 1.0, 1e6))
    dx = np.array((0.1, -0.2, 0.3))
    assert J @ resolve(J, dx, np.ones(7), W) == pytest.approx(dx, abs=1e-9)


def random_levels(seed: int, rows: tuple[int, ...] = (3, 2, 1)) -> tuple[list, np.ndarray, Factor]:
    """Tasks that do not conflict, for 7 joints, with b and a weight by its factor."""
    random = np.random.default_rng(seed)
    levels = [(random.normal(size=(m, 7)), random.normal(size=m)) for m in rows]
    F = np.linalg.qr(with_singular_values(random.uniform(0.3, 2.0, 7), 7, random))[1]
    return levels, random.normal(size=7), Factor(F)


WEIGHT_KINDS = pytest.mark.parametrize(
    'kind', [lambda W: None, np.asarray, lambda W: W], ids=['identity', 'matrix', 'factor']
)


@WEIGHT_KINDS
def test_a_lower_task_never_disturbs_a_higher_one(kind):
    """The second one asks for what the first one forbids; four levels in all."""
    for seed in range(20):
        levels, b, W = random_levels(seed, (3, 3, 3, 2))
        levels[1][0][0] = levels[0][0][1]
        alone, _ = resolve_in_order(levels[:1], b, kind(W))
        pair, _ = resolve_in_order(levels[:2], b, kind(W))
        all_four, _ = resolve_in_order(levels, b, kind(W))
        first, second = levels[0][0], levels[1][0]
        assert first @ all_four == pytest.approx(first @ alone, abs=1e-10)
        assert second @ all_four == pytest.approx(second @ pair, abs=1e-9)


def hierarchy(levels: list, b: np.ndarray, W: np.ndarray) -> tuple[np.ndarray, float]:
    """Eq. (20) once more: dense, from singular values in y = F (dq - b), W = F'F.

    Returns:
        dq (n,), and the smallest singular value that counts, beside that of the whole task.
    """
    F = np.linalg.cholesky(W).T
    N = np.eye(len(b))  # onto the null space of the tasks above, in y
    y = np.zeros(len(b))
    P = np.eye(len(b))  # the same in dq, for the judgement
    least = 1.0
    for J, dx in levels:
        A = J @ np.linalg.inv(F)
        values = np.linalg.svd(J @ P, compute_uv=False) / np.linalg.norm(J, 2)
        rank = int(np.count_nonzero(values > 1e-9))
        least = min((least, *values[:rank]))
        U, s, Vt = np.linalg.svd(A @ N)
        V = Vt[:rank].T
        y = y + V @ (U[:, :rank].T @ (dx - J @ b - A @ y) / s[:rank])
        N = N - V @ V.T
        in_dq = np.linalg.svd(J @ P)[2][:rank].T
        P = P - in_dq @ in_dq.T
    return b + np.linalg.solve(F, y), least


@pytest.mark.parametrize('power', [0, 1, 2], ids=['identity', 'M', 'M M'])
@pytest.mark.parametrize('arm', ['fr3', 'gen3', 'iiwa7'])
def test_a_third_task_is_best_below_a_second_one_that_the_first_decides(arm, power):
    """Position, the same position with another velocity, orientation."""
    model = RobotModel.named(arm)
    compared = 0
    for seed in range(50):
        levels, b, M = dependent_levels(model, seed)
        expected, least = hierarchy(levels, b, np.linalg.matrix_power(M, power))
        if least < 0.01 or np.linalg.norm(expected) > 20.0:
            continue  # beside a singularity of any of them there is damping
        dq, _ = resolve_in_order(levels, b, (None, M, Square(M))[power])
        # condition of M up to 1e5, of M M up to 1e10 in what the factor squares
        assert dq == pytest.approx(expected, abs=1e-7)
        compared += 1
    assert compared > 30


def test_what_is_desired_is_what_is_executed_and_what_a_singularity_blocks():
    executed = np.array((0.1, 0.2, 0.3))
    assert (Solution(np.zeros(7), np.eye(3, 7), executed).desired == executed).all()
    solution = Solution(np.zeros(7), np.eye(3, 7), executed, np.ones(3))
    assert (solution.desired == executed + 1.0).all()


SHAPES_OF = {'J': (3, 7), 'dx': (3,), 'b': (7,)}
NOT_FINITE = (np.nan, np.inf, -np.inf)
CHANGES = [
    {'dx': np.ones(4)},
    {'b': np.ones(3)},
    {'W': np.ones((3, 3))},
    {'J': np.ones((7, 3))},
    {'J': np.ones((1, 3, 7))},
    {'J': np.ones((0, 7))},
    {'W': np.full((7, 7), np.nan)},
    {'W': np.diag((1.0, 1.0, 1.0, 0.0, 1.0, 1.0, 1.0))},
    {'W': -np.eye(7)},
    *({name: np.full(shape, value)} for name, shape in SHAPES_OF.items() for value in NOT_FINITE),
]


@pytest.mark.filterwarnings('error')
@pytest.mark.parametrize('changes', CHANGES, ids=range(len(CHANGES)))
def test_what_is_no_problem_is_refused_by_name_in_one_line(changes):
    J, dx, b, W = random_problem(3, 7, 0)
    (name,) = changes
    with pytest.raises(ArrayError, match=f'^[^\n]*{name}[^\n]*$'):
        resolve(**({'J': J, 'dx': dx, 'b': b, 'W': W} | changes))
