"""Draws docs/contact.png: the least damping at which pressing is steady, measured and by the bound.

Run it with: python docs/make_contact.py. It takes several minutes.
"""

from itertools import product
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

from redres_ros import Controller, RobotModel, make_law
from redres_ros.contact import AdmittanceSettings, ContactControl, minimum_damping
from redres_ros.fake_robot.environment import EnvironmentSettings
from redres_ros.fake_robot.mujoco_arm import MujocoSettings
from redres_ros.fake_robot.plant import MujocoPlant

T = 0.002  # [s]
FORCE = 20.0  # [N]
ARMS = ('fr3', 'iiwa7', 'lwr4')
STIFFNESSES = (1e3, 1e4, 1e5)  # [N/m]
BANDWIDTHS = (100.0, 400.0)  # [rad/s]
DELAYS = (1, 3, 10)  # cycles
JUDGED = 0.2  # [s]
STEADY = 1.0  # [N] of ripple, largest less smallest force
SEARCHED = 1.25  # factor from one damping to the next


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
                measured.append(least_damping(arm, stiffness, bandwidth, delay, bound))
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


def least_damping(arm: str, stiffness: float, bandwidth: float, delay: int, bound: float) -> float:
    """The least damping at which the force comes to rest [N s/m], sought from twice the bound on.

    Args:
        arm: Its name.
        stiffness: Of the table [N/m].
        bandwidth: Of the servos [rad/s].
        delay: From a contact to the response [cycles].
        bound: On the damping [N s/m].
    """
    damping = 2.0 * bound
    while damping > 0.02 * bound and ripple(arm, stiffness, bandwidth, delay, damping) < STEADY:
        damping /= SEARCHED
    return damping * SEARCHED


def ripple(arm: str, stiffness: float, bandwidth: float, delay: int, damping: float) -> float:
    """Largest less smallest force once the tip has had time to press steadily [N].

    Args:
        arm: Its name.
        stiffness: Of the table [N/m].
        bandwidth: Of the servos [rad/s].
        delay: From a contact to the response [cycles].
        damping: Of the admittance [N s/m].
    """
    model = RobotModel.named(arm)
    q = np.array(model.arm.start)
    x, _ = model.tip(q)
    environment = EnvironmentSettings('table', tuple(x), contact_stiffness=stiffness)
    plant = MujocoPlant(model.arm, T, q, MujocoSettings(servo_bandwidth=bandwidth), environment)
    law = make_law('minimum_acceleration', damping=10.0)
    limits = ('position', 'velocity', 'acceleration')
    controller = Controller(model, law, T, limits=limits)
    settings = AdmittanceSettings(
        enabled=True,
        damping=(1e6, 1e6, damping),
        force=(0.0, 0.0, FORCE),
        force_limit=1e4,
    )
    contact = ContactControl(settings, T)
    on_the_way = [q] * (delay - 1)
    settles = 0.3 + 7.0 * damping / stiffness + 0.25 * FORCE / (stiffness * settings.search_speed)
    forces = []
    for _ in range(round((settles + JUDGED) / T)):
        state = model.state(plant.q, np.zeros(model.n))
        forces.append((state.R @ plant.wrench[:3])[2])
        contact.sensor.enter(plant.wrench)
        command = controller.update(plant.q, contact.velocity(np.zeros(3), state))
        contact.record(command, np.zeros(3))
        on_the_way.append(command.q_ref)
        plant.step(on_the_way.pop(0))
    return float(np.ptp(forces[-round(JUDGED / T) :]))


if __name__ == '__main__':
    main()
