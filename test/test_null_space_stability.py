"""Whether the null space comes to rest: the bound against roots, and both against simulations."""

from collections.abc import Callable, Iterator

import numpy as np
import pytest

from redres_ros import RobotModel, make_law
from redres_ros.errors import ArrayError
from redres_ros.loop.null_space_stability import is_stable, linearised, swing_warning
from redres_ros.policy import Policy, make_policy
from redres_ros.robots import ARMS

NEAR = 1e-7  # [rad] between neighbouring motions: small beside curvature, large beside rounding

SOME = 100.0  # by which a motion may grow that decays in the end: eigenvectors are not orthogonal
MUCH = 1000.0


def random_starts(model: RobotModel, count: int) -> Iterator[np.ndarray]:
    """Postures within the ranges, (n,) [rad]."""
    random = np.random.default_rng(0)
    for _ in range(count):
        yield random.uniform(np.maximum(model.q_min, -3.0), np.minimum(model.q_max, 3.0))


def growth(
    model: RobotModel, law: str, damping: float, T: float, q: np.ndarray, duration: float
) -> float:
    """By what factor two motions come apart at most, which start at rest, NEAR each other in the
    null space.
    """
    policy = make_policy(model, law, gains={'damping': damping})
    rest = np.zeros(model.n)
    J = policy.task.jacobian(model.state(q, rest))
    Z = np.linalg.svd(J)[2][len(J) :].T
    apart = NEAR * Z @ np.ones(Z.shape[1])
    motions = [(q, rest), (q + apart, rest)]
    distances = []
    for _ in range(round(duration / T)):
        motions = [step(model, policy, T, *motion) for motion in motions]
        (q_a, dq_a), (q_b, dq_b) = motions
        if not np.abs((dq_a, dq_b)).max() < 1e3:
            return np.inf  # [rad/s], it has diverged
        distances.append(np.linalg.norm(q_a - q_b))
    return max(distances) / NEAR


