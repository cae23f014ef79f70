"""Admittance, force sensor and reactions, without ROS; pressing on a simulated table."""

from dataclasses import replace
from typing import Any

import numpy as np
import pinocchio as pin
import pytest
from contact_scenes import APPROACH, RAMP, SLIDE, Pressing, pressed

from redres_ros import Controller, RobotModel, make_law
from redres_ros.contact import AdmittanceSettings, ContactControl, ContactError, _ForceSensor
from redres_ros.errors import ArrayError, RangeError

T = 0.002  # [s]
MODEL = RobotModel.named('fr3')
Q0 = np.array(MODEL.arm.start)
STATE = MODEL.state(Q0, np.zeros(MODEL.n))
NONE = np.zeros(6)


def settings(**given: Any) -> AdmittanceSettings:
    return AdmittanceSettings(enabled=True, **given)


class IdealLoop:
    """Controller, contact, and an arm that is at its reference a cycle later."""

    def __init__(self, contact: ContactControl, task: str = 'position') -> None:
        law = make_law('minimum_acceleration', damping=10.0)
        self.controller = Controller(MODEL, law, T, task=task)
        self.contact = contact
        self.q = Q0

    def tick(self, wrench: np.ndarray | None) -> np.ndarray:
        """The tip's position after a tick with a wrench at the tip in the base's axes (6,)."""
        state = MODEL.state(self.q, np.zeros(MODEL.n))
        if wrench is not None:
            self.contact.sensor.enter(np.kron(np.eye(2), state.R.T) @ wrench)
        dx = np.zeros(self.controller.m)
        command = self.controller.update(self.q, self.contact.velocity(dx, state))
        self.contact.record(command, dx)
        self.q = command.q_ref
        return MODEL.tip(self.q)[0]

    def until_it_ends(self, wrench: np.ndarray | None, ticks: int) -> tuple[np.ndarray, str]:
        """Positions of the tip (N, 3) [m], and why the motion has ended within some ticks."""
        positions = [MODEL.tip(self.q)[0]]
        for _ in range(ticks):
            try:
                positions.append(self.tick(wrench))
            except ContactError as error:
                return np.array(positions), str(error)
        pytest.fail('it goes on')


def wrench_along(axis: int, size: float) -> np.ndarray:
    wrench = np.zeros(6)
    wrench[axis] = size
    return wrench


def test_the_rate_is_the_implicit_euler_step_of_mass_damper_and_spring() -> None:
    given = settings(mass=(1.0, 0.0, 2.0), damping=(50.0, 80.0, 9.0), stiffness=(300.0, 0.0, 7.0))
    given = replace(given, force=(0.0, 0.1, -0.1))
    loop = IdealLoop(ContactControl(given, T))
    e = np.zeros(3)
    de = np.zeros(3)
    M = np.array(given.mass)
    D = np.array(given.damping)
    K = np.array(given.stiffness)
    x0 = MODEL.tip(Q0)[0]
    for wrench in np.random.default_rng(0).normal(scale=0.5, size=(50, 6)):
        x = loop.tick(wrench)
        de = (M / T * de + wrench[:3] - np.array(given.force) - K * e) / (M / T + D + K * T)
        e = e + T * de
    assert loop.contact.e == pytest.approx(e, abs=1e-12)
    # the arm itself: a tick moves the tip by T J dq, to second order in the step
    assert x - x0 == pytest.approx(e, abs=1e-5)


@pytest.mark.parametrize('task', ['position', 'pose'])
def test_directions_are_those_of_the_chosen_frame(task: str) -> None:
    given = AdmittanceSettings.of_rows({'position': 3, 'pose': 6}[task])
    free = (1e6, 1e6, 100.0, *(1e6 for _ in given.mass[3:]))
    given = replace(given, enabled=True, frame='tip', damping=free)
    loop = IdealLoop(ContactControl(given, T), task)
    x0, R0 = MODEL.tip(Q0)
    for _ in range(100):
        x = loop.tick(np.array((3.0, 4.0, 5.0, 0.0, 0.0, 0.0)))
    along = R0.T @ (x - x0)
    assert abs(along[2]) > 1e-3
    assert np.abs(along[:2]).max() < 0.01 * abs(along[2])


def test_a_spring_turns_back_after_turns_about_two_axes() -> None:
    given = replace(AdmittanceSettings.of_rows(6), enabled=True, stiffness=(500.0,) * 6)
    loop = IdealLoop(ContactControl(given, T), 'pose')
    _, R0 = MODEL.tip(Q0)
    for moment in ((400.0, 0.0, 0.0), (400.0, 400.0, 0.0), (0.0, 400.0, 0.0)):
        for _ in range(150):
            loop.tick(np.array((0.0, 0.0, 0.0, *moment)))
    assert np.linalg.norm(pin.log3(MODEL.tip(loop.q)[1] @ R0.T)) > 0.7  # [rad]
    for _ in range(1000):
        loop.tick(NONE)
    assert np.linalg.norm(pin.log3(MODEL.tip(loop.q)[1] @ R0.T)) < 0.005


