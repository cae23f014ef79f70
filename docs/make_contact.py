"""Draws docs/contact.png: the least damping at which pressing is steady, measured and by the bound.

Run it with: python docs/make_contact.py. It takes several minutes.
"""

from dataclasses import replace
from itertools import product
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

from redres_ros.contact import AdmittanceSettings, minimum_damping
from redres_ros.contact.contact_control import ContactError
from redres_ros.paper.contact.scenes import FORCE, Pressing, PressingArm

T = 0.002  # [s]
ARMS = ('fr3', 'iiwa7', 'lwr4')
STIFFNESSES = (1e3, 1e4, 1e5)  # [N/m]
BANDWIDTHS = (100.0, 400.0)  # [rad/s]
DELAYS = (1, 3, 10)  # cycles
JUDGED = 0.2  # [s]
STEADY = 1.0  # [N] of ripple, largest less smallest force
_LAGS = 20.0  # of delay and servo, in which an oscillation has to fade
SEARCHED = 1.1  # factor between a damping that is steady and one that is not


def main() -> None:
    """Measure and draw."""
    figure = Figure(figsize=(9.0, 4.5), layout='constrained')
    axes = figure.subplots(1, 2, sharey=True)
    for ax, bandwidth in zip(axes, BANDWIDTHS, strict=True):
        for arm, marker in zip(ARMS, 'osx', strict=True):
            bounds = []
            measured = []
            for stiffness, delay in product(STIFFNESSES, DELAYS):
                bound = minimum_damping(stiffness, T, delay=delay, bandwidth=bandwidth)
                bounds.append(bound)
                case = Pressing(arm, T, bandwidth, stiffness, delay=delay, gap=0.0, force_limit=1e4)
                measured.append(least_damping(case, bound))
                print(
                    arm, bandwidth, stiffness, delay, f'{bound:.0f} {measured[-1]:.0f}', flush=True
                )
            ax.loglog(bounds, measured, marker, label=arm)
        ax.loglog(ax.get_xlim(), ax.get_xlim(), color='0.6', label='the bound')
        ax.set(title=f'servos of {bandwidth:g} rad/s', xlabel='bound on the damping [N s/m]')
        ax.grid(alpha=0.3)
        ax.legend(fontsize='small')
    axes[0].set_ylabel('least steady damping, measured [N s/m]')
    figure.savefig(Path(__file__).with_name('contact.png'), dpi=110)


def least_damping(case: Pressing, bound: float) -> float:
    """The least damping at which the force comes to rest [N s/m], below four times the bound.

    Args:
        case: Arm, servos, delay and table.
        bound: On the damping [N s/m].
    """
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
    settles = 0.3 + _LAGS * lag + 7.0 * case.damping / case.stiffness
    settles += 0.25 * FORCE / (case.stiffness * AdmittanceSettings().search_speed)
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
