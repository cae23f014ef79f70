"""Faults: what a network does to messages, what sensors show, what a push does."""

from dataclasses import fields
from itertools import groupby, pairwise

import numpy as np
import pytest
from fake_robot_helpers import Q0
from hypothesis import given
from hypothesis import strategies as st

from redres_ros.errors import ArrayError, RangeError, UnknownNameError
from redres_ros.fake_robot.faults import Faults, NetworkModel
from redres_ros.fake_robot.plant import FaultyPlant, IdealPlant, MujocoPlant
from redres_ros.parameter import parameters
from redres_ros.robots import find_arm
from redres_ros.robots.joint_limits import JointLimits

T = 0.002  # [s]
ARM = find_arm('lwr4')
LIMITS = JointLimits.of(ARM)
MANY = 20000  # messages


def transmit(messages: int, seed: int = 0, **faults: float) -> list[tuple[int, int]]:
    """Message k is sent at tick k; what arrives is (tick, message), in that order."""
    network = NetworkModel[int](seed)
    network.set_faults(**faults)
    arrived = []
    for tick in range(messages + 100):
        if tick < messages:
            network.send(tick, tick)
        arrived += [(tick, message) for message in network.receive(tick)]
    return arrived


@pytest.mark.parametrize('delay', [0, 7])
def test_a_delay_is_that_of_every_message(delay):
    assert transmit(1000, delay=delay) == [(k + delay, k) for k in range(1000)]


def test_losses_have_the_fraction_that_was_asked_for():
    arrived = transmit(MANY, 2, loss=0.3)
    deviation = np.sqrt(0.3 * 0.7 * MANY)
    assert MANY - len(arrived) == pytest.approx(0.3 * MANY, abs=4.0 * deviation)


def test_in_disorder_messages_arrive_twice_and_right_after_the_next():
    arrived = transmit(MANY, 4, disorder=0.2)
    order = [message for message, _ in groupby(message for _, message in arrived)]
    # The last one may wait for another for ever.
    assert sorted(order) in (list(range(MANY)), list(range(MANY - 1)))
    doubled = len(arrived) - len(order)
    assert doubled == pytest.approx(MANY / 5, abs=4.0 * np.sqrt(MANY * 4 / 25))
    at = dict(map(reversed, arrived))  # tick of arrival
    overtaken = [first for second, first in pairwise(order) if first < second]
    assert all(at[message] == at[message + 1] == message + 1 for message in overtaken)
    # A message that overtakes is not overtaken itself.
    assert len(overtaken) == pytest.approx(MANY * 0.2 / 1.2, abs=4.0 * np.sqrt(MANY * 0.2))


FAULTS = st.fixed_dictionaries(
    {'delay': st.integers(0, 5), 'loss': st.floats(0.0, 1.0), 'disorder': st.floats(0.0, 1.0)}
)


@given(FAULTS, st.integers(0, 2**32))
def test_the_same_seed_does_the_same_and_loses_the_same_whatever_else_is_at_fault(faults, seed):
    arrived = transmit(100, seed, **faults)
    assert arrived == transmit(100, seed, **faults)
    assert all(tick - message >= faults['delay'] for tick, message in arrived)
    kept = {message for _, message in transmit(100, seed, loss=faults['loss'])}
    missing = kept - {message for _, message in arrived}
    assert missing in (set(), {max(kept, default=0)})  # the last may wait for another for ever


def test_every_fault_is_a_live_parameter():
    declared = parameters(Faults)
    assert {f.name for f in fields(Faults)} - {f.name for f in declared} == {'encoder_step'}
    assert all(parameter.live for parameter in declared.values())


@pytest.mark.parametrize(
    ('wrong', 'error'), [({'state_loss': 1.1}, RangeError), ({'push_force': (1.0,)}, ArrayError)]
)
def test_faults_that_cannot_be_are_refused_by_name(wrong, error):
    with pytest.raises(error, match=next(iter(wrong))):
        Faults(**wrong)


