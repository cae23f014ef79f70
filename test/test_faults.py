"""Faults: what a network does to messages, what encoders show, what a push and a pause do; and the
robot under them.
"""

from dataclasses import fields, replace
from itertools import groupby, pairwise

import numpy as np
import pytest
from fake_robot_helpers import Q0, Connection
from hypothesis import given
from hypothesis import strategies as st

from redres_ros.errors import ArrayError, RangeError, RedresError, UnknownNameError
from redres_ros.fake_robot.faults import Faults, Link, NetworkModel
from redres_ros.fake_robot.plant import FaultyPlant, IdealPlant, MujocoPlant
from redres_ros.fake_robot.robot import FakeRobot
from redres_ros.fake_robot.session import Refusal, SessionSettings
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


FRACTIONS = st.floats(0.0, 1.0)
LINKS = st.builds(
    Link, delay=st.integers(0, 5), loss=FRACTIONS, duplication=FRACTIONS, reordering=FRACTIONS
)


@pytest.mark.parametrize('delay', [0, 7])
def test_a_delay_is_that_of_every_message(delay):
    network = NetworkModel(link=Link(delay=delay))
    assert transmit(network, 1000) == [(k + delay, k) for k in range(1000)]


@pytest.mark.parametrize('loss', [0.02, 0.3, 0.9])
def test_losses_have_the_fraction_that_was_asked_for(loss):
    arrived = transmit(NetworkModel(2, Link(loss=loss)), MANY)
    deviation = np.sqrt(loss * (1.0 - loss) * MANY)
    assert MANY - len(arrived) == pytest.approx(loss * MANY, abs=4.0 * deviation)


def test_a_doubled_message_arrives_twice_in_a_row():
    arrived = transmit(NetworkModel(4, Link(duplication=0.25)), MANY)
    times = [len(list(group)) for _, group in groupby(arrived)]
    assert len(times) == MANY
    assert set(times) == {1, 2}
    assert times.count(2) == pytest.approx(MANY / 4, abs=4.0 * np.sqrt(MANY * 3 / 16))


def test_a_reordered_message_arrives_with_the_next_and_after_it():
    arrived = transmit(NetworkModel(5, Link(reordering=0.2)), MANY)
    order = [message for _, message in arrived]
    overtaken = [k for k, (first, second) in enumerate(pairwise(order)) if first > second]
    assert all(
        order[k] == order[k + 1] + 1 and arrived[k][0] == arrived[k + 1][0] for k in overtaken
    )
    # The last one may wait for another for ever.
    assert sorted(order) in (list(range(MANY)), list(range(MANY - 1)))
    # A message that overtakes is not overtaken itself.
    assert len(overtaken) == pytest.approx(MANY * 0.2 / 1.2, abs=4.0 * np.sqrt(MANY * 0.2))


@given(LINKS, st.integers(0, 2**32))
def test_the_same_seed_does_the_same_and_nothing_arrives_unsent_or_too_early_or_too_late(
    link, seed
):
    arrived = transmit(NetworkModel(seed, link), 100)
    assert arrived == transmit(NetworkModel(seed, link), 100)
    for tick, message in arrived:
        assert tick - message >= link.delay
        assert tick - message == link.delay or link.reordering
    counts = [sum(message == k for _, message in arrived) for k in range(100)]
    assert max(counts) <= (2 if link.duplication else 1)
    assert min(counts) == 1 or link.loss or link.reordering


@given(LINKS, LINKS, st.integers(0, 99))
def test_setting_one_fault_does_not_change_when_messages_are_lost(link, other, seed):
    lossy = replace(other, loss=link.loss, reordering=0.0)
    arrived = [
        {message for _, message in transmit(NetworkModel(seed, each), 100)}
        for each in (lossy, Link(loss=link.loss))
    ]
    assert arrived[0] == arrived[1]


# --- parameters -----------------------------------------------------------------------------------


