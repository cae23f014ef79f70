"""Faults: what a channel does to messages, what encoders show, what a push and a pause do; and the
robot under them.
"""

from dataclasses import fields, replace
from itertools import groupby, pairwise

import numpy as np
import pytest
from fake_robot_helpers import Door
from hypothesis import given
from hypothesis import strategies as st

from redres_ros.errors import RangeError, UnknownNameError
from redres_ros.fake_robot.command_validator import CommandValidator
from redres_ros.fake_robot.faults import Faults
from redres_ros.fake_robot.faulty_plant import FaultyPlant
from redres_ros.fake_robot.network_model import Link, NetworkModel
from redres_ros.fake_robot.plant import IdealPlant, MujocoPlant
from redres_ros.fake_robot.robot import FakeRobot
from redres_ros.fake_robot.session import Refusal, Session, SessionSettings
from redres_ros.parameter import parameters
from redres_ros.robots import find_arm
from redres_ros.robots.joint_limits import JointLimits

T = 0.002  # [s]
ARM = find_arm('lwr4')
LIMITS = JointLimits.of(ARM)
Q0 = np.radians((28.08, 104.12, 114.59, 94.85, 14.32, -28.12, 0.0))
MANY = 20000  # messages


# --- channels -------------------------------------------------------------------------------------


def transmit(channel: NetworkModel[int], messages: int, rest: int = 100) -> list[tuple[int, int]]:
    """Message k is sent at tick k; what arrives is (tick, message), in that order."""
    arrived = []
    for tick in range(messages + rest):
        if tick < messages:
            channel.send(tick, tick)
        arrived += [(tick, message) for message in channel.receive(tick)]
    return arrived


def runs(values: list[bool]) -> list[int]:
    """Lengths of the runs of True."""
    return [len(list(group)) for value, group in groupby(values) if value]


LINKS = st.builds(
    Link,
    delay=st.integers(0, 5),
    delay_spread=st.integers(0, 5),
    loss=st.floats(0.0, 1.0),
    loss_burst=st.integers(1, 9),
    duplication=st.floats(0.0, 1.0),
    reordering=st.floats(0.0, 1.0),
)


def test_without_faults_every_message_arrives_at_once():
    assert transmit(NetworkModel(), 1000) == [(k, k) for k in range(1000)]


def test_a_delay_is_that_of_every_message():
    assert transmit(NetworkModel(link=Link(delay=7)), 1000) == [(k + 7, k) for k in range(1000)]


def test_a_random_delay_takes_every_value_of_its_spread_and_keeps_the_order():
    channel = NetworkModel(1, Link(delay=2, delay_spread=3))
    arrived = []
    for k in range(1000):  # one at a time, so that none has to wait for another
        channel.send(k, 10 * k)
        arrived += [
            tick - 10 * k for tick in range(10 * k, 10 * k + 10) for _ in channel.receive(tick)
        ]
    # With shares of a quarter, the number of each has a deviation of 14.
    assert [np.isclose(arrived.count(delay), 250, atol=70) for delay in (2, 3, 4, 5)] == [True] * 4
    assert len(arrived) == 1000
    close = transmit(NetworkModel(1, Link(delay=2, delay_spread=3)), 1000)
    assert [message for _, message in close] == list(range(1000))


@pytest.mark.parametrize('loss', [0.02, 0.3, 0.9])
@pytest.mark.parametrize('burst', [1, 4, 20])
def test_losses_have_the_share_and_the_length_that_were_asked_for(loss, burst):
    arrived = {
        message for _, message in transmit(NetworkModel(2, Link(loss=loss, loss_burst=burst)), MANY)
    }
    lost = [k not in arrived for k in range(MANY)]
    # Bursts are independent: their number deviates by less than its square root.
    expected = loss * MANY / burst
    assert sum(lost) / burst == pytest.approx(expected, abs=4.0 * np.sqrt(expected))
    assert {length % burst for length in runs(lost)[:-1]} == {
        0
    }  # of whole bursts; the last one may be cut off
    assert burst in runs(lost) or loss > 0.5


def test_a_total_loss_lets_nothing_through_and_ends_when_it_is_taken_away():
    channel = NetworkModel(3, Link(loss=1.0, loss_burst=10000))
    assert transmit(channel, 500) == []
    channel.link = Link()
    assert transmit(channel, 500) != []
    channel.send(-1, 1000)
    assert channel.receive(1000) == [-1]


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
    assert sorted(order) in (
        list(range(MANY)),
        list(range(MANY - 1)),
    )  # the last one may wait for another for ever
    # A message that overtakes is not overtaken itself: a share p of those that follow one another
    # in peace.
    assert len(overtaken) == pytest.approx(MANY * 0.2 / 1.2, abs=4.0 * np.sqrt(MANY * 0.2))