def test_on_off_and_any_change_are_no_jump() -> None:
    contact = ContactControl(AdmittanceSettings(), T, switch_time=0.2)
    loop = IdealLoop(contact)
    on = settings(damping=(100.0,) * 3)
    changes = {
        10: on,
        200: replace(on, force=(0.0, 0.0, 20.0)),
        400: replace(on, frame='tip', damping=(50.0,) * 3),
        600: replace(on, enabled=False),
    }
    velocities = []
    x = MODEL.tip(Q0)[0]
    for k in range(800):
        if k in changes:
            contact.set_settings(changes[k])
        before = x
        x = loop.tick(np.array((0.0, 5.0, 10.0, 0.0, 0.0, 0.0)))
        velocities.append((x - before) / T)
    speeds = np.linalg.norm(velocities, axis=1)
    steps = np.linalg.norm(np.diff(velocities, axis=0), axis=1)
    # the steepest tick of a quintic over 100 ticks is 1.9 % of the whole change, at most twice 0.2
    assert speeds.max() > 0.1
    assert steps.max() < 0.01
    assert speeds[-1] < 1e-9
    assert not contact.e.any()


def test_a_wrench_of_any_link_becomes_that_of_the_tip() -> None:
    """The power of a wrench is the same in both: f'v + m'w with the velocities of either point."""
    sensor = _ForceSensor(0.05, T)
    wrench = np.array((1.0, -2.0, 3.0, 0.4, 0.5, -0.6))
    sensor.enter(wrench, 'fr3_link6')
    _, R = MODEL.pose(Q0, 'fr3_link6')
    for dq in np.eye(MODEL.n)[:-1]:  # without the last joint both are on one body
        power = wrench @ np.kron(np.eye(2), R.T) @ MODEL.jacobian(Q0, 'fr3_link6') @ dq
        assert sensor.at_tip(STATE) @ STATE.J @ dq == pytest.approx(power, abs=1e-12)


def test_a_tare_takes_off_what_is_measured_in_its_frame_beside_noise_and_a_glitch() -> None:
    sensor = _ForceSensor(0.05, T)
    bias = np.array((1.0, 2.0, 3.0, 0.1, 0.2, 0.3))
    sensor.enter(bias + 1e4)
    for k in range(21):
        sensor.enter(bias + 0.1 * (k % 3 - 1.0))
    sensor.tare()
    sensor.enter(bias)
    assert sensor.at_tip(STATE) == pytest.approx(np.zeros(6), abs=1e-12)
    sensor.enter(bias, 'fr3_link5')
    assert 'tare it again' in sensor.problem


def test_only_what_can_be_used_outlives_the_wait_for_a_first_wrench() -> None:
    contact = ContactControl(AdmittanceSettings(), T)
    sensor = contact.sensor
    sensor.enter(np.ones(6))
    sensor.expect()
    assert sensor.at_tip(STATE) is not None
    sensor.advance(round(0.06 / T))
    assert sensor.problem
    contact.set_settings(settings())
    assert not sensor.problem
    assert sensor.at_tip(STATE) is None


def test_a_sensor_without_usable_wrenches_is_not_tared() -> None:
    sensor = _ForceSensor(0.05, T)
    sensor.advance(26)
    with pytest.raises(ContactError, match='no wrench'):
        sensor.tare()
    sensor.enter(np.full(6, np.inf))
    for _ in range(8):
        sensor.enter(NONE)
    with pytest.raises(ContactError, match='9 wrenches have come; expected 10'):
        sensor.tare()
    sensor.enter(NONE)
    with pytest.raises(ContactError, match='not finite'):
        sensor.tare()


@pytest.mark.parametrize(
    ('wrench', 'ticks'),
    [(None, 24), (np.full(6, np.nan), 0), (wrench_along(3, 1e10), 0)],  # within 0.05 s, or at once
)
def test_a_wrench_that_cannot_be_used_ends_the_motion(wrench: Any, ticks: int) -> None:
    loop = IdealLoop(ContactControl(settings(), T))
    loop.tick(wrench_along(0, 1.0))
    positions, _ = loop.until_it_ends(wrench, 30)
    assert len(positions) - 1 == pytest.approx(ticks, abs=1)


def test_above_the_force_limit_the_tip_retreats_along_the_force_and_then_ends() -> None:
    loop = IdealLoop(ContactControl(settings(force_limit=50.0), T))
    x0 = loop.tick(wrench_along(1, 49.0))
    loop.tick(wrench_along(1, 60.0))
    assert 'a force of 60 N' in loop.contact.warning
    x, reason = loop.until_it_ends(NONE, 1000)
    assert 'the tip has retreated' in reason
    # 10 mm at 20 mm/s: one tick more, and the arm's curvature
    assert x[-1] - x0 == pytest.approx((0.0, 0.01, 0.0), abs=1.5e-4)
    assert np.linalg.norm(np.diff(x, axis=0), axis=1).max() / T == pytest.approx(0.02, rel=1e-3)


