"""Draws docs/limits.png: one law on the paper's task, alone and within the limits of the joints.

Run it with: python docs/make_limits.py
"""

from pathlib import Path

from matplotlib.figure import Figure

from redres_ros import Controller, RobotModel, load_task, make_law, run
from redres_ros.simulation.shares import acceleration_share

T = 0.002  # sampling time [s]
LIMITS = ('position', 'velocity', 'acceleration')
RUNS = {
    'minimum_velocity': ('minimum_velocity', (), '0.6'),
    'the same within the limits': ('minimum_velocity', LIMITS, 'tab:blue'),
    'minimum_acceleration': ('minimum_acceleration', (), 'tab:orange'),
}


def main() -> None:
    """Run the three motions and draw them."""
    task = load_task('rectangle')
    model = RobotModel.named(task.robot)
    figure = Figure(figsize=(8.0, 5.0), layout='constrained')
    shares, scaling = figure.subplots(2, 1, sharex=True, height_ratios=(2.0, 1.0))
    for label, (law, limits, color) in RUNS.items():
        recording = run(Controller(model, make_law(law), T, limits=limits), task)
        t = recording['t']
        shares.plot(t, acceleration_share(recording, model), color=color, label=label)
        scaling.plot(t, recording['task_scaling'], color=color)
    shares.axhline(1.0, color='tab:red', ls='--', lw=1.0, label='limit')
    shares.set_yscale('log')
    shares.set_ylim(1e-2, 5.0)
    shares.set_ylabel('largest acceleration\n[share of the limit]')
    shares.legend(loc='upper left', fontsize='small', ncols=2)
    scaling.set_ylabel('task scaling $s$')
    scaling.set_xlabel('time [s]')
    for ax in (shares, scaling):
        ax.grid(alpha=0.3)
    figure.savefig(Path(__file__).with_name('limits.png'), dpi=110)


if __name__ == '__main__':
    main()
