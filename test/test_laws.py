"""The laws. A law that is added to the table LAWS goes through every test of the first part by
itself.
"""

from dataclasses import fields

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
    ['minimum_acceleration', 'minimum_weighted_torque', 'dynamically_consistent', 'minimum_torque'],
)


def solve(law: Law, state: RobotState, dx: np.ndarray = DX) -> np.ndarray:
    return resolve(state.J[:3], dx, law.bias(state, T), law.weight(state))


def weight(law: Law, state: RobotState) -> np.ndarray:
    W = law.weight(state)
    return np.eye(len(state.q)) if W is None else np.asarray(W)


@EVERY_LAW
@EVERY_DAMPING
def test_the_task_is_executed_and_no_other_motion_is_better_in_the_norm_of_the_law(
    cls, damping, states
):
    law = cls(damping=damping)
    for state in states:
        b = law.bias(state, T)
        W = weight(law, state)
        dq = solve(law, state)
        # Rounding is relative to the fastest of the motions that add up, which gravity sets in the
        # torque laws.
        assert np.linalg.norm(state.J[:3] @ dq - DX) < ROUNDING * (1.0 + np.linalg.norm(b))
        gradient = null_space(state.J[:3]).T @ W @ (dq - b)
        size = np.linalg.norm(W, 2) * np.linalg.norm(dq - b)
        assert np.linalg.norm(gradient) < ROUNDING * size


@EVERY_LAW
def test_the_weight_is_symmetric_and_positive_definite(cls, states):
    for state in states:
        W = weight(cls(), state)
        assert W == pytest.approx(W.T, rel=1e-12, abs=1e-14)
        assert np.linalg.eigvalsh(W)[0] > 0.0


@EVERY_LAW
def test_a_law_is_a_pure_function_of_the_state(cls, states):
    law = cls()
    state, other = states[:2]
    before = {name: getattr(state, name).copy() for name in ('q', 'dq_prev', 'J', 'M', 'n')}
    first = solve(law, state)
    solve(law, other)
    assert (solve(law, state) == first).all()
    assert all((getattr(state, name) == array).all() for name, array in before.items())


@EVERY_LAW
def test_every_gain_has_a_description_and_a_range_that_holds_its_default(cls):
    for field, parameter in parameters(cls).items():
        assert '[' in parameter.description
        assert parameter.lower <= field.default <= parameter.upper
    assert set(parameters(cls)) == set(fields(cls))


@EVERY_LAW
@pytest.mark.parametrize(
    ('damping', 'T', 'bound'), [(1000.1, 0.001, 1000.0), (3.1, 1.0 / 3.0, 3.0)]
)
def test_damping_beyond_one_over_the_sampling_time_is_refused_with_the_bound(
    cls, damping, T, bound
):
    with pytest.raises(RangeError, match='1/T') as caught:
        cls(damping=damping).check_damping(T)
    assert caught.value.upper == pytest.approx(bound)
    cls(damping=bound).check_damping(T)


@pytest.mark.parametrize('name', LAWS)
def test_a_law_is_made_by_name_with_its_gains(name):
    assert make_law(name, damping=3.0) == LAWS[name](damping=3.0)
    assert law_name(make_law(name)) == name


@pytest.mark.parametrize(
    ('law', 'gains', 'allowed'),
    [('fastest', {}, tuple(sorted(LAWS))), ('minimum_velocity', {'k': 1.0}, ('damping',))],
)
def test_an_unknown_law_or_gain_is_refused_with_those_that_exist(law, gains, allowed):
    with pytest.raises(UnknownNameError) as caught:
        make_law(law, **gains)
    assert tuple(caught.value.allowed) == allowed


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
    # 0.99^2500 = 1e-11
    assert free_motion(name, damping, state, 2500)[-1] == pytest.approx(limit, abs=1e-9)


@pytest.mark.parametrize('name', ['minimum_weighted_torque', 'minimum_torque'])
def test_gravity_is_the_fraction_of_the_weight_that_moves_the_null_space(name: str) -> None:
    model = RobotModel.named('fr3')
    state = model.state(np.array(model.arm.start), np.zeros(7))  # n is the weight's alone
    falls, half, carried = (make_law(name, gravity=each).bias(state, T) for each in (1.0, 0.5, 0.0))
    assert np.abs(falls).max() > 1e-3
    assert half == pytest.approx(falls / 2.0, abs=1e-15)
    assert carried == pytest.approx(0.0, abs=1e-15)
