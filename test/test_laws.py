"""The laws. A law that is added to the table LAWS goes through every test of the first part by
itself.
"""

from dataclasses import dataclass, fields

import numpy as np
import pytest
from doubles import FloatingArm, SpringLaw
from scipy.linalg import null_space

from redres_ros import LAWS, Law, RobotModel, RobotState, make_law, resolve
from redres_ros.errors import RangeError, UnknownNameError
from redres_ros.laws import law_name
from redres_ros.parameter import parameters

T = 0.001  # [s]
DX = np.array((0.2, -0.1, 0.3))  # [m/s]
# Relative to the size of what is compared. Solving with M M, of a condition below 1e7 here, loses 7
# of 16 digits.
ROUNDING = 1e-8


CLASSES = {**LAWS, 'spring': SpringLaw}
EVERY_LAW = pytest.mark.parametrize('cls', CLASSES.values(), ids=CLASSES)
EVERY_DAMPING = pytest.mark.parametrize('damping', [0.0, 10.0, 1.0 / T])
WITH_MEMORY = pytest.mark.parametrize(
    'name',
    [
        'minimum_acceleration',
        'minimum_weighted_torque',
        'dynamically_consistent',
        'minimum_torque',
    ],
)
FORGOTTEN = 1.0 / T  # the damping that makes lambda zero


def solve(law: Law, state: RobotState, dx: np.ndarray = DX) -> np.ndarray:
    return resolve(state.J[:3], dx, law.bias(state, T), law.weight(state))


def weight(law: Law, state: RobotState) -> np.ndarray:
    W = law.weight(state)
    return np.eye(len(state.q)) if W is None else np.asarray(W)


def same(got: np.ndarray, expected: np.ndarray) -> bool:
    return np.linalg.norm(got - expected) <= ROUNDING * np.linalg.norm(expected)


# --- every law ------------------------------------------------------------------------------------


@EVERY_LAW
@EVERY_DAMPING
def test_the_task_is_executed(cls, damping, states):
    law = cls(damping=damping)
    for state in states:
        # Rounding is relative to the fastest of the motions that add up, which gravity sets in the
        # torque laws.
        assert np.linalg.norm(state.J[:3] @ solve(law, state) - DX) < ROUNDING * (
            1.0 + np.linalg.norm(law.bias(state, T))
        )


@EVERY_LAW
@EVERY_DAMPING
def test_no_step_in_the_null_space_is_better_in_the_norm_of_the_law(cls, damping, states):
    law = cls(damping=damping)
    for state in states:
        way = solve(law, state) - law.bias(state, T)
        W = weight(law, state)
        gradient = null_space(state.J[:3]).T @ W @ way
        assert np.linalg.norm(gradient) < ROUNDING * np.linalg.norm(W, 2) * np.linalg.norm(way)


@EVERY_LAW
def test_the_weight_is_symmetric_and_positive_definite(cls, states):
    for state in states:
        W = weight(cls(), state)
        assert W == pytest.approx(W.T, rel=1e-12, abs=1e-14)
        assert np.linalg.eigvalsh(W)[0] > 0.0


@EVERY_LAW
def test_a_law_is_a_pure_function_of_the_state(cls, states):
    law = cls()
    state = states[0]
    before = {
        name: getattr(state, name).copy() for name in ('q', 'dq_prev', 'x', 'R', 'J', 'M', 'n')
    }
    first = solve(law, state)
    solve(law, states[1])
    assert (solve(law, state) == first).all()
    assert all((getattr(state, name) == array).all() for name, array in before.items())


@EVERY_LAW
def test_every_gain_has_a_description_and_a_range_that_holds_its_default(cls):
    for field, parameter in parameters(cls).items():
        assert '[' in parameter.description
        assert parameter.lower <= field.default <= parameter.upper
    assert set(parameters(cls)) == set(fields(cls))


