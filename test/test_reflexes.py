"""The profile `fci`: each of libfranka's reflexes on joint motions, and how to recover from them.

A Franka arm at 1000 Hz, whose client commands a motion that each test continues in its own way.
"""

from collections.abc import Callable
from dataclasses import replace
from itertools import groupby, product
from typing import Any

import numpy as np
import pytest
from fake_robot_helpers import Connection
from nightly import by_day

from redres_ros import Controller, RobotModel, load_task
from redres_ros.command import ROBOT_INTERFACES
from redres_ros.fake_robot.plant import IdealPlant
from redres_ros.fake_robot.profile import Reflex
from redres_ros.fake_robot.robot import FakeRobot
from redres_ros.fake_robot.session import SessionSettings
from redres_ros.robots import find_arm
from redres_ros.robots.joint_limits import JointLimits
from redres_ros.simulation import closed_loop

T = 0.001  # [s]
LIMITS = JointLimits.of(find_arm('fr3'))
START = np.array(find_arm('fr3').start)
FIRST = np.eye(7)[0]  # the first joint alone
ROUNDING = 1e-12  # [rad]


class Client:
    """Responds to every state in time, with the position that it adds to at every tick."""

    def __init__(self, q: np.ndarray = START) -> None:
        settings = SessionSettings(profile='fci', monitor_time=0.05)
        robot = FakeRobot(IdealPlant(LIMITS.joint_names, T, q), LIMITS, settings)
        self.connection = Connection(robot)
        self.session = robot.session
        self.q = q
        self.states = [self.session.state]
        self.advance()

    def advance(self) -> None:
        self.connection.advance()
        self.states.append(self.session.state)

    def command(self, q: np.ndarray) -> None:
        """Respond to the state of this tick, and let the robot have it."""
        self.q = q
        self.connection.send(self.connection.robot.tick - 1, q)
        self.advance()

    def hold(self, cycles: int) -> None:
        """Respond from the spot."""
        for _ in range(cycles):
            self.command(self.q)

    def accelerate(self, acceleration: float, cycles: int, velocity: float = 0.0) -> float:
        """Move the first joint at a constant acceleration [rad/s^2]; its velocity then [rad/s]."""
        for _ in range(cycles):
            velocity += acceleration * T
            self.command(self.q + velocity * T * FIRST)
        return velocity


def commanding(q: np.ndarray = START) -> Client:
    client = Client(q)
    client.hold(60)
    assert client.session.state == 'MOVE'
    return client


def lose_commands(client: Client) -> None:
    for _ in range(20):
        client.advance()


def begin_elsewhere(client: Client) -> None:
    client.session.reset()
    client.q = START + 0.02 * FIRST
    client.hold(60)


NEAR_THE_END = START * (1.0 - FIRST) + (LIMITS.upper - 1e-6) * FIRST
REFLEXES: dict[Reflex, tuple[Callable[[Client], Any], str]] = {
    Reflex.TIMING: (lose_commands, 'communication_constraints_violation'),
    Reflex.START_POSE: (begin_elsewhere, 'joint_position_motion_generator_start_pose_invalid'),
    Reflex.POSITION: (
        lambda client: client.command(client.q + 2e-6 * FIRST),
        'joint_motion_generator_position_limits_violation',
    ),
    Reflex.BRAKING: (
        lambda client: client.accelerate(0.0, 3000, client.accelerate(4.0, 250)),  # at 1 rad/s
        'joint_motion_generator_velocity_limits_violation',
    ),
    Reflex.VELOCITY: (
        lambda client: client.accelerate(4.0, 660),  # to 2.64 rad/s; allowed are 2.62
        'joint_motion_generator_velocity_limits_violation',
    ),
    Reflex.ACCELERATION: (
        lambda client: client.accelerate(10.1, 1),  # allowed are 10
        'joint_motion_generator_velocity_discontinuity',
    ),
    Reflex.JERK: (
        lambda client: client.accelerate(5.1, 1),  # allowed are 5 a cycle
        'joint_motion_generator_acceleration_discontinuity',
    ),
}


@pytest.mark.parametrize('reflex', Reflex)
def test_a_violation_is_a_reflex_by_libfrankas_name_and_after_recovery_the_arm_moves_again(reflex):
    client = commanding(NEAR_THE_END if reflex is Reflex.POSITION else START)
    provoke, name = REFLEXES[reflex]
    provoke(client)
    assert client.session.reason.startswith(f'{name}: ')
    for _ in range(1000):  # in which the arm comes to rest
        client.advance()
    client.hold(100)
    assert client.session.state == 'REFLEX'  # until somebody asks for it
    client.session.reset()
    client.states.append(client.session.state)
    client.q = client.connection.robot.plant.q
    client.hold(200)
    passed = [state for state, _ in groupby(client.states)]
    assert passed[-4:] == ['REFLEX', 'AUTOMATIC_ERROR_RECOVERY', 'IDLE', 'MOVE']
    assert client.session.reason == ''


def test_a_motion_within_all_limits_is_no_reason_to_stop():
    client = commanding()
    velocity = client.accelerate(4.9, 500)  # 4900 rad/s^3 at its beginning and its end
    client.accelerate(0.0, 100, velocity)
    assert velocity == pytest.approx(2.45)
    assert (client.session.state, client.session.reason) == ('MOVE', '')


def test_lost_packets_are_bridged_at_the_last_acceleration():
    client = commanding()
    client.accelerate(2.0, 100)
    velocity = 0.2
    expected = [client.q]
    for _ in range(10):
        velocity += 2.0 * T
        expected.append(expected[-1] + velocity * T * FIRST)
    for k in range(1, 6):  # lost
        client.advance()
        assert client.connection.robot.reference == pytest.approx(expected[k], abs=ROUNDING)
    client.command(expected[6])
    assert client.session.state == 'MOVE'
    assert client.session.reason == ''


@pytest.mark.slow
@pytest.mark.parametrize(
    ('law', 'lost'),
    by_day(1, product(['minimum_velocity', 'minimum_weighted_torque'], [0.0, 0.02])),
)
def test_a_task_at_the_full_limits_keeps_clear_of_every_reflex(law, lost):
    controller = Controller(
        RobotModel.named('fr3'),
        law,
        T,
        switch_time=0.3,
        limits=('position', 'velocity', 'acceleration', 'jerk', 'end_speed'),
        limit_gains={'acceleration.reach': 0.02},
        robot_interface=replace(ROBOT_INTERFACES['fci'], lost=3 if lost else 0),
    )
    recording = closed_loop.run(controller, load_task(find_arm('fr3').task), greedy=False)
    assert recording.finished
    client = commanding()
    random = np.random.default_rng(0)
    for q in recording.vectors('q1'):
        if random.random() < lost:
            client.advance()
        else:
            client.command(q)
    assert (client.session.state, client.session.reason) == ('MOVE', '')
