"""The law that looks ahead: an optimum of the whole horizon, and never off its task."""

import numpy as np
import pytest
from programs import run_python

from redres_ros import LAWS, Controller, Preview, RobotModel, load_task, make_law, resolve, run
from redres_ros.errors import ArrayError
from redres_ros.kernels.look_ahead import _RHO, plan_motion, width
from redres_ros.kernels.tick import rotation_error
from redres_ros.laws.look_ahead import _NO_PLAN, _NODES, look_ahead
from redres_ros.preview import Ahead
from redres_ros.robot_model import RobotState
from redres_ros.simulation.random_tasks import make_random_task

T = 0.002  # [s]
HORIZON = 2.0  # [s]
AHEAD = make_law('minimum_acceleration', horizon=HORIZON)
GREEDY = make_law('minimum_acceleration')
FR3 = RobotModel.named('fr3')


def path_from(model: RobotModel, q: np.ndarray, *, pose: bool = False) -> Preview:
    """The tip moves by 0.2 m in a second, and rests."""
    x, R = model.tip(q)
    times = np.linspace(0.0, 1.0, 21)
    positions = x + np.outer(times, (-0.1, 0.1, -0.14))
    return Preview(times, positions, np.tile(R, (21, 1, 1)) if pose else None)


def moving_state(model: RobotModel, ahead: Preview | None, seed: int = 1) -> RobotState:
    random = np.random.default_rng(seed)
    q = np.array(model.arm.start)
    known = Ahead(ahead, T, None)
    return RobotState(model, q, random.normal(0.0, 0.3, model.n), ahead=known)


def rows_of(R: np.ndarray, r: np.ndarray, t: float) -> tuple[np.ndarray, np.ndarray]:
    """A, b of 1/2 |A d - b|^2 = 1/2 d'R d / t + r'd and a constant."""
    L = np.linalg.cholesky(R / t)
    return L.T, -np.linalg.solve(L, r)


def linearised(model, nodes, path, m, h):
    """Jacobian and error of the path at each node; an angle counts by its arc on a metre."""
    A, e = [], []
    for j, node in enumerate(nodes):
        x, R = model.tip(node)
        at = [np.interp(T + h * (j + 1), path.times, each) for each in path.positions.T]
        error = [np.array(at) - x]
        if m > 3:
            error.append(rotation_error(R, path.rotations[0].reshape(3, 3)))
        short = [each * min(1.0, 0.1 / max(np.linalg.norm(each), 0.1)) for each in error]
        A.append(model.state(node, node).J[:m])
        e.append(np.concatenate(short))
    return np.array(A), np.array(e)


def dense_optimum(state, dx, nodes, A, e, h, damping, trust, R, r):
    """The first velocity of the problem as it is written, as least squares in all velocities."""
    K, n = nodes.shape
    steps = np.array([T] + [h] * K)
    times = np.array([T, *((steps[1:] + steps[:-1]) / 2.0)])
    rows = []
    ends = []

    def add(matrix, u_columns, end):
        row = np.zeros((len(end), (K + 1) * n))
        for column, factor in u_columns:
            row[:, column * n : column * n + n] += factor * matrix
        rows.append(row)
        ends.append(end)

    for i in range(K + 1):
        L, end = rows_of(R[i], r[i], times[i])
        if i == 0:
            add(L, [(0, 1.0)], end + L @ state.dq_prev)
        else:
            add(L, [(i, 1.0), (i - 1, -1.0)], end)
    add(np.sqrt(damping) * np.eye(n), [(K, 1.0)], np.zeros(n))
    for j in range(K):
        reached = [(i, steps[i]) for i in range(j + 2)]
        left = np.sqrt(_RHO) * (e[j] + A[j] @ (nodes[j] - state.q))
        add(np.sqrt(_RHO) * A[j], reached, left)
        add(np.sqrt(trust) * np.eye(n), reached, np.sqrt(trust) * (nodes[j] - state.q))
    M = np.concatenate(rows)
    end = np.concatenate(ends)
    J = state.J[: len(dx)]
    particular = np.zeros((K + 1) * n)
    particular[:n] = np.linalg.pinv(J) @ dx
    Z = np.zeros(((K + 1) * n, (K + 1) * n - len(dx)))
    Z[:n, : n - len(dx)] = np.linalg.svd(J)[2][len(dx) :].T
    Z[n:, n - len(dx) :] = np.eye(K * n)
    z = np.linalg.lstsq(M @ Z, end - M @ particular, rcond=None)[0]
    return (particular + Z @ z)[:n]


