"""Pressing and sliding on a simulated table, through positions: force error, impact, bounce."""

from dataclasses import replace

import numpy as np
import pytest
from contact_scenes import APPROACH, RAMP, SLIDE, Pressing, pressed

pytestmark = pytest.mark.slow


def check_pressed(case: Pressing, rms: float, distance: float = 0.3) -> None:
    """What is asked of pressing and sliding a distance [m]; `rms` is the largest error of the force
    [N].
    """
    run = pressed(case, distance)
    x = run.x
    approach = -(x[run.first - 1] - x[run.first - 11])[2] / (10 * case.T)
    assert approach == pytest.approx(APPROACH, rel=0.02)
    assert run.force.max() <= 25.0
    assert (run.force[run.first :] > 0.0).all()  # no bounce
    assert run.rms <= rms
    # the ramp takes half of its time
    assert x[-1][1] - x[0][1] == pytest.approx(distance + 0.5 * RAMP * SLIDE, abs=2e-3)


def test_20_N_are_kept_on_a_hard_wall_over_0_3_m() -> None:
    check_pressed(Pressing(stiffness=1e5), rms=0.02)


@pytest.mark.nightly
def test_20_N_are_kept_on_a_softer_wall() -> None:
    check_pressed(Pressing(stiffness=1e4), rms=0.02)


@pytest.mark.nightly
@pytest.mark.parametrize(('stiffness', 'damping'), [(1e4, 1000.0), (1e5, 3000.0)])
def test_20_N_are_kept_with_a_noise_of_1_N(stiffness: float, damping: float) -> None:
    check_pressed(Pressing(stiffness=stiffness, damping=damping, noise=1.0), rms=0.2)


@pytest.mark.nightly
@pytest.mark.parametrize('arm', ['fr3', 'iiwa7', 'lwr4_paper'])
def test_slow_servos_and_a_cycle_of_2_ms_press_as_steadily(arm: str) -> None:
    case = Pressing(arm, T=0.002, bandwidth=100.0, stiffness=1e5)
    check_pressed(case, rms=0.05, distance=0.05)


def test_below_the_bound_of_the_damping_the_tip_bounces() -> None:
    low = Pressing(T=0.002, bandwidth=400.0, stiffness=1e5, damping=300.0, delay=5)
    force = pressed(low, distance=0.01).force
    settled = force[len(force) // 2 :]
    assert settled.min() == 0.0
    force = pressed(replace(low, damping=1500.0), distance=0.01).force
    settled = force[len(force) // 2 :]
    assert np.ptp(settled) < 1.0
