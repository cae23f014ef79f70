"""Pressing and sliding on a simulated table, through positions: force error, impact, bounce."""

from dataclasses import dataclass, replace

import numpy as np
import pytest

from redres_ros import Controller, RobotModel, make_law
from redres_ros.contact import AdmittanceSettings, ContactControl
from redres_ros.fake_robot.environment import EnvironmentSettings
from redres_ros.fake_robot.mujoco_arm import MujocoSettings
from redres_ros.fake_robot.plant import MujocoPlant

FORCE = 20.0  # [N]
APPROACH = 0.02  # [m/s]
GAP = 0.005  # [m] from the start to the surface
SLIDE = 0.05  # [m/s]
RAMP = 0.2  # [s] in which it is reached
PRESSED = 1.5  # [s] after which the tip slides
SETTLED = 2.0  # [s] after which the force is judged
STIFF = 1e6  # [N s/m] of directions that do not yield


@dataclass(frozen=True)
class Case:
    """An arm, its cycle and servos, a surface, and the damping across it."""

    arm: str = 'fr3'
    T: float = 0.001
    bandwidth: float = 400.0
    stiffness: float = 1e4
    damping: float = 1000.0
    noise: float = 0.0
    delay: int = 1  # cycles from a state to the motion
    distance: float = 0.3


def pressed(case: Case) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Times (N,) [s], force of a table on the tip (N,) [N], the tip's positions (N, 3) [m]."""
    model = RobotModel.named(case.arm)
    q0 = np.array(model.arm.start)
    x0, _ = model.tip(q0)
    surface = tuple(x0 - np.array((0.0, 0.0, GAP)))
    environment = EnvironmentSettings('table', surface, contact_stiffness=case.stiffness)
    servo = MujocoSettings(servo_bandwidth=case.bandwidth)
    plant = MujocoPlant(model.arm, case.T, q0, servo, environment)
    limits = ('position', 'velocity', 'acceleration')
    law = make_law('minimum_acceleration', damping=10.0)
    controller = Controller(model, law, case.T, limits=limits)
    settings = AdmittanceSettings(
        enabled=True, damping=(STIFF, STIFF, case.damping), force=(0.0, 0.0, FORCE)
    )
    contact = ContactControl(settings, case.T)
    random = np.random.default_rng(0)
    on_the_way = [q0] * (case.delay - 1)
    forces = []
    positions = []
    times = case.T * np.arange(round((PRESSED + RAMP + case.distance / SLIDE) / case.T))
    for t in times:
        state = model.state(plant.q, np.zeros(model.n))
        wrench = plant.wrench
        forces.append((state.R @ wrench[:3])[2])
        positions.append(state.x)
        contact.sensor.enter(wrench + case.noise * random.normal(size=6))
        touched = max(forces) > 0.0
        down = 0.0 if touched else -(APPROACH - min(APPROACH, FORCE / case.damping))
        along = SLIDE * float(np.clip((t - PRESSED) / RAMP, 0.0, 1.0))
        dx = np.array((0.0, along, down))
        command = controller.update(plant.q, contact.velocity(dx, state))
        contact.record(command, dx)
        on_the_way.append(command.q_ref)
        plant.step(on_the_way.pop(0))
    return times, np.array(forces), np.array(positions)


def check_pressed(case: Case, rms: float) -> None:
    """What is asked of pressing and sliding; `rms` is the largest error of the force [N]."""
    times, force, x = pressed(case)
    first = int(np.argmax(force > 0.0))
    approach = -(x[first - 1] - x[first - 11])[2] / (10 * case.T)
    assert approach == pytest.approx(APPROACH, rel=0.02)
    assert force.max() <= 25.0
    assert (force[first:] > 0.0).all()  # no bounce
    sliding = force[times >= SETTLED] - FORCE
    assert np.sqrt(np.mean(sliding**2)) <= rms
    # the ramp takes half of its time
    assert x[-1][1] - x[0][1] == pytest.approx(case.distance + 0.5 * RAMP * SLIDE, abs=2e-3)


def test_20_N_are_kept_on_a_hard_wall_over_0_3_m() -> None:
    check_pressed(Case(stiffness=1e5), rms=0.02)


@pytest.mark.nightly
def test_20_N_are_kept_on_a_softer_wall() -> None:
    check_pressed(Case(stiffness=1e4), rms=0.02)


@pytest.mark.nightly
@pytest.mark.parametrize(('stiffness', 'damping'), [(1e4, 1000.0), (1e5, 3000.0)])
def test_20_N_are_kept_with_a_noise_of_1_N(stiffness: float, damping: float) -> None:
    check_pressed(Case(stiffness=stiffness, damping=damping, noise=1.0), rms=0.2)


@pytest.mark.nightly
@pytest.mark.parametrize('arm', ['fr3', 'iiwa7', 'lwr4_paper'])
def test_slow_servos_and_a_cycle_of_2_ms_press_as_steadily(arm: str) -> None:
    case = Case(arm, T=0.002, bandwidth=100.0, stiffness=1e5, distance=0.05)
    check_pressed(case, rms=0.05)


def test_below_the_bound_of_the_damping_the_tip_bounces() -> None:
    low = Case(T=0.002, bandwidth=400.0, stiffness=1e5, damping=300.0, delay=5, distance=0.01)
    _, force, _ = pressed(low)
    settled = force[len(force) // 2 :]
    assert settled.min() == 0.0
    _, force, _ = pressed(replace(low, damping=1500.0))
    settled = force[len(force) // 2 :]
    assert np.ptp(settled) < 1.0
