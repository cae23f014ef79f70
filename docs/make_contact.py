"""Measures what the package promises about contact: docs/contact.csv, and docs/contact.png, the
least damping at which pressing is steady beside its bound.

Run it with: python docs/make_contact.py. It takes several minutes, and needs the extra test.
"""

import csv
import sys
from collections.abc import Iterator
from dataclasses import replace
from itertools import product
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

sys.path.insert(0, str(Path(__file__).parents[1] / 'test'))

from contact_scenes import COMPLIANCE, FORCE, LAW, Pressing, PressingArm, elbow_pushed, pressed
from test_impedance import (
    FORCE_CONTROL,
    IMPEDANCE,
    by_scheme,
    by_velocity,
    pushed_tip,
    wall_below,
)

from redres_ros import make_law
from redres_ros.contact import ContactError
from redres_ros.laws import Law
from redres_ros.preferences import Compliance

T = 0.002  # [s]
SEARCH_SPEED = 0.02  # [m/s] of ContactControl
ARMS = ('fr3', 'iiwa7', 'lwr4')
STIFFNESSES = (1e3, 1e4, 1e5)  # [N/m]
BANDWIDTHS = (100.0, 400.0)  # [rad/s]
DELAYS = (1, 3, 10)  # cycles
JUDGED = 0.2  # [s]
STEADY = 1.0  # [N] of ripple, largest less smallest force
LAGS = 20.0  # of delay and servo, in which an oscillation has to fade
SEARCHED = 1.1  # factor between a damping that is steady and one that is not
LEVELS = {
    'minimum_acceleration': 'The admittance with law (23) is impedance and force control on the '
    'acceleration level, (22)',
    'dynamically_consistent': 'With law (32) it is that on the torque level, with a dynamically '
    'consistent null space, (29)',
    'minimum_weighted_torque': 'With law (27) it is that with the torque of least norm M^-2, (25)',
}
# Gains k of the compliance by torque law, whose weight is M^p with p = 0, 1, 2, and arm.
TORQUE_LAWS = {
    'minimum_weighted_torque': {'fr3': 1.0, 'iiwa7': 1.0, 'lwr4': 1.0, 'gen3': 1.0},
    'dynamically_consistent': {'fr3': 0.15, 'iiwa7': 0.15, 'lwr4': 3.0, 'gen3': 0.05},
    'minimum_torque': {'fr3': 0.03, 'iiwa7': 0.01, 'lwr4': 10.0, 'gen3': 0.02},
}

Row = tuple[str, str, bool, str]  # section, claim, whether it holds, measured


def main() -> None:
    """Measure, write and draw."""
    with Path(__file__).with_name('contact.csv').open('w', newline='', encoding='utf-8') as file:
        writer = csv.writer(file)
        writer.writerow(('section', 'claim', 'held', 'measured', 'remark'))
        for section, claim, held, measured in (*levels(), *pressings(), *elbows()):
            print(f'{section}: {claim}: {measured}', flush=True)
            writer.writerow((section, claim, 'yes' if held else 'no', measured, ''))
    draw_bound()


def levels() -> Iterator[Row]:
    """A law and its scheme of second order while a hand pushes tip and elbow."""
    for law, claim in LEVELS.items():
        free, on_table = (
            float(np.linalg.norm(by_velocity(law, *case) - by_scheme(law, *case), axis=1).max())
            for case in ((IMPEDANCE, pushed_tip), (FORCE_CONTROL, wall_below))
        )
        measured = (
            f'largest |dq_I - dq_II| {free:.1e} rad/s (impedance), '
            f'{on_table:.1e} rad/s (20 N on a table of 10 kN/m)'
        )
        yield 'level', claim, max(free, on_table) <= 1e-9, measured


def pressings() -> Iterator[Row]:
    """The tip presses and slides."""
    promised = 'RMS at most 0.02 N, peak at most 25 N, no bounce'
    claims = {
        f'Pressing 20 N and sliding 0.3 m at 50 mm/s: {promised}': (0.0, 1000.0, 0.02),
        'The same with 1 N of noise: RMS at most 0.2 N': (1.0, 3000.0, 0.2),
    }
    for claim, (noise, hard_damping, rms) in claims.items():
        held = True
        found = []
        for stiffness, damping in ((1e4, 1000.0), (1e5, hard_damping)):
            run = pressed(Pressing(stiffness=stiffness, damping=damping, noise=noise))
            stays = bool((run.force[run.first :] > 0.0).all())
            held = held and stays and run.rms <= rms and run.force.max() <= 25.0
            found.append(
                f'{1e-3 * stiffness:g} kN/m, {damping:g} N s/m: RMS {run.rms:.3f} N, '
                f'peak {run.force.max():.1f} N' + ('' if stays else ', bounces')
            )
        yield 'press', claim, held, '; '.join(found)


