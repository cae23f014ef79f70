"""Draws docs/null_space_stability.png: the bound on k_d T, and the postures of two arms beside it.

Run it with: python docs/make_null_space_stability.py. It takes half a minute.
"""

from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from redres_ros import RobotModel, make_law
from redres_ros.loop.null_space_stability import linearised
from redres_ros.simulation.colours import law_colour

DAMPING = 10.0  # k_d [1/s]
LAWS = ('minimum_weighted_torque', 'dynamically_consistent', 'minimum_torque')
SHOWN = (('gen3', 0.01), ('gen3', 0.002), ('iiwa7', 0.002))  # arm, T [s]
POSTURES = 600
RANGE = 3.0  # [rad] of joints that turn further
LEAST = 1e-3  # that is drawn; what is less lies on the edge


def main() -> None:
    """Measure and draw."""
    figure = Figure(figsize=(11.0, 3.8), layout='constrained')
    axes = figure.subplots(1, len(SHOWN), sharex=True, sharey=True)
    for ax, (arm, T) in zip(axes, SHOWN, strict=True):
        draw_bound(ax)
        for law in LAWS:
            draw_postures(ax, RobotModel.named(arm), law, T)
        ax.set_title(f'{arm}, T = {1e3 * T:g} ms', fontsize='medium')
        ax.set_xlabel(r'$a\,T^2 / (2 - k_d T)$')
        ax.grid(alpha=0.3)
    axes[0].set_ylabel(r'$|b|\,T / k_d$')
    figure.legend(*axes[0].get_legend_handles_labels(), loc='outside lower center', ncols=4)
    figure.savefig(Path(__file__).with_name('null_space_stability.png'), dpi=110)


def draw_bound(ax: Axes) -> None:
    """The unit circle about (1, 0), inside which a posture is stable."""
    u = np.geomspace(1e-7, 2.0, 400)
    ax.loglog(u, np.sqrt(np.maximum(2.0 * u - u**2, LEAST**2)), 'k', lw=1.0, label='bound')
    ax.set(xlim=(1e-7, 1e2), ylim=(0.7 * LEAST, 1e1))


def draw_postures(ax: Axes, model: RobotModel, law: str, T: float) -> None:
    """The worst kappa of random postures: filled if the sampled loop is stable, else a ring.

    Args:
        ax: Where.
        model: The arm.
        law: Its name.
        T: Sampling time [s].
    """
    colour = law_colour(law)
    random = np.random.default_rng(1)
    lower = np.maximum(model.q_min, -RANGE)
    upper = np.minimum(model.q_max, RANGE)
    agreed = 0
    pulling = 0
    for q in random.uniform(lower, upper, (POSTURES, model.n)):
        kappa, radius = linearised(model, make_law(law, damping=DAMPING), T, q)
        if kappa.real.min() <= 0.0:
            continue  # on a hill, from which every arm falls
        u = kappa.real * T**2 / (2.0 - DAMPING * T)
        v = np.abs(kappa.imag) * T / DAMPING
        worst = int(np.argmax((u - 1.0) ** 2 + v**2))
        is_inside = (u[worst] - 1.0) ** 2 + v[worst] ** 2 < 1.0
        is_stable = radius < 1.0
        agreed += is_inside == is_stable
        pulling += 1
        face = colour if is_stable else 'none'
        ax.plot(u[worst], max(v[worst], LEAST), 'o', ms=4, mec=colour, mfc=face)
    ax.plot([], [], 'o', ms=4, color=colour, label=law)
    print(f'{model.arm.source} {law} T = {T:g} s: {agreed} of {pulling} as the bound says')


if __name__ == '__main__':
    main()