def test_every_fault_is_a_live_parameter():
    declared = parameters(Faults)
    assert {f.name for f in fields(Faults)} - {f.name for f in declared} == {'encoder_step'}
    assert all(parameter.live for parameter in declared.values())
    assert len(declared) <= 12


def test_states_and_commands_have_links_of_their_own():
    faults = Faults(state_delay=1, state_loss=0.2, disorder=0.3, command_delay=4, command_loss=0.5)
    assert faults.states == Link(1, 0.2, 0.3, 0.3)
    assert faults.commands == Link(4, 0.5, 0.3, 0.3)


@pytest.mark.parametrize(
    ('wrong', 'error'),
    [
        ({'state_loss': 1.1}, RangeError),
        ({'command_delay': -1}, RangeError),
        ({'encoder_noise': np.nan}, RangeError),
        ({'push_force': (0.0, 0.0, 501.0)}, RangeError),
        ({'push_force': (1.0,)}, ArrayError),
        ({'wrench_fault': 'broken'}, UnknownNameError),
    ],
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


@pytest.mark.parametrize('make', [ideal, mujoco])
def test_without_faults_it_is_the_plant_bit_for_bit(make):
    faulty = make()
    plant = make().true
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


@pytest.mark.parametrize('joint', [1, 7])
@pytest.mark.parametrize('make', [ideal, mujoco])
def test_the_encoder_of_a_frozen_joint_stands_still_and_the_joint_moves_on(make, joint):
    plant = make()
    healthy = make()
    before = measured(plant, 100)[-1]
    measured(healthy, 100)
    plant.faults = Faults(frozen_joint=joint)
    others = np.arange(7) != joint - 1
    for k in range(101, 300):
        plant.step(reference(k))
        healthy.step(reference(k))
        assert plant.q[joint - 1] == before[joint - 1]
        assert plant.dq[joint - 1] == 0.0
        assert (plant.q[others] == healthy.q[others]).all()
    plant.faults = Faults()
    plant.step(reference(300))
    healthy.step(reference(300))
    assert (plant.q == healthy.q).all()


def test_velocities_of_encoders_at_fault_are_differences_of_their_positions():
    plant = mujoco(encoder_noise=1e-5, encoder_step=1e-4)
    for k in range(100):
        before = plant.q
        plant.step(reference(k))
        assert plant.dq == pytest.approx((plant.q - before) / T, abs=1e-12)


@pytest.mark.parametrize(
    ('wrong', 'words'),
    [
        (Faults(frozen_joint=8, encoder_noise=0.1), r'frozen_joint is 8; allowed: 0 to 7'),
        (Faults(push_link='link_9'), 'link_9'),
    ],
)
def test_a_joint_or_link_that_the_arm_does_not_have_is_refused(wrong, words):
    plant = mujoco()
    with pytest.raises(RedresError, match=words):
        plant.check(wrong)


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


def test_a_force_sensor_has_noise_a_bias_and_a_range_and_may_fail():
    plant = mujoco(push_force=(12.0, 0.0, 0.0))
    plant.step(Q0)
    true = plant.wrench
    assert np.linalg.norm(true[:3]) == pytest.approx(12.0)

    def shown(fault: str) -> np.ndarray | None:
        plant.faults = Faults(wrench_fault=fault)
        return plant.wrench

    assert shown('bias') == pytest.approx(true + 5.0 * np.eye(6)[2], abs=1e-12)
    assert (shown('saturated') == np.clip(true, -10.0, 10.0)).all()
    assert np.abs(true).max() > 10.0
    assert np.isnan(shown('not_finite')).all()
    assert shown('lost') is None
    errors = np.array([shown('noise') - true for _ in range(1000)])
    # four standard errors of the mean and of the deviation of 1000
    assert errors.mean(axis=0) == pytest.approx(np.zeros(6), abs=0.13)
    assert errors.std(axis=0) == pytest.approx(np.repeat((1.0, 0.1), 3), rel=0.09)


@pytest.mark.parametrize('make', [ideal, mujoco])
def test_paused_physics_leave_the_arm_where_it_is_and_then_let_it_go_on(make):
    plant = make()
    stands = measured(plant, 100)[-1]
    plant.faults = Faults(paused_physics=True)
    for k in range(101, 200):
        plant.step(reference(k))
        assert (plant.q == stands).all()
        assert not plant.dq.any()
    plant.faults = Faults()
    for _ in range(500):
        plant.step(reference(200))
    assert plant.q == pytest.approx(reference(200), abs=1e-6)


# --- the robot under faults -----------------------------------------------------------------------


class Loop:
    """A robot and a client that mirrors the position until it commands, and then asks for a gentle
    swing from there.
    """

    def __init__(
        self, faults: Faults | None = None, profile: str = 'lwr_fri1', seed: int = 0
    ) -> None:
        plant = FaultyPlant(IdealPlant(LIMITS.joint_names, T, np.zeros(7)))
        settings = SessionSettings(profile=profile, monitor_time=0.1)
        self.robot = FakeRobot(plant, LIMITS, settings)
        self.session = self.robot.session
        self.connection = Connection(self.robot, seed=seed)
        self.states: NetworkModel[int] = NetworkModel(f'{seed} states')
        self.start = np.zeros(7)
        self.start_tick = 0  # where and at which tick the swing begins
        self.references = [self.robot.reference]
        self.stopped_at = 0
        self.inject(faults or Faults())

    def inject(self, faults: Faults) -> None:
        self.states.link = faults.states
        self.connection.receiver.network.link = faults.commands

    def run(self, cycles: int) -> 'Loop':
        for _ in range(cycles):
            tick = self.robot.tick
            commanded = self.session.commanding
            self.connection.advance()
            self.references.append(self.robot.reference)
            if commanded and not self.session.commanding:
                self.stopped_at = tick
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
    assert loop.session.timing.counts.bridged > 50
    assert (np.abs(np.diff(loop.references, 2, axis=0)) <= LIMITS.acceleration * T * T).all()


TOO_LATE = 'newest command is 6 cycles late, 5 are bridged'
FAULTS = {
    'lost commands': ({'command_loss': 1.0}, TOO_LATE, 'response_rate'),
    'lost states': ({'state_loss': 1.0}, TOO_LATE, 'response_rate'),
    'late commands': ({'command_delay': 8}, TOO_LATE, 'miss_rate'),
    'many lost states': ({'state_loss': 0.6}, 'the', 'response_rate'),
}


@pytest.mark.parametrize('profile', ['lwr_fri1', 'sunrise'])
@pytest.mark.parametrize(('fault', 'reason', 'at_fault'), FAULTS.values(), ids=list(FAULTS))
def test_a_fault_that_sets_in_stops_the_arm_gently_and_reports_why_and_reset_recovers(
    fault, reason, at_fault, profile
):
    loop = Loop(profile=profile).run(400)
    assert loop.session.commanding
    loop.inject(Faults(**fault))
    loop.run(400)
    assert loop.session.reason.startswith('timing: ')
    assert reason in loop.session.reason
    assert loop.session.timing.at_fault == at_fault
    stop = np.array(loop.references[loop.stopped_at - 1 :])
    assert (np.abs(np.diff(stop, 2, axis=0)) <= LIMITS.acceleration * T * T + 1e-12).all()
    assert (stop[-1] == stop[-2]).all()
    loop.inject(Faults())
    loop.session.reset()
    assert loop.run(400).session.commanding


def test_reordered_commands_are_refused_as_such_and_counted():
    loop = Loop(Faults(disorder=0.02)).run(5000)
    assert loop.session.refusals[Refusal.OUT_OF_ORDER] > 0
    assert loop.session.timing.counts.refused == loop.session.refusals[Refusal.OUT_OF_ORDER]


def test_doubled_states_and_commands_do_no_harm():
    doubled = Loop()
    doubled.states.link = Link(duplication=0.5)
    doubled.connection.receiver.network.link = Link(duplication=0.5)
    assert np.array_equal(doubled.run(2000).references, Loop().run(2000).references)