@pytest.mark.parametrize('pose', [False, True])
@pytest.mark.parametrize('effort', [False, True])
@pytest.mark.parametrize('robot', ['fr3', 'lwr4_paper'])
def test_the_law_is_the_first_step_of_the_dense_problem(robot, effort, pose):
    model = RobotModel.named(robot)
    n = model.n
    start = np.array(model.arm.start) + 0.2
    state = moving_state(model, path_from(model, start, pose=pose))
    state.q = start
    m = 6 if pose else 3
    K = _NODES[m]
    h = HORIZON / K
    damping = 10.0 / (1.0 + 10.0 * h)
    path = state.ahead.path
    R = np.tile(np.eye(n), (K + 1, 1, 1))
    r = np.zeros((K + 1, n))
    if effort:
        random = np.random.default_rng(3)
        M = random.normal(size=(K + 1, n, n))
        R = R + M @ M.transpose(0, 2, 1)
        r = random.normal(size=(K + 1, n))
    given = (R, r) if effort else (R[:0], r[:0])
    nodes, W, b = np.empty((K, n)), np.empty((n, n)), np.empty(n)
    L, Y = np.empty((K, n, n)), np.empty((K, n, width(n)))
    far = np.full(n, -10.0), np.full(n, 10.0)
    trust, _ = plan_motion(
        *(state.q, state.dq_prev, (T, h, damping, *far), model.kinematics.chain),
        *((path.times, path.positions, path.rotations), T, _NO_PLAN[:5]),
        *(*given, nodes, L, Y, W, b),
    )
    A, e = linearised(model, nodes, path, m, h)
    dx = np.array((-0.1, 0.1, -0.14, 0.02, -0.01, 0.03))[:m]
    expected = dense_optimum(state, dx, nodes, A, e, h, damping, trust, R, r)
    dq = resolve(state.J[:m], dx, b, W)
    assert np.abs(dq - expected).max() <= 1e-12 * np.abs(expected).max()


def test_without_a_horizon_or_a_path_it_is_the_law_of_the_paper_to_the_bit():
    task = load_task('rectangle')
    model = RobotModel.named('lwr4_paper')
    path = path_from(model, task.start)
    given = [
        (GREEDY, path),  # no horizon
        (AHEAD, None),
        (AHEAD, path.after(1.5)),  # all of it is over
        (AHEAD, Preview(path.times, path.positions + 0.2)),  # elsewhere
    ]
    controllers = [(Controller(model, law, T), ahead) for law, ahead in given]
    q = task.start
    for k in range(50):
        dx = np.array((0.001, 0.002, -0.001)) * k
        references = [each.update(q, dx, ahead=ahead).q_ref for each, ahead in controllers]
        assert all((each == references[0]).all() for each in references)
        q = references[0]


def test_on_the_rectangle_it_accelerates_far_less_than_the_law_of_the_paper():
    recording = run(Controller(RobotModel.named('lwr4_paper'), AHEAD, T), load_task('rectangle'))
    ddq = np.diff(recording.vectors('dq1'), axis=0, prepend=0.0) / T
    assert recording.finished
    assert np.linalg.norm(ddq, axis=1).max() <= 3.2  # [rad/s^2]; 8.4 without a horizon
    assert (ddq**2).sum() * T <= 17.0  # 55


def test_a_plan_that_cannot_reach_the_path_is_begun_anew():
    iiwa = RobotModel.named('iiwa7')
    task = make_random_task('near_singular', iiwa, 'iiwa7', 195)  # its first plan gets stuck
    effort = []
    for law in (AHEAD, make_law('minimum_velocity')):
        recording = run(Controller(iiwa, law, 0.005), task)
        ddq = np.diff(recording.vectors('dq1'), axis=0) / 0.005
        effort.append((ddq**2).sum())
    assert effort[0] < effort[1]  # 34 times as much


@pytest.mark.parametrize('law', ['minimum_acceleration', 'minimum_effort_ahead'])
def test_whatever_the_path_says_the_task_is_executed_and_nothing_steps(law):
    """Paths that jump, end, are missing, old, or lead elsewhere."""
    random = np.random.default_rng(7)
    limits = ('position', 'velocity', 'acceleration')
    controller = Controller(FR3, make_law(law, horizon=1.0), T, limits=limits, switch_time=0.1)
    q = np.array(FR3.arm.start)
    dq = np.zeros(7)
    A = np.array(FR3.arm.acceleration_limit)
    ahead = None
    missed = 0
    for k in range(800):
        if k % 40 == 0:
            times = np.cumsum(random.uniform(0.01, 0.3, 8)) - random.uniform(0.0, 1.0)
            spread = random.choice((0.01, 0.2, 5.0))
            ahead = Preview(times, FR3.tip(q)[0] + random.normal(0.0, spread, (8, 3)))
            if random.random() < 0.2:
                ahead = None
            if random.random() < 0.2:
                controller.switch_law(random.choice(sorted(LAWS)))
            if random.random() < 0.2:
                controller.switch_law(make_law(law, horizon=random.choice((0.5, 2.0))))
            missed = int(random.random() < 0.2)
        dx = 0.05 * np.sin(0.01 * k + np.arange(3.0)) * min(k / 200.0, 1.0)
        before = controller.bridged(controller.published, missed) if missed else None
        command = controller.update(q, dx, missed, ahead=ahead)
        if before is not None:
            q, dq = before.q, before.dq
            missed = 0
        assert (np.abs(command.dq - dq) <= A * T * (1.0 + 1e-9)).all()
        assert k < 60 or np.allclose(command.J @ command.dq, command.s * dx, atol=1e-9)  # a start
        q, dq = command.q_ref, command.dq