def step(
    model: RobotModel, policy: Policy, T: float, q: np.ndarray, dq: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    dq = policy.solve(model.unchecked_state(q, dq), np.zeros(3), T).dq
    return q + T * dq, dq


def resting_places(arm: str, law: str) -> Iterator[tuple[RobotModel, np.ndarray, np.ndarray]]:
    """Where the law comes to rest without limits: the model, q (n,) [rad], and kappa (r,)."""
    model = RobotModel.named(arm)
    T = 0.01
    policy = make_policy(model, law, gains={'damping': 30.0})
    for start in random_starts(model, 5):
        q = start
        dq = np.zeros(model.n)
        at_rest = 0
        for _ in range(3000):
            q, dq = step(model, policy, T, q, dq)
            at_rest = at_rest + 1 if np.abs(dq).max() < 1e-3 else 0
            if at_rest == 50 or not np.abs(dq).max() < 1e3:
                break
        if np.abs(dq).max() < 0.1:  # at rest, or creeping there
            yield model, q, linearised(model, policy, T, q)[0]


def threshold(holds: Callable[[float], bool], low: float, high: float) -> float:
    """Where a bound that holds at `high` and not at `low`, or the other way round, changes."""
    at_low = holds(low)
    for _ in range(50):
        middle = np.sqrt(low * high)
        if holds(middle) == at_low:
            low = middle
        else:
            high = middle
    return low


# --- the bound ------------------------------------------------------------------------------------


def test_the_bound_says_where_the_roots_are_in_the_unit_circle():
    random = np.random.default_rng(0)
    stable = 0
    for _ in range(2000):
        T = 10.0 ** random.uniform(-3.0, -1.0)
        damping = random.uniform(0.0, 1.0) / T
        kappa = complex(*(random.normal(size=2) * 10.0 ** random.uniform(-2.0, 1.0) / T**2))
        decay = 1.0 - damping * T
        largest = np.abs(np.roots((1.0, -(1.0 + decay - T * T * kappa), decay))).max()
        if abs(largest - 1.0) > 1e-6:
            assert is_stable(kappa, damping, T) == (largest < 1.0)
            stable += largest < 1.0
    assert stable > 200


def test_without_a_field_appendix_b_is_left():
    model = RobotModel.named('fr3')
    q = np.array(model.arm.start)
    stiffness, radius = linearised(model, make_law('minimum_acceleration', damping=25.0), 0.01, q)
    assert np.abs(stiffness).max() < 1e-6
    assert radius == pytest.approx(0.75, abs=1e-6)  # lambda


@pytest.mark.parametrize('law', ['minimum_velocity', 'minimum_kinetic_energy'])
def test_a_law_without_a_velocity_history_is_at_rest_at_once(law):
    model = RobotModel.named('fr3')
    _, radius = linearised(model, law, 0.01, np.array(model.arm.start))
    assert radius == pytest.approx(0.0, abs=1e-9)


# --- the bound and simulations --------------------------------------------------------------------


@pytest.mark.slow
@pytest.mark.parametrize(
    ('arm', 'law'),
    [
        ('gen3', 'minimum_torque'),
        ('gen3', 'dynamically_consistent'),
        ('fr3', 'dynamically_consistent'),
        ('iiwa7', 'dynamically_consistent'),
    ],
)
def test_below_the_rate_of_the_bound_the_arm_swings_and_above_it_does_not(arm, law):
    compared = 0
    for model, q, stiffness in resting_places(arm, law):
        stiffest = complex(max(stiffness, key=abs))
        if stiffest.real < 100.0 or stiffness.real.min() < -0.01:
            continue  # a rate so low that 1/T is below the damping; a hill
        T = threshold(lambda T, kappa=stiffest: is_stable(kappa, 5.0, T), 1e-4, 0.2)
        assert growth(model, law, 5.0, 0.9 * T, q, 300 * T) < SOME
        assert growth(model, law, 5.0, 1.1 * T, q, 60 * T) > MUCH
        compared += 1
    assert compared > 0


@pytest.mark.slow
@pytest.mark.parametrize(('arm', 'start'), [('fr3', 2), ('fr3', 4), ('gen3', 0)])
def test_below_the_damping_of_the_bound_the_arm_swings_and_above_it_does_not(arm, start):
    """Places of rest of minimum_weighted_torque where gravity turns: kappa is complex."""
    law = 'minimum_weighted_torque'
    T = 0.005
    model, q, stiffness = list(resting_places(arm, law))[start]
    turning = complex(max(stiffness, key=lambda kappa: kappa.imag))
    assert turning.imag > 1.0
    damping = threshold(lambda damping: is_stable(turning, damping, T), 1e-2, 1.0 / T)
    # exp(0.375 * 24) = 8100 by its eigenvalue
    assert growth(model, law, 0.25 * damping, T, q, 24.0 / damping) > MUCH
    assert growth(model, law, 4.0 * damping, T, q, 24.0 / damping) < SOME


# --- what is said ---------------------------------------------------------------------------------


def test_a_law_that_may_swing_for_ever_is_reported_with_its_bound():
    """From five of twelve starts it swings for ever, within the limits of the arm."""
    warning = swing_warning(RobotModel.named('gen3'), 'minimum_torque', 0.01)
    assert warning.startswith('minimum_torque at T = 0.01 s with damping k_d = 10 may swing')
    assert '(b/k_d)^2 < 2a/(2 - k_d T) - (T a/(2 - k_d T))^2' in warning
    assert '\n' not in warning


@pytest.mark.parametrize('arm', ARMS)
@pytest.mark.parametrize(
    'law', ['minimum_velocity', 'minimum_acceleration', 'minimum_kinetic_energy']
)
def test_a_law_without_gravity_is_not_reported(arm, law):
    for T in (0.001, 0.01):
        assert swing_warning(RobotModel.named(arm), law, T) == ''


def test_an_arm_without_a_null_space_is_not_reported():
    model = RobotModel.named('planar4r')
    everything = make_policy(model, 'minimum_torque').for_joints
    assert swing_warning(model, everything, 0.01) == ''


def test_a_posture_of_another_arm_is_refused():
    with pytest.raises(ArrayError, match='q has shape'):
        linearised(RobotModel.named('fr3'), 'minimum_torque', 0.01, np.zeros(4))
