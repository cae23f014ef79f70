"""A policy sends the next second of its path ten times a second; the tip goes on without a stop.

Start redres_sim, redres_controller and redres_planner first. The policy is a fake: it leads the tip
round a circle, and each of its pieces is a millimetre or so off.
"""

import sys
import time
from copy import deepcopy
from functools import partial

import numpy as np
import rclpy
from geometry_msgs.msg import PoseStamped
from nav_msgs.msg import Path
from rclpy.qos import DurabilityPolicy, QoSProfile
from rclpy.time import Duration, Time
from std_msgs.msg import String

WORDS = ('controller/mode', 'sim/stop_reason')  # topics

rclpy.init()
node = rclpy.create_node('learned_policy')
paths = node.create_publisher(Path, 'target_path', 1)
tips: list[PoseStamped] = []  # stamped by the clock of the robot
node.create_subscription(PoseStamped, 'controller/tip_pose', tips.append, 1)
words: dict[str, String] = {}  # the newest, by topic
latched = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
for topic in WORDS:
    node.create_subscription(String, topic, partial(words.__setitem__, topic), latched)
random = np.random.default_rng()
for _ in range(60):
    seen = len(tips)
    begun = time.monotonic()
    while len(tips) == seen or time.monotonic() < begun + 0.1:
        rclpy.spin_once(node, timeout_sec=0.01)
        if time.monotonic() > begun + 30.0:
            sys.exit('no pose of the tip comes: start redres_sim and redres_controller first')
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
mode, reason = (words.get(topic, String()).data for topic in WORDS)
if mode != 'moving':
    sys.exit(f'the tip does not follow: controller/mode {mode}, sim/stop_reason {reason}')
moved = 1e3 * (tips[-1].pose.position.y - tips[0].pose.position.y)
print(f'after {angle - 0.95:.1f} s the tip is {moved:.0f} mm to the side; the circle has 50 mm')
