"""Keep a law within the limits of the joints.

Near the stretched arm the law of least velocity wants accelerations that the joints do not have.
With limits the tip keeps to its path, and goes more slowly where it must.
Run it with: python examples/within_limits.py
"""

import numpy as np

from redres_ros import Controller, RobotModel, load_task, make_law, run

T = 0.002  # sampling time [s]

task = load_task('rectangle')
model = RobotModel.named(task.robot)
law = make_law('minimum_velocity')

for limits in ((), ('position', 'velocity', 'acceleration')):
    recording = run(Controller(model, law, T, limits=limits), task)
    ddq = np.diff(recording.vectors('dq1'), axis=0) / T  # (ticks - 1, 7) [rad/s^2]
    share = np.abs(ddq / model.arm.acceleration_limit).max()
    slowest = recording['task_scaling'].min()
    print(
        f'{len(limits)} limits: {share:7.2%} of the acceleration that the joints have, '
        f'{slowest:.0%} of the speed where it is slowest, {recording["t"][-1]:.2f} s in all'
    )
