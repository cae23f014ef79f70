"""Not in the paper: how fast the sampled laws tend to the continuous schemes."""

from matplotlib.figure import Figure

from redres_ros.paper.runs import CONVERGING_LAWS, SIMULATION_DAMPING, Runs
from redres_ros.simulation.colours import law_colour


def figure_19(runs: Runs) -> Figure:
    """Largest error over the first segment against the sampling time, on logarithmic scales."""
    figure = Figure(figsize=(8.0, 6.0), layout='constrained')
    ax = figure.add_subplot()
    for law in CONVERGING_LAWS:
        found = runs[f'convergence_{law}']
        label = f'{law}: slope {found.q_order:.3f}'
        ax.loglog(1e3 * found.periods, found.q_errors, 'o-', label=label, color=law_colour(law))
    slope = 0.5 * found.q_errors[0] * found.periods / found.periods[0]
    ax.loglog(1e3 * found.periods, slope, '--', color='0.6', label='slope 1')
    ax.set_xticks(1e3 * found.periods, [f'{1e3 * T:g}' for T in found.periods], minor=False)
    ax.minorticks_off()
    ax.set(
        xlabel='sampling time T [ms]',
        ylabel=r'largest $\Vert q_k-q(t_k)\Vert$ [rad]',
        title='Figure 19. Velocity laws against their schemes in continuous time,\n'
        f'first segment, $k_d$ = {SIMULATION_DAMPING:g} s$^{{-1}}$',
    )
    ax.grid(alpha=0.3)
    ax.legend()
    return figure
