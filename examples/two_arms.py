"""Two arms on one torso: the left hand draws a circle, and the right one stays where it is.

Both are tasks of one controller, in order of priority. Turning the torso helps the left hand and
would move the right one; what the second task keeps is that it does not. Where both are not
possible, the first one wins: with --far the circle is out of the left arm's reach without a turn of
the torso that the right arm cannot make up for. Run it with: python examples/two_arms.py
"""

import argparse
import math
from pathlib import Path

import numpy as np

from redres_ros import Controller, RobotModel
from redres_ros.robots import Arm
from redres_ros.tasks import Position

T = 0.002  # [s]
TURN = 4.0  # [s] for a round of the circle
GAIN = 10.0  # of the feedback to the circle [1/s]
ARM = Arm(
    Path(__file__).with_name('two_arms.urdf'),
    tip_frame='left_hand',
    other_tips=('right_hand',),
    acceleration_limit=(5.0, *(10.0,) * 6),
)
START = np.array((0.0, 0.1, 0.7, -1.4, -0.1, 0.7, -1.4))  # torso; yaw, pitch, elbow of each arm

parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
parser.add_argument('--far', action='store_true', help='a circle of 0.4 m in place of 0.1 m')
options = parser.parse_args()
radius = 0.4 if options.far else 0.1  # [m]

model = RobotModel(ARM)
controller = Controller(
    model,
    'minimum_acceleration',
    T,
    limits=('position', 'velocity', 'acceleration'),
    secondary_tasks=(Position(frame='right_hand'),),
)
q = START
held = model.position(q, 'right_hand')
wanted = model.position(q, 'left_hand')
errors = np.zeros((0, 2))  # [m] of the left hand, and of the right one
for k in range(round(TURN / T)):
    angle = 2.0 * math.pi * k * T / TURN
    speed = 2.0 * math.pi * radius / TURN * min(angle, 1.0)  # from rest
    dx = speed * np.array((0.0, -math.sin(angle), math.cos(angle)))
    feedback = GAIN * (wanted - model.position(q, 'left_hand'))
    command = controller.update(q, dx + feedback)
    wanted = wanted + command.s * T * dx
    q = command.q_ref
    left = np.linalg.norm(model.position(q, 'left_hand') - wanted)
    right = np.linalg.norm(model.position(q, 'right_hand') - held)
    errors = np.vstack((errors, (left, right)))

print(f'joints: {", ".join(model.joint_names)}')
print(f'the left hand was {1e3 * errors[:, 0].max():.2f} mm off its path at most')
print(f'the right hand was {1e3 * errors[:, 1].max():.2f} mm from its place at most')
