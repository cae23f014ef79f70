"""Move the tip of an arm along a straight line, and see what the joints do.

Run it with: python examples/first_motion.py
"""

import numpy as np

from redres_ros import Controller, RobotModel, make_law

T = 0.001  # sampling time [s]
DURATION = 2.0  # [s]
DX = np.array([0.0, -0.1, 0.0])  # desired velocity of the tip [m/s]

model = RobotModel.named('lwr4_paper')  # or RobotModel.from_urdf('arm.urdf', 'tool0')
law = make_law('minimum_acceleration', damping=10.0)
controller = Controller(model, law, T)

q = np.radians([28.08, 104.12, 114.59, 94.85, 14.32, -28.12, 0.0])  # (7,)
x_start = model.tip(q)[0]  # (3,)
fastest = 0.0

for _ in range(round(DURATION / T)):
    command = controller.update(q, DX)
    q = command.q_ref  # an ideal arm
    fastest = max(fastest, float(np.linalg.norm(command.dq)))

x_end = model.tip(q)[0]
print(f'the tip moved by:      {np.round(x_end - x_start, 4)} m')
print(f'fastest joint motion:  {fastest:.3f} rad/s')
