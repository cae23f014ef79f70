"""Pressing and sliding on a simulated table, through positions: force error, impact, bounce."""

from dataclasses import replace

import numpy as np
import pytest
from contact_scenes import APPROACH, RAMP, SLIDE, Pressing, pressed

pytestmark = pytest.mark.slow

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


def test_below_the_bound_of_the_damping_the_tip_bounces() -> None:
    low = Pressing(T=0.002, bandwidth=400.0, stiffness=1e5, damping=300.0, delay=5)
    bouncing, steady = (
        pressed(case, distance=0.01).force for case in (low, replace(low, damping=1500.0))
    )
    assert bouncing[len(bouncing) // 2 :].min() == 0.0
    assert np.ptp(steady[len(steady) // 2 :]) < 1.0
