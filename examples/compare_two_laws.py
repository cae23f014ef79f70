"""Run the paper's task with two laws, and compare what they ask of the joints.

Run it with: python examples/compare_two_laws.py
"""

from redres_ros import Controller, RobotModel, load_task, make_law, run

T = 0.002  # sampling time [s]

task = load_task('rectangle')
model = RobotModel.named(task.robot)

for name in ('minimum_velocity', 'minimum_acceleration'):
    controller = Controller(model, make_law(name), T)
    recording = run(controller, task)
    peak, at = recording.peak('joint_acceleration_norm')
    print(f'{name:<24} largest joint acceleration {peak:6.2f} rad/s^2, at {at:.2f} s')
