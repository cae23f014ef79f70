"""Admittance, force sensor and reactions, without ROS."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from redres_ros import Controller, RobotModel, make_law
from redres_ros.contact import Admittance, AdmittanceSettings, ContactControl, minimum_damping
from redres_ros.contact.contact_control import ContactError, PayloadError
from redres_ros.contact.force_sensor import ForceSensor, TareError
from redres_ros.errors import ArrayError, RangeError

T = 0.002  # [s]
MODEL = RobotModel.named('fr3')
Q0 = np.array(MODEL.arm.start)
STATE = MODEL.state(Q0, np.zeros(MODEL.n))
LIMITS = ('position', 'velocity', 'acceleration')


def settings(**given: Any) -> AdmittanceSettings:
    return AdmittanceSettings(enabled=True, **given)


class IdealLoop:
    """Controller, contact, and an arm that is at its reference a cycle later.

    Args:
        contact: Has its wrenches from the caller.
        task: Of the controller.
        limits: Of the controller.
    """

    def __init__(
        self, contact: ContactControl, task: str = 'position', limits: tuple[str, ...] = ()
    ) -> None:
        law = make_law('minimum_acceleration', damping=10.0)
        self.controller = Controller(MODEL, law, T, task=task, limits=limits)
        self.contact = contact
        self.q = Q0

    def tick(self, wrench: np.ndarray | None, dx: np.ndarray | None = None) -> np.ndarray:
        """The tip's position after a tick with a wrench at the tip in the base's axes (6,)."""
        state = MODEL.state(self.q, np.zeros(MODEL.n))
        if wrench is not None:
            in_tip = np.concatenate((state.R.T @ wrench[:3], state.R.T @ wrench[3:]))
            self.contact.sensor.enter(in_tip)
        dx = np.zeros(self.controller.m) if dx is None else dx
        command = self.controller.update(self.q, self.contact.velocity(dx, state))
        self.contact.record(command, dx)
        self.q = command.q_ref
        return MODEL.tip(self.q)[0]

    def until_it_ends(self, wrench: np.ndarray | None, ticks: int) -> tuple[np.ndarray, str]:
        """Positions of the tip (N, 3) [m], and why the motion has ended.

        Args:
            wrench: As of tick().
            ticks: After which it should have.
        """
        positions = [MODEL.tip(self.q)[0]]
        for _ in range(ticks):
            try:
                positions.append(self.tick(wrench))
            except ContactError as error:
                return np.array(positions), str(error)
        return np.array(positions), ''


def wrench_along(axis: int, size: float) -> np.ndarray:
    """A wrench in the base's axes with one component, (6,)."""
    wrench = np.zeros(6)
    wrench[axis] = size
    return wrench


# --- the formula ----------------------------------------------------------------------------------


def test_the_rate_is_the_implicit_euler_step_of_mass_damper_and_spring() -> None:
    given = settings(mass=(1.0, 0.0, 2.0), damping=(50.0, 80.0, 9.0), stiffness=(300.0, 0.0, 7.0))
    given = replace(given, force=(0.0, 5.0, -1.0), search_speed=0.5, search_distance=1.0)
    loop = IdealLoop(ContactControl(given, T))
    e = np.zeros(3)
    de = np.zeros(3)
    M = np.array(given.mass)
    D = np.array(given.damping)
    K = np.array(given.stiffness)
    x0 = MODEL.tip(Q0)[0]
    for wrench in np.random.default_rng(0).normal(scale=2.0, size=(50, 6)):
        x = loop.tick(wrench)
        de = (M / T * de + wrench[:3] - np.array(given.force) - K * e) / (M / T + D + K * T)
        e = e + T * de
    assert loop.contact.admittance.e == pytest.approx(e, abs=1e-12)
    # the arm itself: a tick moves the tip by T J dq, to second order in the step
    assert x - x0 == pytest.approx(e, abs=1e-5)


@pytest.mark.parametrize('task', ['position', 'pose'])
def test_directions_are_those_of_the_chosen_frame(task: str) -> None:
    rows = {'position': 3, 'pose': 6}[task]
    free = [1e6] * rows
    free[2] = 100.0
    given = replace(
        AdmittanceSettings.of_rows(rows), enabled=True, frame='tip', damping=tuple(free)
    )
    loop = IdealLoop(ContactControl(given, T), task)
    x0, R0 = MODEL.tip(Q0)
    for _ in range(100):
        x = loop.tick(np.array((3.0, 4.0, 5.0, 0.0, 0.0, 0.0)))
    along = R0.T @ (x - x0)
    assert abs(along[2]) > 1e-3
    assert np.abs(along[:2]).max() < 0.01 * abs(along[2])


def test_an_unpushed_arm_stays_where_it_is() -> None:
    loop = IdealLoop(ContactControl(settings(), T), limits=LIMITS)
    for _ in range(20):
        loop.tick(np.zeros(6))
    assert (loop.q == Q0).all()


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


