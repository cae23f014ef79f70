"""A policy sends the next second of its path ten times a second; the tip goes on without a stop.

Start redres_sim, redres_controller and redres_planner first. The policy is a fake: it leads the tip
round a circle, and each of its pieces is a millimetre or so off.
"""

import time
from copy import deepcopy

import numpy as np
import rclpy
from geometry_msgs.msg import PoseStamped
from nav_msgs.msg import Path
from rclpy.time import Duration, Time

rclpy.init()
node = rclpy.create_node('learned_policy')
paths = node.create_publisher(Path, 'target_path', 1)
tips: list[PoseStamped] = []  # stamped by the clock of the robot
node.create_subscription(PoseStamped, 'controller/tip_pose', tips.append, 1)
random = np.random.default_rng()
for _ in range(60):
    until = time.monotonic() + 0.1
    while not tips or time.monotonic() < until:
        rclpy.spin_once(node, timeout_sec=0.01)
    start = Time.from_msg(tips[0].header.stamp)
    path = Path(header=tips[0].header)
    error = random.normal(0.0, 0.001, 2)  # [m] of this piece
    for ahead in np.arange(0.0, 1.0, 0.05):
        stamp = Time.from_msg(tips[-1].header.stamp) + Duration(seconds=ahead)
        angle = (stamp - start).nanoseconds / 1e9  # [rad], at 1 rad/s
        pose = deepcopy(tips[0])
        pose.header.stamp = stamp.to_msg()
        pose.pose.position.y += 0.05 * np.sin(angle) + error[0]
        pose.pose.position.z += 0.05 * (1.0 - np.cos(angle)) + error[1]
        path.poses.append(pose)
    paths.publish(path)
moved = 1e3 * (tips[-1].pose.position.y - tips[0].pose.position.y)
print(f'after {angle - 0.95:.1f} s the tip is {moved:.0f} mm to the side; the circle has 50 mm')