def elbows() -> Iterator[Row]:
    """An elbow that is pushed yields, with law (23) and with those that minimise torques."""
    for arm in TORQUE_LAWS['minimum_torque']:
        claim = (
            f'{arm}: 30 N on the elbow for a second while the tip presses 20 N: it gives 30 mm and '
            'comes back, RMS below 0.05 N, tip within 0.4 mm; in free space within 0.2 mm'
        )
        (pressing, one), (free, two) = (yields(arm, is_pressing) for is_pressing in (True, False))
        yield 'elbow', claim, pressing and free, f'pressing: {one}; free: {two}'
    for law, gains in TORQUE_LAWS.items():
        for arm, gain in gains.items():
            claim = f'{arm}, {law}: pressing, the same with gravity 0, gain {gain:g}'
            compliance = Compliance(gain=gain)
            carrying = make_law(law, damping=10.0, gravity=0.0)
            yield 'elbow', claim, *yields(arm, True, carrying, compliance)


def yields(
    arm: str, presses: bool, law: Law = LAW, compliance: Compliance = COMPLIANCE
) -> tuple[bool, str]:
    """Whether an elbow yields as promised, and figures."""
    run = elbow_pushed(arm, presses, law, compliance)
    give = float(run.elbow.max())
    shown = f'gives {1e3 * give:.0f} mm, {1e3 * run.elbow[-1]:.0f} mm left'
    if not presses:
        apart = float(np.linalg.norm(run.tip, axis=1).max())
        return give >= 0.03 and apart < 2e-4, f'{shown}, tip {1e3 * apart:.2f} mm'
    along = float(np.linalg.norm(run.tip[:, :2], axis=1).max())
    comes_back = abs(run.elbow[-1]) < 0.15 * give
    held = give >= 0.03 and comes_back and run.rms < 0.05 and along < 4e-4
    return held, f'{shown}, RMS {run.rms:.3f} N, tip {1e3 * along:.2f} mm'


def draw_bound() -> None:
    """The least steady damping over the bound."""
    figure = Figure(figsize=(9.0, 4.5), layout='constrained')
    axes = figure.subplots(1, 2, sharey=True)
    for ax, bandwidth in zip(axes, BANDWIDTHS, strict=True):
        for arm, marker in zip(ARMS, 'osx', strict=True):
            bounds = []
            measured = []
            for stiffness, delay in product(STIFFNESSES, DELAYS):
                # an integrator behind a delay and a servo: 1.5 rad of phase at the crossover
                bound = stiffness * (delay * T + 2.0 / bandwidth) / 1.5
                case = Pressing(arm, T, bandwidth, stiffness, delay=delay, gap=0.0, force_limit=1e4)
                bounds.append(bound)
                measured.append(least_damping(case, bound))
            ax.loglog(bounds, measured, marker, label=arm)
        ax.loglog(ax.get_xlim(), ax.get_xlim(), color='0.6', label='the bound')
        ax.set(title=f'servos of {bandwidth:g} rad/s', xlabel='bound on the damping [N s/m]')
        ax.grid(alpha=0.3)
        ax.legend(fontsize='small')
    axes[0].set_ylabel('least steady damping, measured [N s/m]')
    figure.savefig(Path(__file__).with_name('contact.png'), dpi=110)


def least_damping(case: Pressing, bound: float) -> float:
    """The least damping at which the force comes to rest, below four times the bound [N s/m]."""
    bouncing = 0.02 * bound
    steady = 4.0 * bound
    while steady > SEARCHED * bouncing:
        damping = float(np.sqrt(bouncing * steady))
        if ripple(replace(case, damping=damping)) < STEADY:
            steady = damping
        else:
            bouncing = damping
    return steady


def ripple(case: Pressing) -> float:
    """Largest less smallest force once the tip has had time to press steadily [N]."""
    pressing = PressingArm(case)
    lag = case.delay * T + 2.0 / case.bandwidth
    settles = 0.3 + LAGS * lag + 7.0 * case.damping / case.stiffness
    settles += 0.25 * FORCE / (case.stiffness * SEARCH_SPEED)
    forces = []
    for _ in range(round((settles + JUDGED) / T)):
        state = pressing.state()
        forces.append(pressing.force(state))
        try:
            pressing.advance(state, np.zeros(3))
        except ContactError:
            return np.inf
    last = np.array(forces[-round(JUDGED / T) :])
    return float(np.ptp(last)) if last.mean() > 0.5 * FORCE else np.inf


if __name__ == '__main__':
    main()