def test_limits_hold_whatever_pushes() -> None:
    contact = ContactControl(settings(damping=(10.0,) * 3, force_limit=1e4), T)
    loop = IdealLoop(contact, limits=LIMITS)
    dq_before = np.zeros(MODEL.n)
    for push in np.random.default_rng(1).uniform(-300.0, 300.0, size=(300, 6)):
        before = loop.q
        loop.tick(push)
        dq = (loop.q - before) / T
        # 1e-9: rounding of positions divided by T and T^2
        assert (np.abs(dq) <= MODEL.dq_max * (1 + 1e-9)).all()
        assert (np.abs(dq - dq_before) / T <= 10.0 * (1 + 1e-9) + 1e-7).all()
        dq_before = dq


# --- the sensor -----------------------------------------------------------------------------------


def test_a_wrench_of_any_link_becomes_that_of_the_tip() -> None:
    sensor = ForceSensor(AdmittanceSettings(), T)
    wrench = np.array((1.0, -2.0, 3.0, 0.4, 0.5, -0.6))
    x, R = MODEL.pose(Q0, 'fr3_link6')
    sensor.enter(wrench, 'fr3_link6')
    force = R @ wrench[:3]
    moment = R @ wrench[3:] + np.cross(x - STATE.x, force)
    assert sensor.at_tip(STATE) == pytest.approx(np.concatenate((force, moment)), abs=1e-12)
    # the power of a wrench is the same in both: f'v + m'w with the velocities of either point
    dq = np.append(np.random.default_rng(0).normal(size=MODEL.n - 1), 0.0)  # both on one body
    power = wrench @ np.kron(np.eye(2), R.T) @ MODEL.jacobian(Q0, 'fr3_link6') @ dq
    assert sensor.at_tip(STATE) @ STATE.J @ dq == pytest.approx(power, abs=1e-12)


def test_weight_and_bias_are_taken_off_in_every_orientation() -> None:
    mass = 0.7
    center = np.array((0.01, 0.02, 0.05))
    given = AdmittanceSettings(payload_mass=mass, payload_center=tuple(center))
    sensor = ForceSensor(given, T)
    bias = np.array((1.0, 2.0, 3.0, 0.1, 0.2, 0.3))

    def measured(q: np.ndarray) -> np.ndarray:
        R = MODEL.tip(q)[1]
        weight = R.T @ np.array((0.0, 0.0, -9.81 * mass))
        return bias + np.concatenate((weight, np.cross(center, weight)))

    for _ in range(20):
        sensor.enter(measured(Q0))
    sensor.tare(STATE)
    turned = Q0 + np.array((0.0, 0.0, 0.3, 0.0, 0.5, 0.7, 0.9))
    sensor.enter(measured(turned))
    state = MODEL.state(turned, np.zeros(MODEL.n))
    assert sensor.at_tip(state) == pytest.approx(np.zeros(6), abs=1e-12)


def test_a_sensor_without_usable_wrenches_is_not_tared() -> None:
    sensor = ForceSensor(AdmittanceSettings(), T)
    with pytest.raises(TareError, match='no wrench'):
        sensor.tare(STATE)
    sensor.enter(np.zeros(6))
    with pytest.raises(TareError, match='expected 10'):
        sensor.tare(STATE)


def test_the_filter_is_of_first_order() -> None:
    tau = 0.05
    sensor = ForceSensor(AdmittanceSettings(filter_time=tau), T)
    sensor.enter(np.zeros(6))
    sensor.at_tip(STATE)
    sensor.enter(np.ones(6))
    for _ in range(round(tau / T)):
        force = sensor.at_tip(STATE)[:3]
    # 1 - 1/e after tau; the implicit Euler step is 2 % off at T = tau/25
    assert np.linalg.norm(force) / np.sqrt(3.0) == pytest.approx(1.0 - np.exp(-1.0), rel=0.02)


# --- reactions ------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ('wrench', 'words'),
    [
        (None, 'no wrench for 0.05 s (admittance.wrench_timeout)'),
        (np.full(6, np.nan), 'expected finite values'),
        (wrench_along(2, 60.0), 'saturated'),
    ],
)
def test_a_wrench_that_cannot_be_used_ends_the_motion(wrench: Any, words: str) -> None:
    loop = IdealLoop(ContactControl(settings(sensor_range=50.0), T))
    loop.tick(wrench_along(0, 1.0))
    _, reason = loop.until_it_ends(wrench, 30)
    assert words in reason


def test_above_the_force_limit_the_tip_retreats_along_the_force_and_then_ends() -> None:
    given = settings(force_limit=50.0, retreat_distance=0.008, retreat_speed=0.05)
    loop = IdealLoop(ContactControl(given, T))
    x0 = MODEL.tip(Q0)[0]
    loop.tick(wrench_along(1, 60.0))
    assert 'a force of 60 N' in loop.contact.warning
    x, reason = loop.until_it_ends(np.zeros(6), 1000)
    assert 'the tip has retreated' in reason
    # one tick at full speed beyond, and the arm's curvature
    assert x[-1] - x0 == pytest.approx((0.0, 0.008, 0.0), abs=1.5e-4)