@EVERY_LAW
@pytest.mark.parametrize('damping', [-1e-9, np.inf, np.nan])
def test_damping_outside_its_declared_range_is_refused_at_construction(cls, damping):
    with pytest.raises(RangeError, match=f'damping is {damping}; allowed: 0 to'):
        cls(damping=damping)


@EVERY_LAW
@pytest.mark.parametrize(
    ('damping', 'T', 'bound'), [(1000.1, 0.001, '1000'), (501.0, 0.002, '500')]
)
def test_damping_beyond_one_over_the_sampling_time_is_refused_with_the_bound(
    cls, damping, T, bound
):
    with pytest.raises(
        RangeError, match=f'damping is {damping}; allowed: 0 to {bound} .*1/T.*T = {T}'
    ):
        cls(damping=damping).check_damping(T)


@EVERY_LAW
@pytest.mark.parametrize('T', [0.001, 0.002, 0.0003, 1.0 / 3.0])
def test_damping_of_exactly_one_over_the_sampling_time_is_allowed(cls, T):
    cls(damping=1.0 / T).check_damping(T)


# --- the table ------------------------------------------------------------------------------------


@pytest.mark.parametrize('name', LAWS)
def test_a_law_is_made_by_name_with_its_gains(name):
    assert make_law(name, damping=3.0) == LAWS[name](damping=3.0)
    assert law_name(make_law(name)) == name


def test_an_unknown_law_is_refused_with_the_names_that_exist():
    with pytest.raises(
        UnknownNameError,
        match="unknown law 'fastest'; allowed: dynamically_consistent, minimum_acc",
    ):
        make_law('fastest')


def test_an_unknown_gain_is_refused_with_those_of_the_law():
    with pytest.raises(
        UnknownNameError, match="unknown gain of minimum_velocity 'stiffness'; allowed: damping"
    ):
        make_law('minimum_velocity', stiffness=1.0)


# --- the paper's formulas -------------------------------------------------------------------------


def test_minimum_velocity_is_the_pseudoinverse(states):
    for state in states:
        assert same(
            solve(make_law('minimum_velocity'), state), np.linalg.pinv(state.J[:3]) @ DX
        )  # Eq. (2)


@EVERY_DAMPING
def test_minimum_acceleration_is_the_pseudoinverse_plus_the_projected_last_velocity(
    damping, states
):
    law = make_law('minimum_acceleration', damping=damping)
    for state in states:
        J_pinv = np.linalg.pinv(state.J[:3])
        P = np.eye(7) - J_pinv @ state.J[:3]
        assert same(
            solve(law, state), J_pinv @ DX + (1.0 - damping * T) * P @ state.dq_prev
        )  # Eq. (15), (23)


# --- the torque-level schemes, one tick with the rules (8), (9), (10) -----------------------------


@dataclass(frozen=True)
class Tick:
    """What a torque-level scheme knows at tick k: the state, the demanded task acceleration and J̇
    dq.
    """

    state: RobotState
    ddx: np.ndarray
    dJdq: np.ndarray


@pytest.fixture(scope='module')
def ticks(model, states) -> list[Tick]:
    """At random states, the tick before having executed its task: J_{k-1} dq_{k-1} = dx_{k-1}."""
    result = []
    for state in states:
        J_prev = model.state(state.q - T * state.dq_prev, state.dq_prev).J[:3]
        ddx = (DX - J_prev @ state.dq_prev) / T  # Eq. (8)
        result.append(Tick(state, ddx, (state.J[:3] - J_prev) / T @ state.dq_prev))  # Eq. (9), (10)
    return result


def minimum_torque(tick: Tick, k_d: float) -> np.ndarray:
    J = tick.state.J[:3]
    M_inv = np.linalg.inv(tick.state.M)
    return np.linalg.pinv(J @ M_inv, rcond=1e-12) @ (
        tick.ddx - tick.dJdq + J @ M_inv @ tick.state.n
    )  # Eq. (7)


