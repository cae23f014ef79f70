"""Whether the null space comes to rest: the bound against roots, and both against simulations."""

from collections.abc import Callable, Iterator

import numpy as np
import pytest

from redres_ros import Controller, RobotModel, make_law
from redres_ros.errors import ArrayError, RangeError
from redres_ros.laws import LAWS
from redres_ros.null_space_stability import is_stable, linearised, stability
from redres_ros.policy import Policy, make_policy

LIMITS = ('position', 'velocity', 'acceleration')
EVERY_LAW = pytest.mark.parametrize('law', LAWS)
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
    for start in random_starts(model, 5):
        found = stability(model, make_law(law, damping=30.0), 0.01, start)
        if found.comes_to_rest:
            yield model, found.q, found.stiffness


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
    found = stability(model, law, 0.01, np.array(model.arm.start))
    assert found.comes_to_rest
    assert found.spectral_radius == pytest.approx(0.0, abs=1e-9)


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


@pytest.mark.slow
@pytest.mark.parametrize('arm', ['gen3', 'fr3'])
def test_what_is_foretold_is_what_the_controller_does(arm):
    """minimum_torque at 100 Hz within the limits of the arm, from random starts."""
    model = RobotModel.named(arm)
    for start in random_starts(model, 4):
        policy = make_policy(model, 'minimum_torque', limits=LIMITS)
        found = stability(model, policy, 0.01, start)
        controller = Controller(model, 'minimum_torque', 0.01, limits=LIMITS)
        q = start
        speeds = []
        for _ in range(round(found.time / 0.01)):
            command = controller.update(q, np.zeros(3))
            q = command.q_ref
            speeds.append(np.abs(command.dq).max())
        assert (max(speeds[-40:]) < 0.1) == found.comes_to_rest


# --- what is said ---------------------------------------------------------------------------------


def test_a_law_that_oscillates_for_ever_is_reported_with_a_remedy():
    """100 Hz is below the rate of the bound at this place of rest: kappa is up to 8300 /s^2."""
    model = RobotModel.named('gen3')
    start = next(iter(random_starts(model, 1)))
    found = stability(model, make_law('minimum_torque', damping=5.0), 0.03, start, 5.0)
    assert not found.comes_to_rest
    assert str(found).startswith(
        'minimum_torque at 33.3333 Hz with damping 5 does not come to rest on gen3: with no task '
    )
    assert '\n' not in str(found)


def test_a_law_that_comes_to_rest_is_reported_with_the_time():
    model = RobotModel.named('fr3')
    found = stability(model, 'minimum_acceleration', 0.01, np.array(model.arm.start))
    assert str(found) == (
        'minimum_acceleration at 100 Hz with damping 10 comes to rest on fr3 within 0.5 s'
    )


@EVERY_LAW
def test_every_law_of_the_table_has_a_result(law):
    model = RobotModel.named('planar4r')
    found = stability(model, law, 0.01, np.array(model.arm.start), 1.0)
    assert np.isfinite(found.spectral_radius)
    assert found.time <= 1.0 + 1e-9


def test_a_damping_beyond_the_rate_is_refused():
    model = RobotModel.named('fr3')
    with pytest.raises(RangeError, match='damping'):
        stability(model, make_law('minimum_torque', damping=200.0), 0.01, np.array(model.arm.start))


def test_a_posture_of_another_arm_is_refused():
    with pytest.raises(ArrayError, match='q has shape'):
        stability(RobotModel.named('fr3'), 'minimum_torque', 0.01, np.zeros(4))