def test_a_search_for_contact_is_bounded_in_speed_and_distance() -> None:
    given = settings(force=(0.0, 0.0, 20.0), search_speed=0.01, search_distance=0.03)
    loop = IdealLoop(ContactControl(given, T))
    x0 = MODEL.tip(Q0)[0]
    x, reason = loop.until_it_ends(np.zeros(6), 5000)
    assert 'no contact within 0.03 m while 20 N are asked for' in reason
    speeds = np.linalg.norm(np.diff(x, axis=0), axis=1) / T
    assert speeds.max() == pytest.approx(0.01, rel=1e-3)
    assert x[-1][2] - x0[2] == pytest.approx(-0.03, abs=1e-3)


@pytest.mark.slow
def test_contact_that_was_found_begins_the_search_distance_anew() -> None:
    given = settings(force=(0.0, 0.0, 20.0), search_speed=0.01, search_distance=0.03)
    loop = IdealLoop(ContactControl(given, T))
    for _ in range(4):
        for _ in range(1000):  # 20 mm
            loop.tick(np.zeros(6))
        loop.tick(wrench_along(2, 20.0))


# --- what is refused ------------------------------------------------------------------------------


def test_a_damping_below_the_bound_is_refused_with_the_figure_that_would_do() -> None:
    stiff = settings(contact_stiffness=1e5, contact_delay=5, servo_bandwidth=400.0)
    bound = 1e5 * (5 * T + 2.0 / 400.0) / 1.5
    assert minimum_damping(1e5, T, delay=5, bandwidth=400.0) == pytest.approx(bound)
    with pytest.raises(RangeError, match=r'damping is 999.0; allowed: 100'):
        Admittance(replace(stiff, damping=(1000.0, 1000.0, 999.0)), T)
    Admittance(replace(stiff, damping=(1001.0,) * 3), T)


def shaking(damping: float, mass: float, filter_time: float) -> float:
    """Velocity of the tip [m/s], half a second after a jolt, with 1 kg on the sensor.

    Args:
        damping: D_d [N s/m].
        mass: M_d [kg].
        filter_time: Of the wrench [s].
    """
    sensor = AdmittanceSettings(filter_time=filter_time)
    given = replace(sensor, damping=(damping,) * 3, mass=(mass,) * 3, enabled=True)
    loop = IdealLoop(ContactControl(given, T))
    moved = np.zeros(3)  # in the last cycle
    inertia = np.zeros(3)
    x = STATE.x
    for k in range(250):
        jolt = np.array((0.0, 1.0 * (k == 0), 0.0))
        x_next = loop.tick(np.concatenate((inertia + jolt, np.zeros(3))))
        inertia = -1.0 * (x_next - x - moved) / T**2
        moved = x_next - x
        x = x_next
    return float(np.abs(moved).max()) / T


@pytest.mark.parametrize(('mass', 'filter_time'), [(0.0, 0.0), (0.3, 0.0), (0.0, 0.004)])
def test_the_bound_of_a_payload_is_where_its_inertia_shakes_the_tip(
    mass: float, filter_time: float
) -> None:
    given = settings(payload_mass=1.0, mass=(mass,) * 3, filter_time=filter_time)
    bound = given._payload_bound(mass, T)
    assert shaking(1.1 * bound, mass, filter_time) < 1e-5
    assert not shaking(0.9 * bound, mass, filter_time) < 1e-3
    with pytest.raises(RangeError, match=f'allowed: {np.ceil(bound):.0f}'):
        replace(given, damping=(0.9 * bound,) * 3).check(3, T)


@pytest.mark.parametrize(
    ('given', 'error', 'words'),
    [
        ({'mass': (0.0,) * 6}, ArrayError, 'mass holds 6 values; expected 3 or 6, like damping'),
        ({'damping': (1.0, 1.0, 0.0)}, RangeError, 'direction 3'),
        ({'damping': (-1.0, 1.0, 1.0)}, RangeError, 'damping'),
        ({'force': (np.nan, 0.0, 0.0)}, RangeError, 'force'),
        ({'payload_center': (0.0,)}, ArrayError, 'expected 3'),
    ],
)
def test_settings_that_cannot_be_are_refused(given: Any, error: type, words: str) -> None:
    with pytest.raises(error, match=words):
        settings(**given)


def test_arrays_have_as_many_values_as_the_task_has_rows() -> None:
    with pytest.raises(ArrayError, match='expected 6, as many as dx has'):
        AdmittanceSettings().check(6, T)


def test_the_payload_is_not_changed_while_the_arm_yields() -> None:
    contact = ContactControl(settings(), T)
    with pytest.raises(PayloadError, match='set admittance.enabled to false first'):
        contact.set_settings(replace(contact.settings, payload_mass=1.0))