def test_a_search_for_contact_is_bounded_in_speed_and_distance() -> None:
    loop = IdealLoop(ContactControl(settings(force=(0.0, 0.0, 25.0)), T))
    x0 = MODEL.tip(Q0)[0]
    x, reason = loop.until_it_ends(NONE, 5000)
    assert 'no contact within 0.05 m while 25 N are asked for' in reason
    speeds = np.linalg.norm(np.diff(x, axis=0), axis=1) / T
    assert speeds.max() == pytest.approx(0.02, rel=1e-3)
    assert x[-1][2] - x0[2] == pytest.approx(-0.05, abs=1e-3)


def test_a_search_is_as_slow_while_it_is_called_off() -> None:
    searching = settings(force=(0.0, 0.0, 20.0), damping=(30.0,) * 3)
    contact = ContactControl(searching, T, switch_time=0.2)
    loop = IdealLoop(contact)
    for _ in range(110):
        loop.tick(NONE)
    contact.set_settings(replace(searching, force=(0.0,) * 3))
    x = [loop.tick(NONE) for _ in range(110)]
    assert np.linalg.norm(np.diff(x, axis=0), axis=1).max() / T == pytest.approx(0.02, rel=1e-3)


@pytest.mark.slow
def test_contact_that_was_found_begins_the_search_distance_anew() -> None:
    loop = IdealLoop(ContactControl(settings(force=(0.0, 0.0, 25.0)), T))
    for _ in range(4):
        for _ in range(1000):  # 40 mm
            loop.tick(NONE)
        loop.tick(wrench_along(2, 25.0))


@pytest.mark.parametrize(
    ('given', 'error'),
    [
        ({'mass': (0.0,) * 6}, ArrayError),  # as many as damping has: 3
        ({'damping': (1.0, 1.0, 0.0)}, RangeError),  # a direction without mass and damping
        ({'damping': (-1.0, 1.0, 1.0)}, RangeError),
        ({'force': (np.nan, 0.0, 0.0)}, RangeError),
    ],
)
def test_settings_that_cannot_be_are_refused_by_name(given: Any, error: type) -> None:
    with pytest.raises(error, match=next(iter(given))):
        settings(**given)


def test_settings_of_another_task_are_refused_and_change_nothing() -> None:
    contact = ContactControl(settings(), T)
    with pytest.raises(ArrayError, match='holds 6 values; expected 3, as many as dx has'):
        contact.set_settings(AdmittanceSettings.of_rows(6))
    assert contact.settings == settings()


SLOW_SERVOS = {'T': 0.002, 'bandwidth': 100.0, 'stiffness': 1e5}
CASES = {  # the case, and the largest error of the force [N] over a distance [m]
    'hard': (Pressing(stiffness=1e5), 0.02, 0.3),
    'softer': (Pressing(stiffness=1e4), 0.02, 0.3),
    'noise': (Pressing(stiffness=1e4, damping=1000.0, noise=1.0), 0.2, 0.3),
    'noise, hard': (Pressing(stiffness=1e5, damping=3000.0, noise=1.0), 0.2, 0.3),
    'slow servos': (Pressing(**SLOW_SERVOS), 0.05, 0.05),
    'iiwa7': (Pressing('iiwa7', **SLOW_SERVOS), 0.05, 0.05),
    'lwr4_paper': (Pressing('lwr4_paper', **SLOW_SERVOS), 0.05, 0.05),
}


@pytest.mark.slow
@pytest.mark.parametrize(
    'name', ['hard', *(pytest.param(name, marks=pytest.mark.nightly) for name in list(CASES)[1:])]
)
def test_20_N_are_kept_while_the_tip_slides(name: str) -> None:
    case, rms, distance = CASES[name]
    run = pressed(case, distance)
    x = run.x
    approach = -(x[run.first - 1] - x[run.first - 11])[2] / (10 * case.T)
    assert approach == pytest.approx(APPROACH, rel=0.02)
    assert run.force.max() <= 25.0
    assert (run.force[run.first :] > 0.0).all()  # no bounce
    assert run.rms <= rms
    # the ramp takes half of its time
    assert x[-1][1] - x[0][1] == pytest.approx(distance + 0.5 * RAMP * SLIDE, abs=2e-3)


@pytest.mark.slow
def test_below_the_bound_of_the_damping_the_tip_bounces() -> None:
    low = Pressing(T=0.002, bandwidth=400.0, stiffness=1e5, damping=300.0, delay=5)
    bouncing = pressed(low, distance=0.01).force
    steady = pressed(replace(low, damping=1500.0), distance=0.01).force
    assert bouncing[len(bouncing) // 2 :].min() == 0.0
    assert np.ptp(steady[len(steady) // 2 :]) < 1.0