@given(LINKS, st.integers(0, 2**32))
def test_the_same_seed_does_the_same_and_nothing_arrives_that_was_not_sent_or_too_early_or_too_late(
    link, seed
):
    arrived = transmit(NetworkModel(seed, link), 100)
    assert arrived == transmit(NetworkModel(seed, link), 100)
    for tick, message in arrived:
        # One in front of it was due no later than at the longest delay; an overtaken one waits for
        # the next.
        assert tick - message >= link.delay
        assert tick - message <= link.delay + link.delay_spread or link.reordering
    counts = [sum(message == k for _, message in arrived) for k in range(100)]
    assert max(counts) <= (2 if link.duplication else 1)
    assert min(counts) == 1 or link.loss or link.reordering


@given(LINKS, LINKS, st.integers(0, 99))
def test_setting_one_fault_does_not_change_when_messages_are_lost(link, other, seed):
    lossy = replace(other, loss=link.loss, loss_burst=link.loss_burst, reordering=0.0)
    arrived = [
        {message for _, message in transmit(NetworkModel(seed, each), 100)}
        for each in (lossy, Link(loss=link.loss, loss_burst=link.loss_burst))
    ]
    assert arrived[0] == arrived[1]


def test_faults_of_a_link_can_change_at_any_tick():
    channel = NetworkModel(6)
    arrived = []
    for tick in range(40):
        channel.link = (
            Link(delay=5) if 10 <= tick < 20 else Link(loss=1.0) if tick >= 30 else Link()
        )
        channel.send(tick, tick)
        arrived += [(tick, message) for message in channel.receive(tick)]
    delayed = [(k + 5, k) for k in range(10, 20)]
    waiting = [
        (24, k) for k in range(20, 24)
    ]  # what comes behind the delayed ones cannot overtake them
    assert arrived == [(k, k) for k in range(10)] + delayed + waiting + [
        (k, k) for k in range(24, 30)
    ]


# --- parameters -----------------------------------------------------------------------------------


def test_every_fault_is_a_live_parameter_with_unit_or_share_and_range():
    declared = parameters(Faults)
    assert {field.name for field in declared} == {field.name for field in fields(Faults)}
    for field, parameter in declared.items():
        assert parameter.live
        if field.type not in (bool, str):
            assert parameter.lower <= field.default <= parameter.upper


@pytest.mark.parametrize('way', ['state', 'command'])
def test_states_and_commands_have_links_of_their_own(way):
    values = {
        'delay': 1,
        'delay_spread': 2,
        'loss': 0.3,
        'loss_burst': 4,
        'duplication': 0.5,
        'reordering': 0.6,
    }
    faults = Faults(**{f'{way}_{name}': value for name, value in values.items()})
    links = {'state': faults.states, 'command': faults.commands}
    assert links.pop(way) == Link(**values)
    assert set(links.values()) == {Link()}


@pytest.mark.parametrize(
    'wrong',
    [
        {'state_loss': 1.1},
        {'command_delay': -1},
        {'encoder_noise': np.nan},
        {'push_force_z': 501.0},
        {'state_loss_burst': 0},
    ],
)
def test_faults_out_of_range_are_refused(wrong):
    with pytest.raises(RangeError, match=next(iter(wrong))):
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
    for faulty, plant in (
        (ideal(), IdealPlant(LIMITS.joint_names, T, Q0)),
        (mujoco(), MujocoPlant(ARM, T, Q0)),
    ):
        for k in range(200):
            assert (faulty.q == plant.q).all()
            assert (faulty.dq == plant.dq).all()
            faulty.step(reference(k))
            plant.step(reference(k))


def test_encoders_round_to_their_step():
    plant = ideal(encoder_step=1e-3)
    step = 1e-3
    q = measured(plant, 500)
    assert np.abs(q / step - np.round(q / step)).max() < 1e-9
    errors = np.abs(q - [reference(k) for k in range(1, 501)])
    assert 0.4 * step < errors.max() <= 0.5 * step + 1e-12


def test_noise_has_its_deviation_and_is_not_that_of_the_arm():
    plant = ideal(encoder_noise=1e-4)
    errors = measured(plant, 2000) - [reference(k) for k in range(1, 2001)]
    # The deviation of 14000 samples is known to 0.6 %, their mean to 8e-7.
    assert errors.std() == pytest.approx(1e-4, rel=0.03)
    assert abs(errors.mean()) < 4e-6
    plant.faults = Faults()
    plant.step(reference(2001))
    assert (plant.q == reference(2001)).all()


def test_noise_is_drawn_once_a_cycle_and_the_same_for_the_same_seed():
    plant = ideal(encoder_noise=1e-4)
    other = ideal(encoder_noise=1e-4)
    plant.step(Q0)
    assert (plant.q == plant.q).all()
    other.step(Q0)
    assert (plant.q == other.q).all()
    plant.step(Q0)
    assert (plant.q != other.q).all()


@pytest.mark.parametrize('joint', [1, 4, 7])
@pytest.mark.parametrize('make', [ideal, mujoco])
def test_the_encoder_of_a_frozen_joint_stands_still_and_the_joint_moves_on(make, joint):
    plant = make()
    healthy = make()
    before = measured(plant, 100)[-1]
    _ = measured(healthy, 100)
    plant.faults = Faults(frozen_joint=joint)
    for k in range(101, 300):
        plant.step(reference(k))
        healthy.step(reference(k))
        others = np.arange(7) != joint - 1
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


