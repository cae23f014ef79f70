"""Faults: what a network does to messages, what sensors show, what a push does; and the robot under
them.
"""

from dataclasses import fields
from itertools import groupby, pairwise

import numpy as np
import pytest
from fake_robot_helpers import Q0, Connection
from hypothesis import given
from hypothesis import strategies as st

from redres_ros.errors import ArrayError, RangeError, UnknownNameError
from redres_ros.fake_robot.faults import Faults, Link, NetworkModel
from redres_ros.fake_robot.plant import FaultyPlant, IdealPlant, MujocoPlant
from redres_ros.fake_robot.robot import FakeRobot
from redres_ros.fake_robot.session import SessionSettings
from redres_ros.parameter import parameters
from redres_ros.robots import find_arm
from redres_ros.robots.joint_limits import JointLimits

T = 0.002  # [s]
ARM = find_arm('lwr4')
LIMITS = JointLimits.of(ARM)
MANY = 20000  # messages


# --- networks -------------------------------------------------------------------------------------


def transmit(network: NetworkModel[int], messages: int, rest: int = 100) -> list[tuple[int, int]]:
    """Message k is sent at tick k; what arrives is (tick, message), in that order."""
    arrived = []
    for tick in range(messages + rest):
        if tick < messages:
            network.send(tick, tick)
        arrived += [(tick, message) for message in network.receive(tick)]
    return arrived


@pytest.mark.parametrize('delay', [0, 7])
def test_a_delay_is_that_of_every_message(delay):
    network = NetworkModel(link=Link(delay=delay))
    assert transmit(network, 1000) == [(k + delay, k) for k in range(1000)]


def test_losses_have_the_fraction_that_was_asked_for():
    arrived = transmit(NetworkModel(2, Link(loss=0.3)), MANY)
    deviation = np.sqrt(0.3 * 0.7 * MANY)
    assert MANY - len(arrived) == pytest.approx(0.3 * MANY, abs=4.0 * deviation)


def test_in_disorder_messages_arrive_twice_and_right_after_the_next():
    arrived = transmit(NetworkModel(4, Link(disorder=0.2)), MANY)
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


LINKS = st.builds(
    Link, delay=st.integers(0, 5), loss=st.floats(0.0, 1.0), disorder=st.floats(0.0, 1.0)
)


@given(LINKS, st.integers(0, 2**32))
def test_the_same_seed_does_the_same_and_loses_the_same_whatever_else_is_at_fault(link, seed):
    arrived = transmit(NetworkModel(seed, link), 100)
    assert arrived == transmit(NetworkModel(seed, link), 100)
    assert all(tick - message >= link.delay for tick, message in arrived)
    kept = {message for _, message in transmit(NetworkModel(seed, Link(loss=link.loss)), 100)}
    missing = kept - {message for _, message in arrived}
    assert missing in (set(), {max(kept, default=0)})  # the last may wait for another for ever


# --- parameters -----------------------------------------------------------------------------------


def test_every_fault_is_a_live_parameter():
    declared = parameters(Faults)
    assert {f.name for f in fields(Faults)} - {f.name for f in declared} == {'encoder_step'}
    assert all(parameter.live for parameter in declared.values())


def test_states_and_commands_have_links_of_their_own():
    faults = Faults(state_delay=1, state_loss=0.2, disorder=0.3, command_delay=4, command_loss=0.5)
    assert faults.states == Link(1, 0.2, 0.3)
    assert faults.commands == Link(4, 0.5, 0.3)


@pytest.mark.parametrize(
    ('wrong', 'error'), [({'state_loss': 1.1}, RangeError), ({'push_force': (1.0,)}, ArrayError)]
)
def test_faults_that_cannot_be_are_refused_by_name(wrong, error):
    with pytest.raises(error, match=next(iter(wrong))):
        Faults(**wrong)


# --- arms -----------------------------------------------------------------------------------------


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
    errors = measured(plant, 2000) - [reference(k) for k in range(1, 2001)]
    # The deviation of 14000 samples is known to 0.6 %, their mean to 8e-7.
    assert errors.std() == pytest.approx(1e-4, rel=0.03)
    assert abs(errors.mean()) < 4e-6
    assert (
        errors + [reference(k) for k in range(1, 2001)] == measured(ideal(encoder_noise=1e-4), 2000)
    ).all()
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


# --- the robot under faults -----------------------------------------------------------------------


class Loop:
    """A robot and a client that mirrors the position until it commands, and then asks for a gentle
    swing from there.
    """

    def __init__(self, faults: Faults | None = None, profile: str = 'lwr_fri1') -> None:
        plant = FaultyPlant(IdealPlant(LIMITS.joint_names, T, np.zeros(7)))
        settings = SessionSettings(profile=profile, monitor_time=0.1)
        self.robot = FakeRobot(plant, LIMITS, settings)
        self.session = self.robot.session
        self.connection = Connection(self.robot)
        self.states: NetworkModel[int] = NetworkModel('0 states')
        self.start = np.zeros(7)
        self.start_tick = 0  # where and at which tick the swing begins
        self.references = [self.robot.reference]
        self.inject(faults or Faults())

    def inject(self, faults: Faults) -> None:
        self.states.link = faults.states
        self.connection.receiver.network.link = faults.commands

    def run(self, cycles: int) -> 'Loop':
        for _ in range(cycles):
            tick = self.robot.tick
            self.connection.advance()
            self.references.append(self.robot.reference)
            self.states.send(tick, tick)
            for state in self.states.receive(tick):
                self.connection.send(state, self._command(state))
        return self

    def _command(self, tick: int) -> np.ndarray:
        if not self.session.commanding:
            self.start = self.robot.reference
            self.start_tick = tick
        return self.start + reference(max(tick - self.start_tick, 0)) - Q0


@pytest.mark.parametrize('profile', ['lwr_fri1', 'sunrise'])
def test_a_few_lost_states_and_commands_are_bridged(profile):
    loop = Loop(Faults(state_loss=0.015, command_loss=0.015), profile).run(5000)
    assert (loop.session.commanding, loop.session.reason) == (True, '')
    assert loop.session.timing.counts['bridged'] > 50
    assert (np.abs(np.diff(loop.references, 2, axis=0)) <= LIMITS.acceleration * T * T).all()


def test_a_fault_that_sets_in_stops_the_arm_gently_and_reset_recovers():
    loop = Loop().run(400)
    assert loop.session.commanding
    loop.inject(Faults(command_delay=8))
    loop.run(400)
    assert loop.session.reason == 'timing: the newest command is 6 cycles late, 5 are bridged'
    assert loop.session.timing.at_fault == 'miss_rate'
    stop = np.array(loop.references[-401:])
    assert (np.abs(np.diff(stop, 2, axis=0)) <= LIMITS.acceleration * T * T + 1e-12).all()
    assert (stop[-1] == stop[-2]).all()
    loop.inject(Faults())
    loop.session.reset()
    assert loop.run(400).session.commanding


def test_of_states_and_commands_in_disorder_some_are_refused_and_none_does_harm():
    loop = Loop(Faults(disorder=0.02)).run(5000)
    assert loop.session.refusals.keys() == {'out of order'}
    assert (loop.session.commanding, loop.session.reason) == (True, '')
    assert (np.abs(np.diff(loop.references, 2, axis=0)) <= LIMITS.acceleration * T * T).all()