def minimum_weighted_torque(tick: Tick, k_d: float) -> np.ndarray:
    J = tick.state.J[:3]
    M = tick.state.M
    return (
        M @ np.linalg.pinv(J) @ (tick.ddx - tick.dJdq + J @ np.linalg.inv(M) @ tick.state.n)
    )  # Eq. (25)


def dynamically_consistent(tick: Tick, k_d: float) -> np.ndarray:
    J = tick.state.J[:3]
    M = tick.state.M
    M_inv = np.linalg.inv(tick.state.M)
    task_inertia = np.linalg.inv(J @ M_inv @ J.T)
    tau_N = -k_d * M @ tick.state.dq_prev  # Eq. (34)
    P = np.eye(7) - J.T @ task_inertia @ J @ M_inv  # Eq. (30)
    return (
        J.T @ task_inertia @ (tick.ddx - tick.dJdq + J @ M_inv @ tick.state.n) + P @ tau_N
    )  # Eq. (29)


@pytest.mark.parametrize(
    ('scheme', 'damping'),
    [
        (minimum_torque, 0.0),
        (minimum_weighted_torque, 0.0),
        (dynamically_consistent, 0.0),
        (dynamically_consistent, 10.0),
        (dynamically_consistent, FORGOTTEN),
    ],
)
def test_a_torque_law_moves_as_its_torque_level_scheme_does(scheme, damping, ticks):
    law = make_law(scheme.__name__, damping=damping)
    for tick in ticks:
        ddq = np.linalg.solve(tick.state.M, scheme(tick, damping) - tick.state.n)  # Eq. (6)
        assert same(solve(law, tick.state), tick.state.dq_prev + T * ddq)  # Eq. (13)


def test_minimum_acceleration_moves_as_its_acceleration_level_scheme_does(ticks):
    for tick in ticks:
        J_pinv = np.linalg.pinv(tick.state.J[:3])
        P = np.eye(7) - J_pinv @ tick.state.J[:3]
        ddq = J_pinv @ (tick.ddx - tick.dJdq) - 10.0 * P @ tick.state.dq_prev  # Eq. (22)
        assert same(
            solve(make_law('minimum_acceleration', damping=10.0), tick.state),
            tick.state.dq_prev + T * ddq,
        )


# --- Appendix B: no task, so all of the last velocity is in the null space ------------------------


def free_motion(name: str, damping: float, state: RobotState, ticks: int) -> np.ndarray:
    """q_k (ticks + 1, n) of an arm without task and without gravity that moves at dq_prev in the
    beginning.
    """
    law = LAWS[name](damping=damping)
    q = state.q
    dq = state.dq_prev
    history = [state.q]
    arm = FloatingArm(state.M)
    for _ in range(ticks):
        q = q + T * dq
        history.append(q)
        dq = solve(law, RobotState(arm, q, dq), np.zeros(3))
    return np.array(history)


@WITH_MEMORY
@pytest.mark.parametrize('damping', [10.0, 500.0, 1.0 / T])
def test_free_motion_ends_where_appendix_b_says(name, damping, states):
    state = states[0]
    forgetting_factor = 1.0 - damping * T
    limit = state.q + T * state.dq_prev / (1.0 - forgetting_factor)  # Eq. (B.2)
    assert free_motion(name, damping, state, 2500)[-1] == pytest.approx(
        limit, abs=1e-9
    )  # 0.99^2500 = 1e-11


@pytest.mark.parametrize('name', ['minimum_weighted_torque', 'minimum_torque'])
def test_gravity_is_the_fraction_of_the_weight_that_moves_the_null_space(name: str) -> None:
    model = RobotModel.named('fr3')
    state = model.state(np.array(model.arm.start), np.zeros(7))  # n is the weight's alone
    falls, half, carried = (make_law(name, gravity=each).bias(state, T) for each in (1.0, 0.5, 0.0))
    assert np.abs(falls).max() > 1e-3
    assert half == pytest.approx(falls / 2.0, abs=1e-15)
    assert carried == pytest.approx(0.0, abs=1e-15)