def test_a_frozen_joint_that_the_arm_does_not_have_is_refused_and_changes_nothing():
    plant = ideal()
    with pytest.raises(RangeError, match=r'frozen_joint is 8; allowed: 0 to 7'):
        plant.faults = Faults(frozen_joint=8, encoder_noise=0.1)
    assert plant.faults == Faults()


def test_a_push_moves_the_arm_against_its_servos_until_it_ends():
    plant = mujoco(push_force_x=20.0, push_force_z=-20.0)
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


def test_a_push_on_a_link_leaves_the_force_sensor_of_the_tip_alone():
    plant = mujoco(push_force_x=20.0, push_link='link_4')
    plant.step(Q0)
    assert not plant.wrench.any()
    assert np.abs(plant.external_torques).max() > 1.0


def test_a_push_on_a_link_that_the_arm_does_not_have_is_refused():
    with pytest.raises(UnknownNameError, match='link_9'):
        mujoco(push_link='link_9')


def test_a_force_sensor_has_noise_bias_and_a_range_and_may_fail():
    faults = Faults(wrench_noise=1.0, wrench_bias=5.0, wrench_range=30.0)
    true = np.array([10.0, 0.0, 20.0, 0.0, 0.0, 0.0])
    random = np.random.default_rng(0)
    shown = np.array([faults.measured(true, random) for _ in range(1000)])
    # four standard errors of the mean of 1000
    assert shown[:, :3].mean(axis=0) == pytest.approx((10.0, 0.0, 25.0), abs=0.13)
    assert faults.measured(3.0 * true, random)[2] == 30.0
    assert np.isnan(Faults(wrench_not_finite=True).measured(true, random)).all()
    assert (Faults().measured(true, random) == true).all()


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
        settings = SessionSettings(profile=profile, monitor_time=0.1)
        self.session = Session(T, settings)
        plant = FaultyPlant(IdealPlant(LIMITS.joint_names, T, np.zeros(7)))
        self.robot = FakeRobot(plant, CommandValidator(LIMITS, T), self.session)
        self.door = Door(self.robot, seed=seed)
        self.states: NetworkModel[int] = NetworkModel(f'{seed} states')
        self.start = np.zeros(7)
        self.start_stamp = 0  # where and at which tick the swing begins
        self.references = [self.robot.reference]
        self.stopped_at = 0
        self.inject(faults or Faults())

    def inject(self, faults: Faults) -> None:
        self.states.link = faults.states
        self.door.receiver.network.link = faults.commands

    def run(self, cycles: int) -> 'Loop':
        for _ in range(cycles):
            tick = self.robot.tick
            commanded = self.session.commanding
            self.door.advance()
            self.references.append(self.robot.reference)
            self.stopped_at = tick if commanded and not self.session.commanding else self.stopped_at
            self.states.send(tick, tick)
            for state in self.states.receive(tick):
                self.door.send(state, self._command(state))
        return self

    def _command(self, tick: int) -> np.ndarray:
        if not self.session.commanding:
            self.start = self.robot.reference
            self.start_stamp = tick
        return self.start + reference(max(tick - self.start_stamp, 0)) - Q0


@pytest.mark.parametrize('profile', ['lwr_fri1', 'sunrise'])
def test_a_few_lost_states_and_commands_are_bridged(profile):
    loop = Loop(Faults(state_loss=0.015, command_loss=0.015), profile).run(5000)
    assert (loop.session.commanding, loop.session.reason) == (True, '')
    assert loop.session.counts.bridged > 50
    assert (np.abs(np.diff(loop.references, 2, axis=0)) <= LIMITS.acceleration * T * T).all()


FAULTS = {
    'lost commands': (
        {'command_loss': 1.0},
        'newest command is 6 cycles late, 5 are bridged',
        'response_rate',
    ),
    'lost states': (
        {'state_loss': 1.0},
        'newest command is 6 cycles late, 5 are bridged',
        'response_rate',
    ),
    'late commands': (
        {'command_delay': 8},
        'newest command is 6 cycles late, 5 are bridged',
        'miss_rate',
    ),
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
    loop.robot.reset()
    assert loop.run(400).session.commanding


def test_reordered_commands_are_refused_as_such_and_counted():
    loop = Loop(Faults(command_reordering=0.02)).run(5000)
    assert loop.session.refusals[Refusal.OUT_OF_ORDER] > 0
    assert loop.session.counts.refused == loop.session.refusals[Refusal.OUT_OF_ORDER]


def test_doubled_states_and_commands_do_no_harm():
    assert np.array_equal(
        Loop(Faults(state_duplication=0.5, command_duplication=0.5)).run(2000).references,
        Loop().run(2000).references,
    )


@pytest.mark.parametrize(
    'fault', [{'state_loss': 0.3}, {'command_delay_spread': 4}, {'command_reordering': 0.3}]
)
def test_the_same_seed_makes_the_same_motion_and_another_one_another(fault):
    books = [Loop(Faults(**fault), seed=seed).run(1000).session.counts for seed in (1, 1, 2)]
    assert books[0] == books[1]
    assert books[0] != books[2]