def ideal(**faults: float) -> FaultyPlant:
    return FaultyPlant(IdealPlant(LIMITS.joint_names, T, Q0), Faults(**faults), seed=1)


def mujoco(**faults: float) -> FaultyPlant:
    return FaultyPlant(MujocoPlant(ARM, T, Q0), Faults(**faults), seed=1)


def reference(k: int) -> np.ndarray:
    """The commanded position at tick k, (n,) [rad]: a gentle swing."""
    return Q0 + 0.1 * (1.0 - np.cos(0.01 * k))


def measured(plant: FaultyPlant, cycles: int) -> np.ndarray:
    """Measured positions at ticks 1 to cycles, (cycles, n) [rad]."""
    rows = []
    for k in range(1, cycles + 1):
        plant.step(reference(k))
        rows.append(plant.q)
    return np.array(rows)


def test_without_faults_it_is_the_plant_bit_for_bit():
    faulty = mujoco()
    plant = mujoco().true
    for k in range(200):
        assert (faulty.q == plant.q).all()
        assert (faulty.dq == plant.dq).all()
        faulty.step(reference(k))
        plant.step(reference(k))


def test_encoders_round_to_their_step():
    step = 1e-3
    q = measured(ideal(encoder_step=step), 500)
    assert np.abs(q / step - np.round(q / step)).max() < 1e-9
    errors = np.abs(q - [reference(k) for k in range(1, 501)])
    assert 0.4 * step < errors.max() <= 0.5 * step + 1e-12


def test_noise_has_its_deviation_and_is_not_that_of_the_arm():
    plant = ideal(encoder_noise=1e-4)
    q = measured(plant, 2000)
    errors = q - [reference(k) for k in range(1, 2001)]
    # The deviation of 14000 samples is known to 0.6 %, their mean to 8e-7.
    assert errors.std() == pytest.approx(1e-4, rel=0.03)
    assert abs(errors.mean()) < 4e-6
    assert (q == measured(ideal(encoder_noise=1e-4), 2000)).all()
    plant.faults = Faults()
    plant.step(reference(2001))
    assert (plant.q == reference(2001)).all()


def test_velocities_of_encoders_at_fault_are_differences_of_their_positions():
    plant = mujoco(encoder_noise=1e-5, encoder_step=1e-4)
    for k in range(100):
        before = plant.q
        plant.step(reference(k))
        assert plant.dq == pytest.approx((plant.q - before) / T, abs=1e-12)


def test_a_link_that_the_arm_does_not_have_is_refused():
    with pytest.raises(UnknownNameError, match='link_9'):
        mujoco(push_link='link_9')


def test_a_push_moves_the_arm_against_its_servos_until_it_ends():
    plant = mujoco(push_force=(20.0, 0.0, -20.0))
    direct = MujocoPlant(ARM, T, Q0)
    for _ in range(300):
        direct.push(np.array([20.0, 0.0, -20.0]))
        direct.step(Q0)
        plant.step(Q0)
    assert np.abs(plant.q - Q0).max() > 1e-5
    assert (plant.q == direct.q).all()
    plant.faults = Faults()
    for _ in range(500):
        plant.step(Q0)
    assert plant.q == pytest.approx(Q0, abs=1e-9)


def test_a_force_sensor_may_have_a_bias_and_may_fail():
    plant = mujoco(push_force=(12.0, 0.0, 0.0))
    plant.step(Q0)
    true = plant.wrench
    assert np.linalg.norm(true[:3]) == pytest.approx(12.0)

    def shown(fault: str) -> np.ndarray | None:
        plant.faults = Faults(wrench_fault=fault)
        return plant.wrench

    assert shown('bias') == pytest.approx(true + 5.0 * np.eye(6)[2], abs=1e-12)
    assert np.isnan(shown('not_finite')).all()
    assert shown('lost') is None