def test_a_path_may_have_any_memory_order():
    q = np.array(FR3.arm.start)
    path = path_from(FR3, q)
    columns = Preview(path.times, np.asfortranarray(path.positions))
    references = [
        Controller(FR3, AHEAD, T).update(q, np.array((0.1, 0.0, 0.0)), ahead=each).q_ref
        for each in (path, columns)
    ]
    assert (references[0] == references[1]).all()


@pytest.mark.parametrize('horizon', [1e-310, 1e-6, 0.01])
def test_a_horizon_too_short_for_its_steps_is_none(horizon):
    q = np.array(FR3.arm.start)
    law = make_law('minimum_effort_ahead', horizon=horizon)
    references = [
        Controller(FR3, each, T).update(q, np.array((0.1, 0.0, 0.0)), ahead=path_from(FR3, q)).q_ref
        for each in (law, GREEDY)
    ]
    assert (references[0] == references[1]).all()


def test_a_plan_goes_on_from_tick_to_tick_and_ends_with_the_velocity_history():
    controller = Controller(FR3, AHEAD, T)
    q = np.array(FR3.arm.start)
    path = path_from(FR3, q)
    controller.update(q, np.zeros(3), ahead=path)
    first = controller.published.plan
    controller.update(q, np.zeros(3), ahead=path.after(T))
    second = controller.published.plan
    # it need not be found anew
    assert 0.0 < np.abs(second.nodes - first.nodes).max() < 0.02
    for end in (controller.reset, lambda: controller.hold_at(q)):
        controller.update(q, np.zeros(3), ahead=path)
        end()
        assert controller.published is None or controller.published.plan is None


def test_nodes_that_would_raise_the_merit_are_not_taken_and_the_trust_rises():
    state = moving_state(FR3, path_from(FR3, np.array(FR3.arm.start)))
    *_, plan = look_ahead(state, state.ahead, T, HORIZON, 10.0, effort=False)
    Y = plan.Y + np.random.default_rng(1).normal(0.0, 30.0, plan.Y.shape)
    state.ahead = state.ahead._replace(plan=plan._replace(Y=Y))
    *_, after = look_ahead(state, state.ahead, T, HORIZON, 10.0, effort=False)
    assert np.abs(after.nodes - plan.nodes).max() < 0.02
    assert after.trust > plan.trust


@pytest.mark.parametrize(
    ('times', 'positions', 'orientations', 'said'),
    [
        ((0.0, 1.0), np.zeros((3, 3)), None, '(2, 3)'),
        ((0.0, 0.0), np.zeros((2, 3)), None, 'increase'),
        ((), np.zeros((0, 3)), None, 'increase'),
        ((0.0, 1.0), np.full((2, 3), np.nan), None, 'NaN'),
        ((0.0, np.inf), np.zeros((2, 3)), None, 'infinity'),
        ((0.0, 1.0), np.full((2, 3), 1e308), None, 'beyond'),
        ((0.0, 1.0), [(0.0, 0.0, 'x')] * 2, None, 'could not convert'),
        ((0.0, 1.0), np.zeros((2, 3)), np.eye(3), '(2, 3, 3)'),
    ],
)
def test_a_preview_that_cannot_be_used_is_refused(times, positions, orientations, said):
    with pytest.raises(ArrayError) as caught:
        Preview(times, positions, orientations)
    assert said in str(caught.value)


def test_what_is_compiled_is_loaded_with_the_law_and_not_in_a_tick():
    code = (
        'import sys; from redres_ros import make_law; name = "redres_ros.kernels.look_ahead"; '
        'make_law("minimum_acceleration"); before = name in sys.modules; '
        'make_law("minimum_acceleration", horizon=1.0); print(before, name in sys.modules)'
    )
    assert run_python('-c', code, check=True).stdout.split() == ['False', 'True']
